"""Steps and maps as rows of the tables in `schemas`, and back."""

from __future__ import annotations

import dataclasses
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

from omnieval.datasets.sequence import Frame, Pose
from omnieval.mapping.interface import Column
from omnieval.mapping.partition import Partition, count_transitions
from omnieval.mapping.representative import representative_frames
from omnieval.mapping.step import (
    Comparison,
    EventKind,
    FinalMap,
    Match,
    NodeEvent,
    Placement,
    Role,
    Step,
)
from omnieval.metrics.quality import Measure
from omnieval.results.schemas import NODES, PLACEMENT, QUALITY, TRANSITIONS, steps_schema

_NO_PATH = Path()
"""Of a frame that is read back from a table: its image is not known."""


def step_row(step: Step, frame: Frame, partition: Partition, milliseconds: float) -> dict[str, Any]:
    """Return the row of one step, which `partition` has taken in; what only the end of the sequence tells is null."""
    pose, match, margin = frame.pose, step.match, step.margin
    active = len(partition.active)
    return {
        "frame": step.frame,
        "file": frame.file,
        "time": frame.time_ns,
        "x": pose.x if pose else None,
        "y": pose.y if pose else None,
        "yaw": pose.yaw if pose and np.isfinite(pose.yaw) else None,
        "room": frame.room,
        "verdict": step.verdict,
        "role": step.role.value,
        "node": step.node,
        "best_frame": match.frame if match else None,
        "best_node": match.node if match else None,
        "shift": match.shift if match else None,
        "comparisons": [comparison_row(one) for one in step.comparisons],
        "event": [_event_row(event) for event in step.events],
        "active": active,
        "pending": partition.count - active,
        "margin": margin.value if margin else None,
        "margin_gate": margin.gate if margin else None,
        **step.measured,
        "milliseconds": milliseconds,
    }


def steps_frame(rows: Iterable[dict[str, Any]], columns: Sequence[Column]) -> pl.DataFrame:
    """Return rows of `step_row` as a table, with the `columns` that the mapper declares."""
    schema = steps_schema(columns)
    blank = dict.fromkeys(schema)
    thresholds = [(column.name, column.threshold_of) for column in columns if column.threshold_of]
    return pl.DataFrame(
        [blank | row | {name: _threshold(row, gate) for name, gate in thresholds} for row in rows], schema=schema
    )


def with_final_map(steps: pl.DataFrame, final: FinalMap) -> pl.DataFrame:
    """Fill in what the end of the sequence tells of every image."""
    labels = pl.Series("node_final", final.labels, dtype=pl.Int32)
    placements = pl.Series("placement", [placement.value for placement in final.placements], dtype=PLACEMENT)
    return steps.with_columns(
        labels.replace(0, None),
        placements,
        (placements == Placement.FORCED.value).alias("forced"),
    ).select(steps.columns)


def step_from_row(row: dict[str, Any], columns: Iterable[Column]) -> Step:
    """Return a row of the steps table as the step it was made of, without its curves, which no row holds."""
    match = None
    if row["best_frame"] is not None:
        match = Match(row["best_frame"], row["best_node"], row["shift"])
    return Step(
        frame=row["frame"],
        verdict=row["verdict"],
        role=Role(row["role"]),
        node=row["node"],
        match=match,
        events=tuple(
            NodeEvent(EventKind(event["kind"]), event["node"], event["into"], tuple(event["frames"]))
            for event in row["event"]
        ),
        comparisons=comparisons_from_row(row),
        measured={
            column.name: value
            for column in columns
            if column.threshold_of is None and (value := row[column.name]) is not None
        },
    )


def comparisons_from_row(row: dict[str, Any]) -> tuple[Comparison, ...]:
    """Return what was compared, of a row of any table that says it."""
    return tuple(
        Comparison(**{**one, "values": tuple(one["values"]), "of": tuple(one["of"])}) for one in row["comparisons"]
    )


def frame_from_row(row: dict[str, Any]) -> Frame:
    """Return what a row of the steps table says of its image, which is not to be read any more."""
    yaw = np.nan if row["yaw"] is None else row["yaw"]
    pose = None if row["x"] is None or row["y"] is None else Pose(row["x"], row["y"], yaw)
    return Frame(_NO_PATH, row["file"], row["time"], pose, row["room"])


def read_steps(steps: pl.DataFrame, columns: Iterable[Column]) -> Iterator[tuple[Step, Frame]]:
    """Yield every row of a steps table as a step and its frame; see `step_from_row`."""
    own = list(columns)
    for row in steps.with_columns(pl.col("time").cast(pl.Int64)).iter_rows(named=True):
        yield step_from_row(row, own), frame_from_row(row)


