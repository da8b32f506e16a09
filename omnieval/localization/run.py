"""``omnieval localize``: every image of other sequences is looked for in the map of a run.

The folder ``runs/<query>-in-<map>[-<n>]/`` holds ``localization.parquet`` (`table.QUERIES`) and ``run.json``, whose
metrics are by sequence and strategy.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from html import escape
from pathlib import Path
from typing import Any

import polars as pl

from omnieval.components.component import Component
from omnieval.config import Config, with_camera
from omnieval.errors import ConfigError, ResultError
from omnieval.imaging.settings import ImagingConfig
from omnieval.localization.answers import Query, answers
from omnieval.localization.measures import Measures, measure
from omnieval.localization.parts import kept_images, map_of_part
from omnieval.localization.strategies import COARSE, LEVELS, STRATEGIES, check_strategies, has_levels
from omnieval.localization.table import queries_frame
from omnieval.loop import RUNS
from omnieval.mapping.map import TopologicalMap
from omnieval.material.continued import other_images, other_kind
from omnieval.material.opening import opened
from omnieval.material.source import ARCHIVE, Cut, Source, named
from omnieval.results.atomic import write_table
from omnieval.results.content import content_hash
from omnieval.results.folder import ResultFolder
from omnieval.results.manifest import expanded, read_manifest
from omnieval.results.provenance import code_digest, dataset_fingerprint, versions
from omnieval.results.run_folder import Run, free_folder, open_run

KIND = "localization"
TABLE = "localization.parquet"
RECORDING = "localization.rrd"
"""See `localization.recorded`."""
Progress = Callable[[int, int], None]
_LOG = logging.getLogger("omnieval")


@dataclass(frozen=True)
class Localization:
    """A localisation folder to read.

    Attributes
    ----------
    folder
        Where it is.
    manifest
        The content of ``run.json``.
    """

    folder: Path
    manifest: dict[str, Any]

    def __repr__(self) -> str:
        sequences = ", ".join(source["sequence"] for source in self.manifest.get("queries", ()))
        return f"Localization({self.folder}: {sequences} in {self.manifest['map']['sequence']})"

    def _repr_html_(self) -> str:
        """Return what a notebook shows: what was looked for where, and how well it was found."""
        return f"<p><strong>{escape(repr(self))}</strong></p>{self.measures._repr_html_()}"

    @cached_property
    def table(self) -> pl.DataFrame:
        """A row per query and strategy (`table.QUERIES`).

        Raises
        ------
        ResultError
            If it cannot be read.
        """
        try:
            return pl.read_parquet(self.folder / TABLE)
        except (OSError, pl.exceptions.PolarsError) as error:
            raise ResultError(f"cannot read {self.folder / TABLE}: {error}; localise again") from error

    @property
    def measures(self) -> pl.DataFrame:
        """A row per sequence and strategy: the metrics (`measures.METRICS`)."""
        return pl.DataFrame(
            [
                {"sequence": sequence, "strategy": strategy, **values}
                for sequence, by_strategy in self.manifest["metrics"].items()
                for strategy, values in by_strategy.items()
            ],
            infer_schema_length=None,
        )


def localize(
    run: Run | TopologicalMap | str | Path,
    *sources: Source,
    camera: str | Path | None = None,
    strategies: Sequence[str] | None = None,
    within: float = 0.5,
    map_limit: int | None = None,
    without_rooms: Sequence[str] = (),
    start: int = 0,
    stride: int = 1,
    limit: int | None = None,
    skip_bad: bool = False,
    out: str | Path | None = None,
    overwrite: bool = False,
    progress: Progress | None = None,
) -> Localization:
    """Find every image of some sequences in a map.

    Parameters
    ----------
    run
        A run, its folder, or a map.
    *sources
        Sources as on the command line, or sequences; at least one.
    camera
        What the camera of the sources is: a file like ``camera.toml``; default what the map's run was told, else what
        each source knows of its own.
    strategies
        Of `STRATEGIES`; default all that the mapper has.
    within
        Two images at most this far apart show the same place.
    map_limit, without_rooms
        Make the map of at most this many of its first images, and of none in these rooms: the mapper maps the rest
        again.
    start, stride, limit
        Which frames of each source.
    skip_bad
        Leave out images that are not fit for use instead of refusing the sequence.
    out
        Folder to write; default ``runs/<query>-in-<map>[-<n>]``.
    overwrite
        Replace an earlier localisation in `out`.
    progress
        Called with (answers so far, answers in all).

    Raises
    ------
    ConfigError
        If a strategy is unknown or the mapper does not have it, no image of the map stays, or coarse to fine is asked
        for in a map without nodes, where it has nothing to begin with.
    DatasetError
        If a source cannot be read.
    ResultError
        If there is no map, the descriptor or mapper cannot be made again as it was, or the camera is another.
    """
    if not sources:
        raise ConfigError("name at least one sequence to find in the map")
    if not (math.isfinite(within) and within > 0):
        raise ConfigError(f"within is {within:g}, but must be a positive number of metres")
    map_, where = _map_of(run)
    mapper = Component.of_run("mapper", map_.about["mapper"])
    chosen = _strategies(strategies, mapper)
    if LEVELS in chosen or map_limit is not None or without_rooms:
        mapper = mapper.again()
    config = _config(map_, mapper, camera)
    whole = map_.digest
    if map_limit is not None or without_rooms:
        map_ = map_of_part(map_, kept_images(map_, map_limit, without_rooms), mapper)
    if not len(map_.nodes):
        if COARSE in (strategies or ()):
            raise ConfigError(f"the map of {map_.about['sequence']} has no node to begin with; leave coarse out")
        chosen = tuple(name for name in chosen if name != COARSE)
    queries = _described(sources, config, Cut(start, stride, limit), map_, skip_bad=skip_bad)
    folder = Path(out) if out is not None else free_folder(RUNS, f"{queries[0].name}-in-{where.name}")
    part = {"limit": map_limit, "without_rooms": list(without_rooms), "images": len(map_)}
    about = {
        "map": {"run": str(where), "sequence": map_.about["sequence"], "digest": whole, **part},
        "queries": [query.about for query in queries],
        "mapper": map_.about["mapper"],
        "descriptor": config.descriptor.about,
        "orientation_cells": map_.cells,
        "strategies": list(chosen),
        "within": within,
        "versions": versions(),
        "code": code_digest(),
    }
    total = len(chosen) * sum(len(query.frames) for query in queries)
    rows: list[dict[str, Any]] = []
    with ResultFolder(folder, KIND, about, files=[TABLE, RECORDING], overwrite=overwrite) as held:
        for strategy in chosen:
            finder = STRATEGIES[strategy](map_, mapper)
            for query in queries:
                for row in answers(finder, query, within):
                    rows.append(row)
                    if progress:
                        progress(len(rows), total)
        table = queries_frame(rows)
        write_table(table, held.path / TABLE)
        measured = measures_of(table, within, len(map_))
        held.complete(
            {
                "metrics": {name: {one: m.values for one, m in by.items()} for name, by in measured.items()},
                "intervals": {name: {one: _intervals(m) for one, m in by.items()} for name, by in measured.items()},
                "content_hashes": {"localization": content_hash(table)},
            }
        )
        return Localization(held.path, held.content)


def open_localization(folder: str | Path) -> Localization:
    """Open a localisation folder.

    Raises
    ------
    ResultError
        If it is none.
    """
    path = expanded(folder)
    return Localization(path, read_manifest(path, KIND))


def measures_of(table: pl.DataFrame, within: float, images: int) -> dict[str, dict[str, Measures]]:
    """Return the metrics by sequence and strategy, in the order of the table."""
    return {
        sequence: {
            strategy: measure(table.filter(sequence=sequence, strategy=strategy), within, images)
            for strategy in table.filter(sequence=sequence)["strategy"].unique(maintain_order=True)
        }
        for sequence in table["sequence"].unique(maintain_order=True)
    }


def _described(
    sources: Sequence[Source], config: Config, cut: Cut, map_: TopologicalMap, *, skip_bad: bool
) -> list[Query]:
    """Return sequences, described as the images of the map were; one that has the name of another is numbered.

    Raises
    ------
    ResultError
        If they cannot be: the camera makes other panoramas, or an archive has other descriptors.
    """
    queries: list[Query] = []
    for source in sources:
        refused = f"{named(source)} cannot be found in the map of {map_.about['sequence']}"
        if fault := other_kind(source, config.descriptor):
            raise ResultError(f"{refused}: {fault}")
        with opened(source, config, cut, skip_bad=skip_bad) as material:
            described = list(material.described)
            if fault := other_images(material, described[0], map_):
                raise ResultError(f"{refused}: {fault}")
            name = _free_name(material.name, [query.name for query in queries])
            fingerprint = dataset_fingerprint(material.frames, [one.digest for one in described])
            about = {**material.about, "sequence": name, "dataset_fingerprint": fingerprint}
            queries.append(Query(name, material.frames, tuple(one.description for one in described), about))
    return queries


def _map_of(run: Run | TopologicalMap | str | Path) -> tuple[TopologicalMap, Path]:
    """Return a map, and the folder it is named after."""
    if isinstance(run, TopologicalMap):
        return run, Path(str(run.about["sequence"]))
    opened_run = run if isinstance(run, Run) else open_run(run)
    return opened_run.map, opened_run.folder


def _strategies(names: Sequence[str] | None, mapper: Component) -> tuple[str, ...]:
    """Return the strategies asked for; by default all that the mapper has."""
    if names is None:
        try:
            return tuple(name for name in STRATEGIES if name != LEVELS or has_levels(mapper))
        except ConfigError as error:  # the images of the map can be compared without it
            _LOG.warning("the mapper's own levels are left out: %s", error)
            return tuple(name for name in STRATEGIES if name != LEVELS)
    check_strategies(names)
    if LEVELS in names and not has_levels(mapper):
        raise ConfigError(
            f"the mapper {mapper.name} has no levels by which it finds an image; choose --strategy nearest,coarse"
        )
    return tuple(names)


def _config(map_: TopologicalMap, mapper: Component, camera: str | Path | None) -> Config:
    """Return how images are described as those of the map were, with the camera of a file if there is one.

    Raises
    ------
    ConfigError
        If the file describes no camera.
    ResultError
        If the descriptor cannot be made again as it was.
    """
    descriptor = Component.of_run("descriptor", map_.about["descriptor"])
    if descriptor != ARCHIVE:
        descriptor = descriptor.again()
    imaging = ImagingConfig.model_validate(map_.about["imaging"])
    return Config(mapper, descriptor, imaging if camera is None else with_camera(imaging, Path(camera)))


def _free_name(name: str, taken: Sequence[str]) -> str:
    """Return the name of a sequence, numbered if another query has it."""
    names = [name, *(f"{name}-{number}" for number in range(2, len(taken) + 2))]
    return next(one for one in names if one not in taken)


def _intervals(measured: Measures) -> dict[str, list[float]]:
    """Return the interval of every proportion, and of how many it is."""
    return {name: [*one.interval, one.count] for name, one in measured.proportions.items()}
