"""One answer in words: what the image was compared with, the result, and how far it is from the truth."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import polars as pl

from omnieval.datasets.sequence import Frame, Pose
from omnieval.errors import ResultError
from omnieval.explain.page import Line, lines
from omnieval.explain.scene import Scene
from omnieval.explain.words import decision_text
from omnieval.localization.run import Localization
from omnieval.localization.table import step_of
from omnieval.mapping.step import Role, Step
from omnieval.results.run_folder import method_of
from omnieval.results.tables import frame_from_row
from omnieval.wording import counted, shown


def find_query(localization: Localization, query: str, sequence: str | None = None) -> list[dict[str, Any]]:
    """Return the rows of a query, one a strategy, named by its number or image file.

    Raises
    ------
    ResultError
        If there is no such query, or several sequences have it.
    """
    table = localization.table.with_columns(pl.col("time").cast(pl.Int64))
    sequences: list[str] = table["sequence"].unique(maintain_order=True).to_list()
    if sequence is None and len(sequences) > 1:
        raise ResultError(f"{localization.folder} has {len(sequences)} sequences; choose one with --sequence")
    chosen = sequence or sequences[0]
    if chosen not in sequences:
        raise ResultError(f"{localization.folder} has no sequence {shown(chosen)}; it has {', '.join(sequences)}")
    own = table.filter(sequence=chosen)
    is_number = query.isascii() and query.isdigit()
    rows = own.filter(pl.col("query") == int(query) if is_number else pl.col("file").str.ends_with(query))
    if rows.is_empty() or rows["query"].n_unique() > 1:
        last = own["query"].to_list()[-1]
        raise ResultError(f"{localization.folder} has no query {shown(query)}; name one, 0 to {last}, or an image file")
    return rows.rows(named=True)


def answer_lines(localization: Localization, rows: Sequence[dict[str, Any]]) -> list[Line]:
    """Return the answers of every strategy to one query as lines of a page."""
    page: list[Line] = []
    for row in rows:
        step, image = step_of(row), frame_from_row(row)
        method = method_of(localization.manifest)
        scene = Scene(step, image, _best(row), None, localization.manifest["orientation_cells"])
        page += [("image", lines(scene, method)[1][1])] if not page else []
        refused = step.role is Role.REFUSED
        page.append((row["strategy"], decision_text(step, method) if refused else _answer_text(step, row)))
        page += [line for line in lines(scene, method)[2:] if line[0] != "measured"]
        page += _truth_lines(row)
    return page


def _answer_text(step: Step, row: dict[str, Any]) -> str:
    how = f"compared with {counted(row['compared'], 'image')} of {counted(len(row['candidates']), 'node')}"
    where = f"in node {step.node}" if step.node is not None else "at an image that no node has"
    return f"found {where}, {how}"


def _truth_lines(row: dict[str, Any]) -> list[Line]:
    if row["reachable"] is None:
        return [("error", "unknown: the query or the map has no position")]
    nearest = f"the nearest image of the map, {row['reachable_frame']}, is {row['reachable']:.2f} m away"
    if row["error"] is None:
        why = "it was refused" if row["role"] == Role.REFUSED.value else "that image has no position"
        return [("error", f"none, {why}; {nearest}")]
    heading = "" if row["heading_error"] is None else f", heading off by {row['heading_error']:.1f} deg"
    return [("error", f"{row['error']:.2f} m{heading}; {nearest}")]


def _best(row: dict[str, Any]) -> Frame | None:
    if row["best_frame"] is None:
        return None
    x, y = row["best_x"], row["best_y"]
    pose = None if x is None or y is None else Pose(x, y, math.nan)
    return Frame(Path(), row["best_file"] or "", None, pose, row["best_room"])
