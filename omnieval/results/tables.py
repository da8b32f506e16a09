"""Steps and maps as rows of the tables in `schemas`, and back."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

from omnieval.datasets.sequence import Frame
from omnieval.mapping.partition import count_transitions
from omnieval.mapping.step import (
    Centroid,
    EventKind,
    FinalMap,
    Margin,
    NodeEvent,
    NodeGate,
    Placement,
    Step,
    Verdict,
)
from omnieval.results.schemas import NODES, PLACEMENT, STEPS, TRANSITIONS


def step_row(step: Step, frame: Frame, milliseconds: float) -> dict[str, Any]:
    """Return the row of one step; what only the end of the sequence tells is null."""
    pose = frame.pose
    row: dict[str, Any] = {
        "frame": step.frame,
        "file": frame.file,
        "time": frame.time_ns,
        "x": pose.x if pose else None,
        "y": pose.y if pose else None,
        "yaw": pose.yaw if pose and np.isfinite(pose.yaw) else None,
        "room": frame.room,
        "verdict": step.verdict.value,
        "node": step.node,
        "run": step.run,
        "event": [_event_row(event) for event in step.events],
        "active": step.active,
        "pending": step.pending,
        "margin": step.margin.value if step.margin else None,
        "margin_gate": step.margin.gate if step.margin else None,
        "milliseconds": milliseconds,
    }
    if step.gate:
        row["candidates"] = step.gate.candidates.tolist()
        row["gate_nodes"] = step.gate.nodes.tolist()
        row["gate_ratios"] = step.gate.ratios.tolist()
        row["x_gate"] = step.gate.x
    if match := step.match:
        row["best_frame"] = match.best_frame
        row["shift"] = match.shift
        row["similarity_position"] = float(match.position[match.best])
        row["similarity_orientation"] = float(match.orientation[match.best])
        row["similarity"] = float(match.similarity[match.best])
        row["prominence"] = match.prominence
        row["prominence_mean"] = match.prominence_mean
        row["prominence_ratio"] = match.prominence_ratio
        row["peaks"] = match.peaks
    if step.centroid:
        row["centroid_shift"] = step.centroid.shift
        row["centroid_bound"] = step.centroid.bound
    row["merge_ratio"] = step.merge_ratio
    return row


def steps_frame(rows: Iterable[dict[str, Any]]) -> pl.DataFrame:
    """Return rows of `step_row` as a table."""
    return pl.DataFrame([dict.fromkeys(STEPS) | row for row in rows], schema=STEPS)


def with_final_map(steps: pl.DataFrame, final: FinalMap) -> pl.DataFrame:
    """Fill in what the end of the sequence tells of every image."""
    labels = pl.Series("node_final", final.labels, dtype=pl.Int32)
    placements = pl.Series("placement", [placement.value for placement in final.placements], dtype=PLACEMENT)
    return steps.with_columns(
        labels.replace(0, None),
        placements,
        (placements == Placement.FORCED.value).alias("forced"),
    ).select(STEPS.names())


def step_from_row(row: dict[str, Any]) -> Step:
    """Return a row of the steps table as a step again, without its match, which is more than a row holds."""
    gate = margin = centroid = None
    if row["gate_nodes"] is not None:
        gate = NodeGate(row["x_gate"], np.array(row["gate_nodes"], np.int64), np.array(row["gate_ratios"]))
    if row["centroid_shift"] is not None:
        centroid = Centroid(row["centroid_shift"], row["centroid_bound"])
    if row["margin"] is not None:
        margin = Margin(row["margin"], row["margin_gate"])
    return Step(
        frame=row["frame"],
        verdict=Verdict(row["verdict"]),
        node=row["node"],
        gate=gate,
        match=None,
        centroid=centroid,
        run=row["run"],
        events=tuple(
            NodeEvent(EventKind(event["kind"]), event["node"], event["into"], tuple(event["frames"]))
            for event in row["event"]
        ),
        active=row["active"],
        pending=row["pending"],
        margin=margin,
        merge_ratio=row["merge_ratio"],
    )


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
                "representative_frame": _nearest(frames, descriptors, representative),
            }
        rows.append(dict.fromkeys(NODES) | row)
    return pl.DataFrame(rows, schema=NODES)


def transitions_frame(final: FinalMap) -> pl.DataFrame:
    """Return the transitions table of the final map."""
    edges = sorted(count_transitions(final.labels).items())
    return pl.DataFrame([(a, b, count) for (a, b), count in edges], schema=TRANSITIONS, orient="row")


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
    if not np.isfinite(positions).all():
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


def _nearest(
    frames: NDArray[np.int64],
    descriptors: NDArray[np.float32] | NDArray[np.float64],
    representative: NDArray[np.float64],
) -> int:
    distances = np.linalg.norm(descriptors[frames] - representative, axis=1)
    return int(frames[np.argmin(distances)])
