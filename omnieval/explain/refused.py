"""Refused loop closures that the ground truth would have allowed, and how nearly each passed."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

from omnieval.errors import ResultError
from omnieval.explain.revisit import NEAR_METRES
from omnieval.mapping.partition import Partition
from omnieval.mapping.step import Step, Verdict
from omnieval.results.run_folder import Run
from omnieval.results.tables import step_from_row

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


def refused_closures(run: Run, *, within: float = NEAR_METRES, ago: int | None = None) -> pl.DataFrame:
    """Return refused loop closures that should have been accepted, the one that missed by the least first.

    An image that was refused for its prominence or the centroid counts when its best match was taken near by. One
    that no node would let in counts when an active node has an image that was; of several such nodes, the one whose
    gate ratio came nearest to x stands for them.

    Parameters
    ----------
    run
        A run.
    within
        What near by means, metres between the capture points.
    ago
        Least number of steps between the two images; default `n_new`, so that the place was left and met again. With 1
        the image before counts as well.

    Returns
    -------
    polars.DataFrame
        One row a refused image: `step`, `room` and `verdict`; the `value` that was compared, its `threshold`, and
        what was `missing`, relative to the threshold (null where nothing was compared); the image it should have
        been matched with (`match`), its room and node, the `metres` between them and how many `steps_ago` it was
        taken; and by which `placement` the image came to its node in the end.

    Raises
    ------
    ResultError
        If a position is missing.
    """
    steps = run.steps
    positions = steps.select("x", "y").to_numpy()
    if steps.is_empty() or not np.isfinite(positions).all():
        raise ResultError(
            f"{run.folder} has no complete ground-truth positions to judge refusals by; explain single steps"
        )
    settings = run.manifest["configuration"]["mapper"]
    apart: int = settings["n_new"] if ago is None else ago
    rows = _missed_closures(steps, positions, settings["gamma"], within, apart)
    return pl.DataFrame(list(rows), schema=_SCHEMA).sort("missing", "step", nulls_last=True)


def _missed_closures(
    steps: pl.DataFrame, positions: NDArray[np.float64], gamma: float, within: float, ago: int
) -> Iterator[dict[str, Any]]:
    """Yield the rows of `refused_closures` in the order of their steps."""
    partition = Partition()
    for row in steps.iter_rows(named=True):
        step = step_from_row(row)
        frame = step.frame
        distances = np.linalg.norm(positions[:frame] - positions[frame], axis=1)
        near = np.flatnonzero((distances <= within) & (np.arange(frame) <= frame - ago))
        found = _missed(step, row, near, distances, partition, gamma)
        if found is not None:
            match = found["match"]
            here = {"step": frame, "room": row["room"], "verdict": row["verdict"], "placement": row["placement"]}
            there = {"match_room": steps["room"][match], "match_node": int(partition.labels[match])}
            yield here | found | there | {"metres": float(distances[match]), "steps_ago": frame - match}
        partition.apply(step)


def _missed(
    step: Step,
    row: dict[str, Any],
    near: NDArray[np.int64],
    distances: NDArray[np.float64],
    partition: Partition,
    gamma: float,
) -> dict[str, Any] | None:
    """Return what a refused image missed, and the image it should have been matched with; None if it missed nothing."""
    if step.verdict is Verdict.NO_CANDIDATE:
        return _missed_gate(step, near, distances, partition)
    if step.verdict not in (Verdict.PROMINENCE, Verdict.CENTROID) or row["best_frame"] not in near:
        return None
    if step.centroid is not None:
        return _comparison(step.centroid.shift, step.centroid.bound, row["best_frame"])
    if row["peaks"] < 2:
        return {"value": None, "threshold": None, "missing": None, "match": row["best_frame"]}
    return _comparison(row["prominence_ratio"], gamma, row["best_frame"])


def _missed_gate(
    step: Step, near: NDArray[np.int64], distances: NDArray[np.float64], partition: Partition
) -> dict[str, Any] | None:
    """Return the nearest gate among those of the active nodes that have an image near by."""
    gate = step.gate
    if gate is None or not near.size:
        return None
    labels = partition.labels[near]
    chosen = np.isin(gate.nodes, labels)
    if not chosen.any():
        return None
    nearest = np.flatnonzero(chosen)[gate.ratios[chosen].argmin()]
    members = near[labels == gate.nodes[nearest]]
    return _comparison(float(gate.ratios[nearest]), gate.x, int(members[distances[members].argmin()]))


def _comparison(value: float, threshold: float, match: int) -> dict[str, Any]:
    missing = abs(value - threshold) / threshold if threshold else None
    return {"value": value, "threshold": threshold, "missing": missing, "match": match}
