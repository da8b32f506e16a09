"""``localization.parquet``: a row for every query and strategy, and what it says in numbers."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable
from typing import Any

import polars as pl

from omnieval.datasets.sequence import Frame
from omnieval.localization.strategies import Found
from omnieval.localization.truth import Truth
from omnieval.mapping.map import TopologicalMap
from omnieval.mapping.step import Match, Role, Step
from omnieval.results.schemas import COMPARISON, ROLE, table_schema
from omnieval.results.tables import comparison_row, comparisons_from_row

QUERIES = table_schema(
    {
        "query": pl.Int32,
        "sequence": pl.String,
        "strategy": pl.String,
        "file": pl.String,
        "time": pl.Datetime("ns"),
        "x": pl.Float64,
        "y": pl.Float64,
        "yaw": pl.Float64,
        "room": pl.String,
        "verdict": pl.String,
        "role": ROLE,
        "candidates": pl.List(pl.Int32),
        "node": pl.Int32,
        "best_frame": pl.Int32,
        "best_file": pl.String,
        "best_node": pl.Int32,
        "best_x": pl.Float64,
        "best_y": pl.Float64,
        "best_room": pl.String,
        "shift": pl.Int32,
        "error": pl.Float64,
        "heading_error": pl.Float64,
        "reachable_frame": pl.Int32,
        "reachable": pl.Float64,
        "nearest_rank": pl.Int32,
        "rank": pl.Int32,
        "node_right": pl.Boolean,
        "doubt": pl.Float64,
        "compared": pl.Int32,
        "comparisons": pl.List(COMPARISON),
        "milliseconds": pl.Float64,
    }
)
"""A row per query and strategy. `role` says whether it was refused; `best_*` is the most similar image all the same."""


def query_row(
    query: int,
    sequence: str,
    strategy: str,
    frame: Frame,
    found: Found,
    truth: Truth,
    map_: TopologicalMap,
    milliseconds: float,
) -> dict[str, Any]:
    """Return a row of `QUERIES`."""
    pose, step = frame.pose, found.step
    match = step.match
    row: dict[str, Any] = {
        "query": query,
        "sequence": sequence,
        "strategy": strategy,
        "file": frame.file,
        "time": frame.time_ns,
        "x": _known(pose.x) if pose else None,
        "y": _known(pose.y) if pose else None,
        "yaw": _known(pose.yaw) if pose else None,
        "room": frame.room,
        "verdict": step.verdict,
        "role": step.role.value,
        "candidates": list(found.candidates),
        "node": step.node,
        "doubt": found.doubt,
        "compared": len(found.ranked),
        "comparisons": [comparison_row(one) for one in step.comparisons],
        "milliseconds": milliseconds,
        **dataclasses.asdict(truth),
    }
    if match is not None:
        x, y = map_.xy[match.frame].tolist()
        row |= {
            "best_frame": match.frame,
            "best_file": str(map_.files[match.frame]),
            "best_node": match.node,
            "best_x": _known(x),
            "best_y": _known(y),
            "best_room": str(map_.rooms[match.frame]) or None,
            "shift": match.shift,
        }
    return row


def queries_frame(rows: Iterable[dict[str, Any]]) -> pl.DataFrame:
    """Return rows of `query_row` as a table."""
    blank = dict.fromkeys(QUERIES)
    return pl.DataFrame([blank | row for row in rows], schema=QUERIES)


def step_of(row: dict[str, Any]) -> Step:
    """Return the answer in a row as a step, whose number is that of the query."""
    match = None
    if row["best_frame"] is not None:
        match = Match(row["best_frame"], row["best_node"], row["shift"])
    return Step(
        frame=row["query"],
        verdict=row["verdict"],
        role=Role(row["role"]),
        node=row["node"],
        match=match,
        comparisons=comparisons_from_row(row),
    )


def _known(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None
