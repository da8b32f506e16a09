"""Refused loop closures that the ground truth would have allowed, and how nearly each passed."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

from omnieval.errors import ResultError
from omnieval.explain.revisit import AGO_STEPS, NEAR_METRES
from omnieval.explain.words import deciding
from omnieval.mapping.interface import Method
from omnieval.mapping.partition import Partition
from omnieval.mapping.step import Comparison, Role, Step
from omnieval.results.run_folder import Run
from omnieval.results.tables import read_steps

_SCHEMA = pl.Schema(
    {
        "step": pl.Int64,
        "room": pl.String,
        "verdict": pl.String,
        "value": pl.Float64,
        "threshold": pl.Float64,
        "missing": pl.Float64,
        "match": pl.Int64,
        "match_room": pl.String,
        "match_node": pl.Int64,
        "metres": pl.Float64,
        "steps_ago": pl.Int64,
        "placement": pl.String,
    }
)


def refused_closures(run: Run, *, within: float = NEAR_METRES, ago: int = AGO_STEPS) -> pl.DataFrame:
    """Return refused loop closures that should have been accepted, the one that missed by the least first.

    An image that was refused after it was matched with another counts when that was taken near by. One that no node
    would let in counts when an active node has an image that was; of several such nodes, the one that came nearest to
    letting it in stands for them.

    Parameters
    ----------
    run
        A run.
    within
        What near by means, metres between the capture points.
    ago
        Least number of steps between the two images, so that the place was left and met again. With 1 the image before
        counts as well.

    Returns
    -------
    polars.DataFrame
        One row per refused image: `step`, `room` and `verdict`; the `value` that was compared, its `threshold`, and
        what was `missing`, relative to the threshold (null where nothing was nearly equal); the image it should have
        been matched with (`match`), its room and node, the `metres` between them and how many `steps_ago` it was
        taken; and by which `placement` the image came to its node in the end.

    Raises
    ------
    ResultError
        If no position is known; an image without one is judged by none, and judges none.
    """
    steps = run.steps
    positions = steps.select("x", "y").to_numpy()
    if steps.is_empty() or not np.isfinite(positions).any():
        raise ResultError(f"{run.folder} has no ground-truth positions to judge refusals by; explain single steps")
    rows = _missed_closures(steps, positions, run.method, within, ago)
    return pl.DataFrame(list(rows), schema=_SCHEMA).sort("missing", "step", nulls_last=True)


def _missed_closures(
    steps: pl.DataFrame, positions: NDArray[np.float64], method: Method, within: float, ago: int
) -> Iterator[dict[str, Any]]:
    """Yield the rows of `refused_closures` in the order of their steps."""
    partition = Partition()
    rooms, placements = steps["room"], steps["placement"]
    for step, image in read_steps(steps, method.columns):
        frame = step.frame
        if step.role is Role.REFUSED:
            distances = np.linalg.norm(positions[:frame] - positions[frame], axis=1)
            near = np.flatnonzero((distances <= within) & (np.arange(frame) <= frame - ago))
            found = _missed(step, near, distances, partition, method)
            if found is not None:
                match = found["match"]
                here = {"step": frame, "room": image.room, "verdict": step.verdict, "placement": placements[frame]}
                there = {"match_room": rooms[match], "match_node": int(partition.labels[match])}
                yield here | found | there | {"metres": float(distances[match]), "steps_ago": frame - match}
        partition.apply(step)


def _missed(
    step: Step, near: NDArray[np.int64], distances: NDArray[np.float64], partition: Partition, method: Method
) -> dict[str, Any] | None:
    """Return what a refused image missed, and the image it should have been matched with; None if it missed nothing."""
    refusing = deciding(step, method)
    if refusing is None:
        return None
    if method.gate(refusing.gate).of == "node":
        return _missed_node(refusing, near, distances, partition)
    if step.match is None or step.match.frame not in near:
        return None
    if refusing.counts:
        return {"value": None, "threshold": None, "missing": None, "match": step.match.frame}
    return _compared(refusing, refusing.best, step.match.frame)


def _missed_node(
    refusing: Comparison, near: NDArray[np.int64], distances: NDArray[np.float64], partition: Partition
) -> dict[str, Any] | None:
    """Return the node that came nearest to letting the image in, among those that have an image near by."""
    labels = partition.labels[near]
    having = [(abs(value - refusing.threshold), value, one) for value, one in _values(refusing) if one in labels]
    if not having:
        return None
    _, value, node = min(having)
    members = near[labels == node]
    return _compared(refusing, value, int(members[distances[members].argmin()]))


def _values(comparison: Comparison) -> Iterator[tuple[float, int]]:
    yield from zip(comparison.values, comparison.of, strict=True)


def _compared(comparison: Comparison, value: float, match: int) -> dict[str, Any]:
    threshold = comparison.threshold
    missing = abs(value - threshold) / abs(threshold) if threshold else None
    return {"value": value, "threshold": threshold, "missing": missing, "match": match}