def final_map(steps: pl.DataFrame, nodes: pl.DataFrame) -> FinalMap:
    """Return the final map that the tables of a complete run hold."""
    present = nodes.filter(pl.col("merged").is_null())
    return FinalMap(
        labels=steps["node_final"].fill_null(0).cast(pl.Int64).to_numpy(),
        placements=tuple(Placement(placement) for placement in steps["placement"]),
        nodes=tuple(present["id"].to_list()),
        active=frozenset(present.filter("active")["id"].to_list()),
        representatives=np.array(present["representative"].to_list(), np.float64),
    )


def nodes_frame(
    steps: pl.DataFrame, final: FinalMap, descriptors: NDArray[np.float32] | NDArray[np.float64]
) -> pl.DataFrame:
    """Return the nodes table.

    Parameters
    ----------
    steps
        The complete steps table.
    final
        The final map.
    descriptors
        Position descriptors of all images, shape (n, d).
    """
    history = _history(steps)
    representing = representative_frames(final.labels, final.nodes, final.representatives, descriptors)
    positions = steps.select("x", "y").to_numpy()
    rooms = steps["room"].to_list()
    rows = []
    for node, moments in history.items():
        row: dict[str, Any] = {"id": node, "images": 0, "active": node in final.active, **moments}
        if node in final.nodes:
            representative = final.representatives[final.nodes.index(node)]
            frames = np.flatnonzero(final.labels == node)
            row |= _extent(positions[frames])
            row |= {
                "images": len(frames),
                "rooms": _room_shares([rooms[frame] for frame in frames]),
                "representative": representative.tolist(),
                "representative_frame": representing[node],
            }
        rows.append(dict.fromkeys(NODES) | row)
    return pl.DataFrame(rows, schema=NODES)


def transitions_frame(final: FinalMap) -> pl.DataFrame:
    """Return the transitions table of the final map."""
    edges = sorted(count_transitions(final.labels).items())
    return pl.DataFrame([(a, b, count) for (a, b), count in edges], schema=TRANSITIONS, orient="row")


def quality_frame(measures: Iterable[Measure]) -> pl.DataFrame:
    """Return the quality table of a map."""
    return pl.DataFrame([dataclasses.astuple(one) for one in measures], schema=QUALITY, orient="row")


def comparison_row(one: Comparison) -> dict[str, Any]:
    """Return a comparison as a row; a mapper may have compared whole numbers."""
    return {
        "gate": one.gate,
        "values": [float(value) for value in one.values],
        "of": list(one.of),
        "threshold": float(one.threshold),
        "reaches": one.reaches,
        "low": float(one.low),
        "high": float(one.high),
        "parameter": one.parameter,
        "floor": float(one.floor),
        "counts": one.counts,
    }


def _threshold(row: dict[str, Any], gate: str) -> float | None:
    """Return the threshold of the first comparison at a gate."""
    return next((one["threshold"] for one in row["comparisons"] if one["gate"] == gate), None)


def _event_row(event: NodeEvent) -> dict[str, Any]:
    return {"kind": event.kind.value, "node": event.node, "into": event.into, "frames": list(event.frames)}


def _history(steps: pl.DataFrame) -> dict[int, dict[str, int | None]]:
    """When every node was created, activated and merged."""
    history: dict[int, dict[str, int | None]] = {}
    for frame, events in steps.select("frame", "event").filter(pl.col("event").list.len() > 0).iter_rows():
        for event in events:
            moments = history.setdefault(event["node"], {})
            moments[event["kind"]] = frame
            if event["kind"] == EventKind.MERGED:
                moments["merged_into"] = event["into"]
    return dict(sorted(history.items()))


def _extent(positions: NDArray[np.float64]) -> dict[str, float | None]:
    positions = positions[np.isfinite(positions).all(axis=1)]
    if not len(positions):
        return {}
    center = positions.mean(axis=0)
    return {
        "center_x": float(center[0]),
        "center_y": float(center[1]),
        "extent": float(np.linalg.norm(np.ptp(positions, axis=0))),
    }


def _room_shares(rooms: Sequence[str | None]) -> list[dict[str, Any]]:
    counted = Counter(room for room in rooms if room is not None)
    ordered = sorted(counted.items(), key=lambda item: (-item[1], item[0]))
    return [{"room": room, "share": count / len(rooms)} for room, count in ordered]
