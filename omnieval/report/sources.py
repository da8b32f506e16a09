"""What stands at the paths of a report: replays, sweeps, baselines and localisations, a record each."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import polars as pl

from omnieval.ablation.store import BEST, TABLE, Store, rows_table
from omnieval.ablation.store import KIND as ABLATION
from omnieval.benchmark import KIND as BASELINE
from omnieval.benchmark import TABLE as PARTITIONS
from omnieval.config import Config
from omnieval.errors import ResultError
from omnieval.localization.run import KIND as LOCALIZATION
from omnieval.localization.run import Localization, open_localization
from omnieval.mapping.interface import Method
from omnieval.material.material import Material
from omnieval.material.opening import opened
from omnieval.material.reopened import described_again, held_against, reopened
from omnieval.material.source import Cut
from omnieval.metrics.catalogue import METRICS
from omnieval.results.manifest import MANIFEST, kind_of, read_manifest, status_of
from omnieval.results.run_folder import Run, method_of, open_run
from omnieval.source_code import digest_of

"""Where an ablation keeps decision traces."""

GROUP = ("dataset", "source", "mapper", "descriptor")
"""Columns of `schemas.ablation_schema` that name what is compared within itself."""


@dataclass(frozen=True)
class Replay:
    """A replay with its steps: a run folder, or a run of a sweep whose decision trace was kept.

    Attributes
    ----------
    title
        What to call it.
    folder
        Where it stands.
    dataset, source
        What was replayed.
    cut
        Which of its frames.
    config
        With what.
    method
        The words of its evidence.
    status
        How it ended.
    steps
        One row per frame (`schemas.steps_schema`).
    metrics
        Of the final map; empty if there is none.
    facts
        Where it comes from: fingerprint, identity, code, versions.
    run
        The run folder; None for a run of a sweep, of which only the steps were kept.
    skip_bad
        Whether images that are not fit for use were left out.
    """

    title: str
    folder: Path
    dataset: str
    source: str
    cut: Cut
    config: Config
    method: Method
    status: str
    steps: pl.DataFrame
    metrics: Mapping[str, float | int | None]
    facts: Mapping[str, Any]
    run: Run | None = None
    skip_bad: bool = False

    @property
    def descriptor(self) -> str:
        """Name of the descriptor."""
        return self.config.descriptor.name

    @property
    def mapper(self) -> str:
        """Name of the mapper."""
        return self.config.mapper.name

    @property
    def described(self) -> dict[str, Any]:
        """What an image's description depends on besides the image."""
        return {
            "descriptor": digest_of(self.config.descriptor.identity),
            "imaging": self.config.imaging.model_dump(mode="json"),
        }

    @property
    def subject(self) -> str:
        """Dataset, descriptor and a mapper that is not the default, in words."""
        return ", ".join([self.dataset, self.descriptor, *([] if self.config.mapper.is_default else [self.mapper])])

    @contextmanager
    def material(self) -> Iterator[Material]:
        """Give what was replayed; see `material.reopened`.

        Raises
        ------
        ConfigError, DatasetError, ResultError
            If it cannot be opened any more, or has changed since.
        """
        if self.run is not None:
            with reopened(self.run) as material:
                yield material
            return
        with opened(self.source, described_again(self.config), self.cut, skip_bad=self.skip_bad) as material:
            files = self.steps["file"].to_list()
            yield held_against(material, files, self.facts["dataset_fingerprint"], self.title)

    @property
    def posed(self) -> bool:
        """Whether a frame has a position."""
        return self.steps["x"].null_count() < len(self.steps)

    @property
    def nodes(self) -> int:
        """Number of nodes of the final map, 0 if there is none."""
        return int(self.metrics.get("nodes") or 0)

    @property
    def finished(self) -> bool:
        """Whether there is a final map."""
        return bool(self.metrics) and not self.steps.is_empty()


@dataclass(frozen=True)
class Sweep:
    """An ablation.

    Attributes
    ----------
    folder, status
        Where it is and how it ended.
    table
        Its rows so far (`schemas.ablation_schema`).
    axes
        The values of every parameter that varies.
    fixed
        All other parameters.
    replays
        Its best runs, where their steps were kept.
    facts
        Where it comes from.
    """

    folder: Path
    status: str
    table: pl.DataFrame
    axes: Mapping[str, list[Any]]
    fixed: Mapping[str, Any]
    replays: tuple[Replay, ...]
    facts: Mapping[str, Any]

    @property
    def name(self) -> str:
        """Name of its folder, as titles have it."""
        return self.folder.resolve().name

    @property
    def exact(self) -> bool:
        """Whether its rows are pieces of an interval instead of runs."""
        return "exact" in self.table.columns and self.table["exact"].null_count() < len(self.table)


@dataclass(frozen=True)
class Baseline:
    """A baseline folder: one row per partition (`schemas.PARTITIONS`)."""

    folder: Path
    status: str
    source: str
    cut: Cut
    table: pl.DataFrame
    facts: Mapping[str, Any]
    described: Mapping[str, Any]
    """See `Replay.described`."""

    @property
    def name(self) -> str:
        """Name of its folder, as titles have it."""
        return self.folder.resolve().name


@dataclass(frozen=True)
class Sources:
    """Everything a report is about, in the order of its paths."""

    replays: tuple[Replay, ...]
    sweeps: tuple[Sweep, ...]
    baselines: tuple[Baseline, ...]
    localizations: tuple[Localization, ...] = ()

    @property
    def only_localizations(self) -> bool:
        """Whether it is about no map as such, only about what was found in maps."""
        return bool(self.localizations) and not (self.replays or self.sweeps or self.baselines)


