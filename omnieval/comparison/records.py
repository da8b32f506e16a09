"""Runs of every kind as one list: rows of ablations, replays, and localisations of sequences in maps."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import polars as pl

from omnieval.ablation.store import KIND as ABLATION
from omnieval.ablation.store import TABLE, Store, rows_table
from omnieval.errors import ResultError
from omnieval.localization.intervals import intervals_of_answers
from omnieval.localization.measures import METRICS as FINDING
from omnieval.localization.run import KIND as LOCALIZATION
from omnieval.localization.run import Localization, open_localization
from omnieval.metrics.catalogue import METRICS, UPKEEP
from omnieval.results.compare import determining
from omnieval.results.intervals import intervals_of_run
from omnieval.results.manifest import kind_of, read_manifest
from omnieval.results.run_folder import Run, open_run
from omnieval.statistics.estimate import Estimate

_RESULTS = frozenset((*METRICS, *UPKEEP, *FINDING, "batch_silhouette", "smallest_margin", "seconds"))


@dataclass(frozen=True)
class Record:
    """A run.

    Attributes
    ----------
    labels
        What was run: dataset, source, mapper, descriptor, strategy, parameters.
    case
        The images it was run on; runs of two methods on one case are a pair.
    varied
        Names of labels that are varied for all runs beside it: equal in a pair, unless they tell the methods apart.
    metrics
        Its results, null where a metric has no value; empty if it did not finish.
    finished
        Whether it finished.
    within
        Gives the interval of a metric over the images of this run; None where it has none.
    """

    labels: Mapping[str, Any]
    case: tuple[Any, ...]
    metrics: Mapping[str, float | int | None]
    finished: bool
    varied: tuple[str, ...] = ()
    within: Callable[[str], Estimate | None] = field(default=lambda metric: None, compare=False)


def read_records(folders: Iterable[Path]) -> list[Record]:
    """Return the runs in folders of results.

    Raises
    ------
    ResultError
        If a folder holds no runs, cannot be read, or is named twice.
    """
    found: list[Record] = []
    seen: set[Path] = set()
    for folder in folders:
        if folder.resolve() in seen:
            raise ResultError(f"{folder} is named twice; name it once")
        seen.add(folder.resolve())
        kind = kind_of(folder)
        if kind == ABLATION:
            found += ablation_records(*_ablation(folder))
        elif kind == LOCALIZATION:
            found += _localizations(open_localization(folder))
        else:
            found.append(_of_run(open_run(folder)))
    return found


def ablation_records(table: pl.DataFrame, varied: Iterable[str]) -> list[Record]:
    """Return the rows of an ablation (`schemas.ablation_schema`).

    Parameters
    ----------
    table
        The rows.
    varied
        Names of the parameters that are varied.
    """
    labels = [name for name in table.columns if name not in _RESULTS and name not in ("job", "error")]
    shared = [name for name in varied if name in table.columns and not table[name].null_count()]
    shared = [name for name in shared if name not in ("mapper", "descriptor")]
    return [
        Record(
            labels={name: row[name] for name in labels},
            case=(row["source"],),
            metrics={} if row["error"] else {name: row[name] for name in _RESULTS if name in row},
            finished=row["error"] is None,
            varied=tuple(shared),
        )
        for row in table.iter_rows(named=True)
    ]


def _ablation(folder: Path) -> tuple[pl.DataFrame, list[str]]:
    manifest = read_manifest(folder, ABLATION)
    try:
        whole = folder / TABLE
        table = (
            pl.read_parquet(whole) if whole.exists() else rows_table(Store(folder).rows(), manifest["grid"]["types"])
        )
        varied = list(manifest["grid"]["axes"])
    except (OSError, LookupError, pl.exceptions.PolarsError) as error:
        raise ResultError(f"cannot read {folder}: {error}; run it again") from error
    if "exact" in table.columns and table["exact"].null_count() < len(table):
        raise ResultError(f"{folder} has pieces of an interval, not runs; compare an ablation without --exact")
    if manifest.get("shard"):
        raise ResultError(f"{folder} is a shard of an ablation; merge all of them (omnieval ablate --merge)")
    if table.is_empty() or manifest.get("jobs") != len(table):  # which runs are missing is not known from the others
        raise ResultError(f"{folder} is not complete; continue with omnieval ablate --out {folder} --resume")
    return table, varied


def _of_run(run: Run) -> Record:
    manifest = run.manifest
    own = {"run": str(run.folder), "dataset": manifest["sequence"], "source": manifest["source"]}
    cut = manifest["cut"]
    metrics = {**run.metrics, **{name: manifest.get("timings", {}).get(name) for name in UPKEEP}}
    finished = run.status == "complete"
    return Record(
        labels={**own, **{name: value for name, value in determining(run).items() if name not in own}},
        case=(manifest["source"], cut["start"], cut["stride"], cut["limit"]),
        metrics=metrics if finished else {},
        finished=finished,
        within=intervals_of_run(run),
    )


def _localizations(found: Localization) -> Iterator[Record]:
    manifest = found.manifest
    of_map = manifest["map"]
    for query in manifest["queries"]:
        for strategy in manifest["strategies"]:
            sequence = query["sequence"]
            metrics = manifest["metrics"].get(sequence, {}).get(strategy)
            yield Record(
                labels={
                    "run": str(found.folder),
                    "dataset": sequence,
                    "source": query["source"],
                    "map": of_map["sequence"],
                    "mapper": manifest["mapper"]["name"],
                    "descriptor": manifest["descriptor"]["name"],
                    "strategy": strategy,
                },
                case=(query["source"], *query["cut"].values(), of_map["sequence"]),
                metrics=metrics or {},
                finished=metrics is not None,
                within=intervals_of_answers(found, sequence, strategy),
            )
