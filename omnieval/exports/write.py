"""Results as files for other programs: which format takes what, and where it is written."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

import polars as pl

from omnieval.ablation.store import KIND as ABLATION
from omnieval.ablation.store import TABLE as ROWS
from omnieval.benchmark import KIND as BASELINE
from omnieval.benchmark import TABLE as PARTITIONS
from omnieval.errors import ConfigError, ResultError
from omnieval.exports.document import document
from omnieval.exports.flat import flat_csv
from omnieval.exports.geojson import geojson
from omnieval.exports.graph import MapGraph, map_graph
from omnieval.exports.graphml import graphml
from omnieval.exports.node_pictures import node_pictures, pictures_of
from omnieval.exports.trajectory import trajectory
from omnieval.imaging.encode import jpeg
from omnieval.localization.run import KIND as LOCALIZATION
from omnieval.localization.run import TABLE as QUERIES
from omnieval.results.atomic import replacing
from omnieval.results.manifest import expanded, kind_of, with_article
from omnieval.results.run_folder import TABLES, Run, open_run


class ExportFormat(StrEnum):
    """In which format a run is written."""

    GRAPHML = "graphml"
    GEOJSON = "geojson"
    JSON = "json"
    TUM = "tum"
    CSV = "csv"


_ONE_TABLE = {ABLATION: ROWS, BASELINE: PARTITIONS, LOCALIZATION: QUERIES}
"""Kinds of folders that hold a table and no map."""

_FEW_WORDS = {ExportFormat.GEOJSON: "the map has no edge, and Nav2's Route Server refuses a graph without one"}


@dataclass(frozen=True)
class Exported:
    """What was written: the files, and sentences that must be read with them."""

    files: tuple[Path, ...]
    notes: tuple[str, ...] = ()


def export(
    run: Run | str | Path,
    format: str | None = None,
    *,
    out: str | Path | None = None,
    images: str | Path | None = None,
    overwrite: bool = False,
) -> Exported:
    """Write a run as files for other programs; docs/export.md describes them.

    Parameters
    ----------
    run
        A run folder. Of an ablation, a baseline or a localisation, the table as CSV.
    format
        ``graphml``, ``geojson``, ``json``, ``tum`` or ``csv``; None writes only `images`.
    out
        File to write (``csv`` of a run: folder); in a folder that exists, or that ends with ``/``, a file that is named
        after the run. Default: named after the run, in the current folder.
    images
        Folder for the representative image of every node: ``node-003.jpg``, the panorama, and if that was unwrapped
        from an omnidirectional image, ``node-003-taken.jpg``, the image itself.
    overwrite
        Replace files that exist.

    Raises
    ------
    ConfigError
        If nothing is asked for, or no such format.
    DatasetError
        If images are asked for and cannot be read any more.
    ResultError
        If the run does not have what the format needs, or a file cannot be written.
    """
    wanted = None if format is None else _format(format)
    if wanted is None and images is None:
        raise ConfigError(f"nothing to export; choose --format {'|'.join(ExportFormat)}, or --images DIR")
    folder = run.folder if isinstance(run, Run) else expanded(run)
    if not isinstance(run, Run) and (kind := kind_of(folder)) in _ONE_TABLE:
        return _export_table(folder, str(kind), wanted, out, with_images=images is not None, overwrite=overwrite)
    opened = run if isinstance(run, Run) else open_run(run)
    files: dict[Path, str] = {}
    notes: tuple[str, ...] = ()
    if wanted is not None:
        files, notes = _texts(opened, wanted, out)
        _claim(files, overwrite=overwrite)
    pictures = [] if images is None else _write_images(opened, expanded(images), overwrite=overwrite)
    _write_texts(files)
    return Exported((*files, *pictures), notes)


def _format(name: str) -> ExportFormat:
    try:
        return ExportFormat(name)
    except ValueError as error:
        raise ConfigError(f"there is no export format {name}; choose {', '.join(ExportFormat)}") from error


def _texts(run: Run, wanted: ExportFormat, out: str | Path | None) -> tuple[dict[Path, str], tuple[str, ...]]:
    """Return the text of every file, and what must be said of them."""
    name = run.folder.resolve().name
    if wanted is ExportFormat.CSV:
        folder = Path(f"{name}-csv") if out is None else expanded(out)
        return {folder / f"{table}.csv": flat_csv(found) for table, found in _tables(run).items()}, ()
    path = _target(out, f"{name}.{wanted}")
    if wanted is ExportFormat.TUM:
        text, notes = trajectory(run.steps, name)
        return {path: text}, notes
    graph = map_graph(run)
    said = (_FEW_WORDS[wanted],) if wanted in _FEW_WORDS and not graph.edges else ()
    return {path: _graph_text(graph, wanted)}, said


def _graph_text(graph: MapGraph, wanted: ExportFormat) -> str:
    if wanted is ExportFormat.GRAPHML:
        return graphml(graph)
    content = geojson(graph) if wanted is ExportFormat.GEOJSON else document(graph)
    return json.dumps(content, indent=2, allow_nan=False, ensure_ascii=False) + "\n"


def _tables(run: Run) -> dict[str, pl.DataFrame]:
    """Return the tables of a run; of one that did not finish, its steps so far."""
    found = {"steps": run.steps}
    if run.status == "complete":
        found |= {name: getattr(run, name) for name in TABLES if name != "steps"}
    return found


def _export_table(
    folder: Path, kind: str, wanted: ExportFormat | None, out: str | Path | None, *, with_images: bool, overwrite: bool
) -> Exported:
    table = folder / _ONE_TABLE[kind]
    if wanted is not ExportFormat.CSV or with_images:
        best = " or name the run in it, best/" if (folder / "best").is_dir() else ""
        raise ResultError(f"{folder} is {with_article(kind)}, which has no map; export it with --format csv{best}")
    if not table.exists():
        raise ResultError(f"{folder} has no {table.name} yet; let it finish")
    try:
        rows = pl.read_parquet(table)
    except (OSError, pl.exceptions.PolarsError) as error:
        raise ResultError(f"cannot read {table}: {error}; run it again") from error
    files = {_target(out, f"{folder.resolve().name}.csv"): flat_csv(rows)}
    _claim(files, overwrite=overwrite)
    _write_texts(files)
    return Exported(tuple(files))


def _target(out: str | Path | None, name: str) -> Path:
    if out is None:
        return Path(name)
    path = expanded(out)
    return path / name if str(out).endswith("/") or path.is_dir() else path


def _claim(files: Mapping[Path, object], *, overwrite: bool) -> None:
    """Refuse files that cannot or must not be written, before any work is done; make their folders."""
    for path in files:
        try:
            occupied = path.is_dir() or (path.exists() and not overwrite)
            path.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise ResultError(f"cannot write {path}: {error.strerror or error}; choose another --out") from error
        if occupied:
            instead = "" if path.is_dir() else " or pass --overwrite"
            raise ResultError(f"{path} exists; choose another --out{instead}")


def _write_texts(files: Mapping[Path, str]) -> None:
    for path, text in files.items():
        with replacing(path) as temporary:
            temporary.write_bytes(text.encode())


def _write_images(run: Run, folder: Path, *, overwrite: bool) -> list[Path]:
    nodes = map_graph(run).nodes
    names = [folder / f"node-{node.id:03d}{part}.jpg" for node in nodes for part in ("", "-taken")]
    _claim(dict.fromkeys(names), overwrite=overwrite)
    written = []
    with pictures_of(run) as pictures:
        for one in node_pictures(pictures, [(node.id, node.representative_frame) for node in nodes]):
            for part, picture in {"": one.panorama, "-taken": one.taken}.items():
                if picture is not None:
                    written.append(folder / f"node-{one.node:03d}{part}.jpg")
                    with replacing(written[-1]) as temporary:
                        temporary.write_bytes(jpeg(picture))
    return written
