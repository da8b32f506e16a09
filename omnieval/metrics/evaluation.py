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
from omnieval.metrics.silhouette import Silhouettes, silhouettes

_SHARES = {
    "share_assigned": Placement.LOOP_CLOSURE,
    "share_pending": Placement.PENDING,
    "share_founding": Placement.FOUNDING,
    "share_retest": Placement.RETEST,
    "share_forced": Placement.FORCED,
    "share_unassigned": Placement.UNASSIGNED,
}
_SILHOUETTES = tuple(field.name for field in dataclasses.fields(Silhouettes))


@dataclass(frozen=True)
class Evaluation:
    """Metrics by name; `reasons` says of each null one why it has no value."""

    metrics: dict[str, float | int | None]
    reasons: dict[str, str]


def evaluate(
    labels: NDArray[np.int64],
    placements: Sequence[Placement],
    positions: NDArray[np.float64] | None,
    *,
    seed: int,
) -> Evaluation:
    """Judge a partition of a sequence.

    Parameters
    ----------
    labels
        Node of every image, 0 where unassigned, shape (n,). Unassigned images are left out of silhouettes and
        counted in `share_unassigned`.
    placements
        How each image came to its node, length n. The six shares sum to 1.
    positions
        True capture positions, shape (n, 2), metres; None when they are not known.
    seed
        Root seed of the k-means control.
    """
    placed = labels > 0
    nodes = len(np.unique(labels[placed]))
    counted = Counter(placements)
    metrics: dict[str, float | int | None] = {"nodes": nodes}
    metrics |= {name: counted[placement] / len(labels) for name, placement in _SHARES.items()}
    names = (*_SILHOUETTES, "silhouette_time_slices", "silhouette_positions")
    if positions is None:
        return _null(metrics, names, "the sequence has no poses")
    if nodes < 2:
        return _null(metrics, names, f"a silhouette needs at least two nodes, the map has {nodes}")
    metrics |= dataclasses.asdict(silhouettes(positions[placed], labels[placed]))
    metrics["silhouette_time_slices"] = silhouettes(positions, time_slices(len(labels), nodes)).silhouette
    if len(np.unique(positions, axis=0)) < nodes:
        return _null(metrics, names[-1:], "there are fewer different positions than nodes")
    controls = position_clusters(positions, nodes, seed=seed)
    metrics["silhouette_positions"] = silhouettes(positions, controls).silhouette
    return Evaluation(metrics, {})


def _null(metrics: dict[str, float | int | None], names: Sequence[str], reason: str) -> Evaluation:
    return Evaluation(metrics | dict.fromkeys(names), dict.fromkeys(names, reason))
