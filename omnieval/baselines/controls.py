"""Control partitions: one that knows nothing of places, and one that knows their true positions."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from omnieval.seeding import named_generator


def time_slices(count: int, clusters: int) -> NDArray[np.int64]:
    """Cut `count` images in time into slices of equal length (to one image); labels 1..clusters, shape (count,)."""
    return np.arange(count, dtype=np.int64) * clusters // count + 1


def position_clusters(positions: NDArray[np.float64], clusters: int, *, seed: int) -> NDArray[np.int64]:
    """k-means on the true capture positions: an upper reference for a map of that many nodes.

    Parameters
    ----------
    positions
        Shape (n, 2), metres, with at least `clusters` different rows.
    clusters
        Number of clusters.
    seed
        Root seed; k-means++ with 10 restarts.

    Returns
    -------
    Labels 1..clusters, shape (n,).
    """
    from sklearn.cluster import KMeans
    from threadpoolctl import threadpool_limits

    random_state = int(named_generator(seed, "position-clusters", clusters).integers(2**31))
    with threadpool_limits(1):  # the order of parallel sums must not decide a label
        fitted = KMeans(clusters, n_init=10, random_state=random_state).fit(positions)
    return np.asarray(fitted.labels_, np.int64) + 1