def open_sources(paths: Iterable[Path]) -> Sources:
    """Open folders of results, whatever their kind.

    Raises
    ------
    ResultError
        If a path is not a folder of results, cannot be read, holds nothing yet, or is named twice.
    """
    replays: list[Replay] = []
    sweeps: list[Sweep] = []
    baselines: list[Baseline] = []
    localizations: list[Localization] = []
    seen: set[Path] = set()
    for path in paths:
        if path.resolve() in seen:
            raise ResultError(f"{path} is named twice; name it once")
        seen.add(path.resolve())
        kind = kind_of(path)
        if kind == ABLATION:
            sweeps.append(open_sweep(path))
        elif kind == BASELINE:
            baselines.append(open_baseline(path))
        elif kind == LOCALIZATION:
            localizations.append(_whole(open_localization(path)))
        else:
            replays.append(replay_of(open_run(path)))
    return Sources(tuple(replays), tuple(sweeps), tuple(baselines), tuple(localizations))


def replay_of(run: Run) -> Replay:
    """Return a run folder as a replay.

    Raises
    ------
    ResultError
        If it has no steps yet.
    """
    manifest = run.manifest
    steps = run.steps
    if steps.is_empty():
        raise ResultError(f"{run.folder} has no steps yet; let the replay go on")
    return Replay(
        title=run.folder.resolve().name,
        folder=run.folder,
        dataset=manifest["sequence"],
        source=manifest["source"],
        cut=Cut(**manifest["cut"]),
        config=run.config,
        method=run.method,
        status=run.status,
        steps=steps,
        metrics=run.metrics,
        facts=_facts(manifest),
        run=run,
    )


def open_sweep(folder: Path) -> Sweep:
    """Open an ablation; of one that did not finish, its rows so far.

    Raises
    ------
    ResultError
        If it has no rows yet or they cannot be read.
    """
    manifest = read_manifest(folder, ABLATION)
    whole = folder / TABLE
    table = _table(whole) if whole.exists() else rows_table(Store(folder).rows(), manifest["grid"]["types"])
    if table.is_empty():
        raise ResultError(f"{folder} has no runs yet; let the ablation go on (omnieval ablate --resume)")
    return Sweep(
        folder=folder,
        status=status_of(manifest),
        table=table,
        axes=manifest["grid"]["axes"],
        fixed=manifest["grid"]["parameters"],
        replays=tuple(_kept_replays(folder, manifest, table)),
        facts=_facts(manifest),
    )


def open_baseline(folder: Path) -> Baseline:
    """Open a baseline folder.

    Raises
    ------
    ResultError
        If it has no rows yet or they cannot be read.
    """
    manifest = read_manifest(folder, BASELINE)
    if not (folder / PARTITIONS).exists():
        raise ResultError(f"{folder} has no partitions yet; let the baseline go on")
    table = _table(folder / PARTITIONS)
    return Baseline(
        folder,
        status_of(manifest),
        manifest["source"],
        Cut(**manifest["cut"]),
        table,
        _facts(manifest),
        {"descriptor": manifest["descriptor"]["identity"], "imaging": manifest["imaging"]},
    )


def _whole(found: Localization) -> Localization:
    """Refuse a localisation that did not finish, or whose table cannot be read.

    Raises
    ------
    ResultError
        If it is so.
    """
    if status_of(found.manifest) != "complete" or found.table.is_empty():
        raise ResultError(f"{found.folder} is not complete; localise again")
    return found


def best_rows(table: pl.DataFrame) -> pl.DataFrame:
    """Return the run with the highest silhouette of each dataset, mapper and descriptor, the first of equals."""
    scored = table.drop_nulls("silhouette").sort("silhouette", descending=True, maintain_order=True)
    return scored.group_by(GROUP, maintain_order=True).first().sort("job")


def _kept_replays(folder: Path, manifest: Mapping[str, Any], table: pl.DataFrame) -> Iterable[Replay]:
    """Yield the best run of each dataset, mapper and descriptor, where its steps were kept."""
    grid = manifest["grid"]
    cuts = dict(zip(grid["sources"], grid["cuts"], strict=True))
    prints = manifest.get("dataset_fingerprints") or {}
    recorded, store = _recorded(folder), Store(folder)
    for row in best_rows(table).iter_rows(named=True):
        title = f"Best run of {folder.resolve().name}: {row['dataset']}, {row['descriptor']}, {row['mapper']}"
        part = store.part(row["job"])
        if part is None:
            continue
        about, steps = part.config, store.steps(part)
        config = Config.of_run(about)
        if recorded is not None and recorded.source == row["source"] and recorded.config == config:
            yield replace(recorded, title=title)
        elif steps is not None:
            yield Replay(
                title=title,
                folder=folder,
                dataset=row["dataset"],
                source=row["source"],
                cut=Cut(*cuts[row["source"]]),
                config=config,
                method=method_of(about),
                status="complete",
                steps=_table(steps),
                metrics={name: row.get(name) for name in METRICS},
                facts=_facts(manifest)
                | {"dataset_fingerprint": prints.get(row["source"]), "dataset_fingerprints": None},
                skip_bad="skipped" in grid,
            )


def _recorded(folder: Path) -> Replay | None:
    """Return the run in ``best/``, if there is a whole one."""
    best = folder / BEST
    if not (best / MANIFEST).exists():
        return None
    run = open_run(best)
    return replay_of(run) if run.status == "complete" else None


def _facts(manifest: Mapping[str, Any]) -> dict[str, Any]:
    names = ("dataset_fingerprint", "dataset_fingerprints", "identity", "code", "versions", "smallest_margin")
    return {name: manifest.get(name) for name in names}


def _table(path: Path) -> pl.DataFrame:
    try:
        return pl.read_parquet(path)
    except (OSError, pl.exceptions.PolarsError) as error:
        raise ResultError(f"cannot read {path}: {error}; run it again") from error
