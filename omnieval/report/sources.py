"""What stands at the paths of a report: replays, sweeps and baselines, each as one record to draw from."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import polars as pl

from omnieval.ablation.store import BEST, TABLE, Store, rows_table
from omnieval.ablation.store import KIND as ABLATION
from omnieval.benchmark import KIND as BASELINE
from omnieval.benchmark import TABLE as PARTITIONS
from omnieval.config import Config, Setting, parameters, resolve
from omnieval.errors import ResultError
from omnieval.material import ARCHIVE_SCHEME
from omnieval.metrics.evaluation import METRICS
from omnieval.results.manifest import MANIFEST, read_manifest, status_of
from omnieval.results.run_folder import Run, open_run

STEPS = "steps"
"""Where an ablation keeps decision traces."""

GROUP = ("dataset", "source", "descriptor")
"""Columns of `schemas.ABLATION` that name what is compared within itself."""


@dataclass(frozen=True)
class Replay:
    """A replay with its steps: a run folder, or a run of a sweep whose decision trace was kept.

    Attributes
    ----------
    title
        What to call it.
    folder
        Where it stands.
    dataset, source, descriptor
        What was replayed.
    cut
        Start, stride and limit of the sequence.
    config
        The parameters.
    status
        How it ended.
    steps
        One row a frame (`schemas.STEPS`).
    metrics
        Of the final map; empty if there is none.
    facts
        Where it comes from: fingerprint, identity, code, versions.
    """

    title: str
    folder: Path
    dataset: str
    source: str
    descriptor: str
    cut: Mapping[str, Any]
    config: Config
    status: str
    steps: pl.DataFrame
    metrics: Mapping[str, float | int | None]
    facts: Mapping[str, Any]

    @property
    def posed(self) -> bool:
        """Whether every frame has a position."""
        return not self.steps.is_empty() and self.steps.select("x", "y").null_count().row(0) == (0, 0)

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
        Its rows so far (`schemas.ABLATION`).
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
        """What to call it."""
        return self.folder.resolve().name

    @property
    def exact(self) -> bool:
        """Whether its rows are pieces of an interval instead of runs."""
        return "exact" in self.table.columns and self.table["exact"].null_count() < len(self.table)


@dataclass(frozen=True)
class Baseline:
    """A baseline folder: one row a partition (`schemas.PARTITIONS`)."""

    folder: Path
    status: str
    source: str
    cut: Mapping[str, Any]
    table: pl.DataFrame
    facts: Mapping[str, Any]

    @property
    def name(self) -> str:
        """What to call it."""
        return self.folder.resolve().name


@dataclass(frozen=True)
class Sources:
    """Everything a report is about, in the order of its paths."""

    replays: tuple[Replay, ...]
    sweeps: tuple[Sweep, ...]
    baselines: tuple[Baseline, ...]


def open_sources(paths: Iterable[Path]) -> Sources:
    """Open folders of results, whatever their kind.

    Raises
    ------
    ResultError
        If a path is no folder of results, cannot be read, holds nothing yet, or is named twice.
    """
    replays: list[Replay] = []
    sweeps: list[Sweep] = []
    baselines: list[Baseline] = []
    seen: set[Path] = set()
    for path in paths:
        if path.resolve() in seen:
            raise ResultError(f"{path} is named twice; name it once")
        seen.add(path.resolve())
        kind = _kind(path)
        if kind == ABLATION:
            sweeps.append(open_sweep(path))
        elif kind == BASELINE:
            baselines.append(open_baseline(path))
        else:
            replays.append(replay_of(open_run(path)))
    return Sources(tuple(replays), tuple(sweeps), tuple(baselines))


def replay_of(run: Run) -> Replay:
    """Return a run folder as a replay.

    Raises
    ------
    ResultError
        If it has no steps yet, or its parameters are not those of this version.
    """
    manifest = run.manifest
    source: str = manifest["source"]
    steps = run.steps
    if steps.is_empty():
        raise ResultError(f"{run.folder} has no steps yet; let the replay go on")
    config = _config(run.folder, manifest["configuration"])
    return Replay(
        title=run.folder.resolve().name,
        folder=run.folder,
        dataset=manifest["sequence"],
        source=source,
        descriptor="archive" if source.startswith(ARCHIVE_SCHEME) else config.descriptor,
        cut=manifest["cut"],
        config=config,
        status=run.status,
        steps=steps,
        metrics=run.metrics,
        facts=_facts(manifest),
    )


def open_sweep(folder: Path) -> Sweep:
    """Open an ablation; of one that did not end, the rows it came to.

    Raises
    ------
    ResultError
        If it has no rows yet or they cannot be read.
    """
    manifest = read_manifest(folder, ABLATION)
    whole = folder / TABLE
    table = _table(whole) if whole.exists() else rows_table(Store(folder).rows())
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
    return Baseline(folder, status_of(manifest), manifest["source"], manifest["cut"], table, _facts(manifest))


def best_rows(table: pl.DataFrame) -> pl.DataFrame:
    """Return the run with the highest silhouette of each dataset and descriptor, the first of equals."""
    scored = table.drop_nulls("silhouette").sort("silhouette", descending=True, maintain_order=True)
    return scored.group_by(GROUP, maintain_order=True).first().sort("job")


def _kept_replays(folder: Path, manifest: Mapping[str, Any], table: pl.DataFrame) -> Iterable[Replay]:
    """Yield the best run of each dataset and descriptor, where its steps were kept."""
    grid = manifest["grid"]
    cuts = dict(zip(grid["sources"], grid["cuts"], strict=True))
    prints = manifest.get("dataset_fingerprints") or {}
    recorded = _recorded(folder)
    for row in best_rows(table).iter_rows(named=True):
        title = f"Best run of {folder.resolve().name}: {row['dataset']}, {row['descriptor']}"
        steps = folder / STEPS / f"{row['job']:05d}.parquet"
        settings = {name: row[name] for name in parameters()}
        if recorded is not None and recorded.source == row["source"] and _same(recorded.config, settings):
            yield replace(recorded, title=title)
        elif steps.exists():
            yield Replay(
                title=title,
                folder=folder,
                dataset=row["dataset"],
                source=row["source"],
                descriptor=row["descriptor"],
                cut=dict(zip(("start", "stride", "limit"), cuts[row["source"]], strict=True)),
                config=resolve([Setting(name, value, str(folder)) for name, value in settings.items()]),
                status="complete",
                steps=_table(steps),
                metrics={name: row[name] for name in METRICS},
                facts=_facts(manifest)
                | {"dataset_fingerprint": prints.get(row["source"]), "dataset_fingerprints": None},
            )


def _recorded(folder: Path) -> Replay | None:
    """Return the run in ``best/``, if there is a whole one."""
    best = folder / BEST
    if not (best / MANIFEST).exists():
        return None
    run = open_run(best)
    return replay_of(run) if run.status == "complete" else None


def _same(config: Config, settings: Mapping[str, Any]) -> bool:
    return config == resolve([Setting(name, value, "a row of the sweep") for name, value in settings.items()])


def _kind(folder: Path) -> str:
    """Return what a folder says it holds; a replay is asked for what is missing."""
    try:
        content = json.loads((folder / MANIFEST).read_text("utf-8"))
    except (OSError, ValueError):
        return ""
    return str(content.get("kind")) if isinstance(content, dict) else ""


def _config(folder: Path, content: Mapping[str, Any]) -> Config:
    try:
        return Config.model_validate(content)
    except ValueError as error:
        raise ResultError(f"{folder} has parameters this omnieval does not know; replay the sequence again") from error


def _facts(manifest: Mapping[str, Any]) -> dict[str, Any]:
    names = ("dataset_fingerprint", "dataset_fingerprints", "identity", "code", "versions", "smallest_margin")
    return {name: manifest.get(name) for name in names}


def _table(path: Path) -> pl.DataFrame:
    try:
        return pl.read_parquet(path)
    except (OSError, pl.exceptions.PolarsError) as error:
        raise ResultError(f"cannot read {path}: {error}; run it again") from error
