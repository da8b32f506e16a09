"""The metrics of a map, each a number or null with a reason."""

from __future__ import annotations

import dataclasses
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from omnieval.baselines.controls import position_clusters, time_slices
from omnieval.mapping.step import Placement
from omnieval.metrics.agreement import RoomAgreement, room_agreement
from omnieval.metrics.catalogue import CATALOGUE, METRICS, THETA
from omnieval.metrics.ground import Clock, Ground
from omnieval.metrics.metric import Judged
from omnieval.metrics.quality import Making, Measure, measure
from omnieval.metrics.silhouette import Silhouettes, posed, silhouettes

__all__ = ["METRICS", "Evaluation", "evaluate"]

_SHARES = {
    "share_assigned": Placement.LOOP_CLOSURE,
    "share_pending": Placement.PENDING,
    "share_founding": Placement.FOUNDING,
    "share_retest": Placement.RETEST,
    "share_forced": Placement.FORCED,
    "share_unassigned": Placement.UNASSIGNED,
}
_SILHOUETTES = tuple(field.name for field in dataclasses.fields(Silhouettes))
_CONTROLS = ("silhouette_time_slices", "silhouette_positions")
_AGREEMENT = tuple(field.name for field in dataclasses.fields(RoomAgreement))
_NOT_MADE = Making()


@dataclass(frozen=True)
class Evaluation:
    """Metrics by name; `reasons` says of each null one why it has no value.

    `measures` are those of the map's quality at every distance that was asked for.
    """

    metrics: dict[str, float | int | None]
    reasons: dict[str, str]
    measures: tuple[Measure, ...] = ()


def evaluate(
    labels: NDArray[np.int64],
    placements: Sequence[Placement] | None,
    positions: NDArray[np.float64] | None,
    *,
    rooms: Sequence[str | None] | None,
    seed: int,
    unposed: str | None = None,
    times: Sequence[int | None] | None = None,
    making: Making = _NOT_MADE,
    thetas: Sequence[float] = (THETA,),
    ground: Ground | None = None,
) -> Evaluation:
    """Judge a partition of a sequence.

    Parameters
    ----------
    labels
        Node of every image, 0 where unassigned, shape (n,). Unassigned images are left out of silhouettes and
        agreement, and counted in `share_unassigned`.
    placements
        How each image came to its node, length n; the six shares sum to 1. None for a partition that was not made
        image by image: of the shares, only `share_unassigned` has a value.
    positions
        True capture positions, shape (n, 2), metres, NaN where unknown; None when none is known. Silhouettes are over
        the images that have one, which `posed` counts.
    rooms
        Room of each image, None where it has no label, length n; None when the sequence has no labels. Agreement is
        over the images that have one, which `labelled` counts.
    seed
        Root seed of the k-means control.
    unposed
        Why no position is known; default: that the sequence has no poses.
    times
        Nanoseconds at which each image was taken, None where unknown, length n; None if all are unknown.
    making
        How the map came about, for what the partition does not tell.
    thetas
        Distances within which images lie at one place, metres, for `Evaluation.measures`; `THETA` among them.
    ground
        What follows from positions and times, computed once for many maps; default: computed again.
    """
    nodes = len(np.unique(labels[labels > 0]))
    why = unposed or "the sequence has no poses"
    if ground is None and positions is not None:
        ground = Ground(positions, times)
    located = 0 if ground is None else len(ground)
    judged = Judged(
        labels,
        np.full((len(labels), 2), np.nan) if positions is None else positions,
        [None] * len(labels) if rooms is None else rooms,
        [None] * len(labels) if times is None else times,
    )
    measures = measure(
        labels, ground if ground is not None and located else why, rooms, Clock.of(times, len(labels)), making, thetas
    )
    parts = (
        _computed(judged),
        _shares(labels, placements),
        _silhouettes(labels, positions, nodes, seed)
        if positions is not None and located
        else _null((*_SILHOUETTES, *_CONTROLS), why),
        _agreement(labels, rooms),
        _at_theta(measures),
    )
    metrics: dict[str, float | int | None] = {}
    reasons: dict[str, str] = {}
    for part in parts:
        metrics |= part.metrics
        reasons |= part.reasons
    return Evaluation({name: metrics[name] for name in METRICS}, reasons, measures)


def _computed(judged: Judged) -> Evaluation:
    """Return the metrics that compute themselves."""
    metrics: dict[str, float | int | None] = {}
    reasons: dict[str, str] = {}
    for metric in CATALOGUE:
        if metric.compute is not None:
            found = metric.compute(judged)
            metrics[metric.name] = None if isinstance(found, str) else found
            reasons |= {metric.name: found} if isinstance(found, str) else {}
    return Evaluation(metrics, reasons)


def _at_theta(measures: Sequence[Measure]) -> Evaluation:
    """Return the measures that are metrics by themselves."""
    found = {(one.metric, one.theta): one for one in measures}
    chosen = {metric.name: found[metric.of, metric.at] for metric in CATALOGUE if metric.of is not None}
    reasons = {name: one.reason for name, one in chosen.items() if one.reason is not None}
    return Evaluation({name: one.value for name, one in chosen.items()}, reasons)


def _shares(labels: NDArray[np.int64], placements: Sequence[Placement] | None) -> Evaluation:
    if placements is None:
        null = _null(tuple(_SHARES)[:-1], "the images were not placed one by one")
        return Evaluation(null.metrics | {"share_unassigned": float((labels == 0).mean())}, null.reasons)
    counted = Counter(placements)
    return Evaluation({name: counted[placement] / len(labels) for name, placement in _SHARES.items()}, {})


def _silhouettes(labels: NDArray[np.int64], positions: NDArray[np.float64], nodes: int, seed: int) -> Evaluation:
    if nodes < 2:
        return _null((*_SILHOUETTES, *_CONTROLS), f"a silhouette needs at least two nodes, the map has {nodes}")
    known = posed(positions)
    labels, positions = labels[known], positions[known]
    placed = labels > 0
    nodes = len(np.unique(labels[placed]))
    if nodes < 2:
        what = f"of {len(known)} images {len(labels)} have a position, and they lie in fewer than two nodes"
        return _null((*_SILHOUETTES, *_CONTROLS), what)
    metrics: dict[str, float | int | None] = dataclasses.asdict(silhouettes(positions[placed], labels[placed]))
    metrics["silhouette_time_slices"] = silhouettes(positions, time_slices(len(labels), nodes)).silhouette
    if len(np.unique(positions, axis=0)) < nodes:
        null = _null(_CONTROLS[-1:], "there are fewer different positions than nodes")
        return Evaluation(metrics | null.metrics, null.reasons)
    controls = position_clusters(positions, nodes, seed=seed)
    metrics["silhouette_positions"] = silhouettes(positions, controls).silhouette
    return Evaluation(metrics, {})


def _agreement(labels: NDArray[np.int64], rooms: Sequence[str | None] | None) -> Evaluation:
    if rooms is None or all(room is None for room in rooms):
        return _null(_AGREEMENT, "the sequence has no room labels")
    if not any(room is not None and node > 0 for room, node in zip(rooms, labels, strict=True)):
        return _null(_AGREEMENT, "no image has both a room label and a node")
    return Evaluation(dataclasses.asdict(room_agreement(labels, rooms)), {})


def _null(names: Sequence[str], reason: str) -> Evaluation:
    return Evaluation(dict.fromkeys(names), dict.fromkeys(names, reason))
