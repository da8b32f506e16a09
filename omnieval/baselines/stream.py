"""An incremental clustering method by others, to compare the incremental mapping method with."""

from __future__ import annotations

from importlib.util import find_spec

import numpy as np
from numpy.typing import NDArray

from omnieval.baselines.batch import numbered
from omnieval.errors import ConfigError

_NO_FADING = 1e-12
"""Per image; the weights of micro-clusters stay what they are over any sequence."""


def dbstream_clusters(descriptors: NDArray[np.floating]) -> NDArray[np.int64]:
    """DBSTREAM (Hahsler and Bolaños 2016, doi 10.1109/TKDE.2016.2522412) of river, images in time order.

    The radius of a micro-cluster, which the algorithm leaves to its user, is twice the median distance of successive
    images; nothing fades, because a place does not go away. Every image is labelled by the clusters as they are at
    the end.

    Parameters
    ----------
    descriptors
        Position descriptors in time order, shape (n, d).

    Returns
    -------
    Labels from 1 in the order of first appearance, shape (n,).

    Raises
    ------
    ConfigError
        If river is not installed.
    """
    require_river()
    from river.cluster import DBSTREAM

    points = np.asarray(descriptors, np.float64)
    model = DBSTREAM(
        clustering_threshold=_micro_radius(points),
        fading_factor=_NO_FADING,
        cleanup_interval=len(points) + 1,
        intersection_factor=0.3,
        minimum_weight=1.0,
    )
    rows = [dict(enumerate(point)) for point in points.tolist()]
    for row in rows:
        model.learn_one(row)
    return numbered(np.array([model.predict_one(row) for row in rows]))


def require_river() -> None:
    """Raise `ConfigError` if river, which is an optional extra, is not installed."""
    if find_spec("river") is None:
        raise ConfigError("method dbstream needs river, which is not installed; pip install 'omnieval[river]'")


def _micro_radius(points: NDArray[np.float64]) -> float:
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    positive = steps[steps > 0]
    return 2 * float(np.median(positive)) if positive.size else 1.0
