"""The recording of a localisation, from its table and the images of map and queries."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

from omnieval.errors import OmnievalError, ResultError
from omnieval.imaging.pictures import Pictures
from omnieval.localization.parts import kept_images
from omnieval.localization.run import KIND, RECORDING, Localization
from omnieval.localization.words import answer_lines
from omnieval.mapping.step import Role
from omnieval.material.reopened import reopened, reopened_as
from omnieval.recording import RecordingOptions
from omnieval.recording.compression import encode_panorama, turn
from omnieval.recording.queries import QueriesInfo, QueryAnswer, QueryView, record_queries
from omnieval.results.atomic import replacing
from omnieval.results.folder import hold_folder
from omnieval.results.run_folder import Run, open_run
from omnieval.text_table import markdown

Progress = Callable[[int, int], None]


def record_localization(
    found: Localization,
    options: RecordingOptions | None = None,
    *,
    out: Path | None = None,
    progress: Progress | None = None,
    note: Callable[[str], None] | None = None,
) -> Path:
    """Write the recording of a localisation and return where it is.

    Parameters
    ----------
    found
        A complete localisation.
    options
        Whether images are recorded, and of how many queries.
    out
        The file to write; None for the recording in the folder of the localisation.
    progress
        Called with (queries done, queries in all).
    note
        Called with a sentence if pictures or places have to be left out.

    Raises
    ------
    DatasetError
        If the images of a query are not where they were, or cannot be read.
    ResultError
        If these are others than those that were looked for, or the recording cannot be written.
    """
    chosen = options or RecordingOptions()
    path = found.folder / RECORDING if out is None else out
    held = hold_folder(found.folder, KIND) if out is None else nullcontext()
    with held, ExitStack() as stack, replacing(path) as temporary:
        try:
            run: Run | None = _run_of(found)
            in_map = _map_pictures(found, run, stack) if chosen.images and run else None
        except OmnievalError as error:
            run = in_map = None
            if note:
                note(f"the recording has nothing of the map but what was found: {error}")
        queries = _query_pictures(found, stack) if chosen.images else {}
        record_queries(temporary, _info(found, run), _views(found, queries, in_map, chosen.every, progress))
    return path


def _run_of(found: Localization) -> Run:
    """Return the run whose map it was.

    Raises
    ------
    ResultError
        If it is not there any more, or has another map now.
    """
    run = open_run(found.manifest["map"]["run"])
    if run.map.digest != found.manifest["map"]["digest"]:
        raise ResultError(f"{run.folder} has another map now; localise again")
    return run


@dataclass(frozen=True)
class _InMap:
    """The pictures of a run, and the number there of each image of the map, shape (n,)."""

    pictures: Pictures
    frames: NDArray[np.int64]


def _map_pictures(found: Localization, run: Run, stack: ExitStack) -> _InMap | None:
    part = found.manifest["map"]
    material = stack.enter_context(reopened(run, describe=False))
    for _ in material.described:  # compared with the run until the last
        pass
    if material.pictures is None:
        return None
    return _InMap(material.pictures, np.flatnonzero(kept_images(run.map, part["limit"], part["without_rooms"])))


def _query_pictures(found: Localization, stack: ExitStack) -> dict[str, Pictures | None]:
    pictures: dict[str, Pictures | None] = {}
    for query in found.manifest["queries"]:
        name = query["sequence"]
        files = found.table.filter(sequence=name, strategy=found.manifest["strategies"][0])["file"].to_list()
        manifest = {**found.manifest, **query, "imaging": {}}  # the camera is known
        material = stack.enter_context(reopened_as(manifest, files, str(found.folder), describe=False))
        for _ in material.described:
            pass
        pictures[name] = material.pictures
    return pictures


def _info(found: Localization, run: Run | None) -> QueriesInfo:
    about = found.manifest
    shown = found.measures.select("sequence", "strategy", "queries", "refused", "error_mean", "recall@1")
    lines = [f"# {about['map']['sequence']}: where am I?", "", markdown(shown.columns, shown.rows())]
    names = ", ".join(query["sequence"] for query in about["queries"])
    return QueriesInfo(
        name=f"{names} in {about['map']['sequence']} - {about['descriptor']['name']}",
        page="\n".join(lines),
        strategies=tuple(about["strategies"]),
        queries=len(found.table) // len(about["strategies"]),
        xy=np.zeros((0, 2)) if run is None else run.map.xy,
        labels=np.zeros(0, np.int64) if run is None else run.map.labels,
    )


def _views(
    found: Localization,
    queries: dict[str, Pictures | None],
    in_map: _InMap | None,
    every: int,
    progress: Progress | None,
) -> Iterator[QueryView]:
    table = found.table.with_columns(pl.col("time").cast(pl.Int64))
    by_query = table.group_by("sequence", "query", maintain_order=True)
    total = len(table) // len(found.manifest["strategies"])
    for number, (_, rows) in enumerate(by_query):
        answers = rows.rows(named=True)
        first = answers[0]
        pictured = number % every == 0
        pictures = queries.get(first["sequence"]) if pictured else None
        yield QueryView(
            title=f"{first['sequence']} {first['query']}",
            time_ns=first["time"],
            place=_place(first["x"], first["y"]),
            reachable=first["reachable"],
            panorama=encode_panorama(pictures.panorama(first["query"])) if pictures else None,
            answers={row["strategy"]: _answer(row, found, in_map if pictured else None) for row in answers},
            words="\n\n".join(_line(*line) for line in answer_lines(found, answers)),
        )
        if progress:
            progress(number + 1, total)


def _answer(row: dict[str, Any], found: Localization, in_map: _InMap | None) -> QueryAnswer:
    panorama = None
    if in_map is not None and row["best_frame"] is not None:
        seen = in_map.pictures.panorama(int(in_map.frames[row["best_frame"]]))
        panorama = encode_panorama(turn(seen, row["shift"], found.manifest["orientation_cells"]))
    refused = row["role"] == Role.REFUSED.value
    return QueryAnswer(
        place=None if refused else _place(row["best_x"], row["best_y"]),
        error=row["error"],
        refused=row["verdict"] if refused else None,
        panorama=panorama,
    )


def _line(label: str, text: str) -> str:
    return f"**{label.strip()}** {text}" if label.strip() else text


def _place(x: float | None, y: float | None) -> tuple[float, float] | None:
    return None if x is None or y is None else (x, y)
