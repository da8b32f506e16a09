"""Batch clusterings that see the whole sequence at once, unlike an incremental map."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.cluster.hierarchy import cut_tree, ward
from sklearn.cluster import KMeans
from threadpoolctl import threadpool_limits

from omnieval.seeding import named_generator


def kmeans_clusters(
    points: NDArray[Any], clusters: int, *, seed: int, name: str = "kmeans", restarts: int = 10
) -> NDArray[np.int64]:
    """k-means, k-means++ with restarts.

    Parameters
    ----------
    points
        Shape (n, d), floating point; computed in its own precision.
    clusters
        Number of clusters; fewer come out when fewer points differ.
    seed, name
        Root seed, and what the draws are made for.
    restarts
        Of which the best is taken.

    Returns
    -------
    Labels from 1 in the order of first appearance, shape (n,).
    """
    different = len(np.unique(points, axis=0))
    random_state = int(named_generator(seed, name, clusters).integers(2**31))
    with threadpool_limits(1):  # the order of parallel sums must not decide a label
        fitted = KMeans(min(clusters, different), n_init=restarts, random_state=random_state).fit(points)
    return numbered(fitted.labels_)


@dataclass(frozen=True)
class WardTree:
    """One agglomerative clustering (Ward 1963, doi 10.1080/01621459.1963.10500845), cut wherever one likes.

    Attributes
    ----------
    linkage
        Shape (n - 1, 4), see `scipy.cluster.hierarchy.linkage`.
    """

    linkage: NDArray[np.float64]

    @classmethod
    def grow(cls, points: NDArray[np.floating]) -> WardTree:
        """Merge n points, shape (n, d), two by two, each time the pair that adds the least variance."""
        return cls(ward(np.asarray(points, np.float64)))

    def cut(self, clusters: int) -> NDArray[np.int64]:
        """Return exactly `clusters` clusters: labels from 1 in the order of first appearance, shape (n,)."""
        return numbered(cut_tree(self.linkage, n_clusters=clusters)[:, 0])


def numbered(labels: NDArray[Any]) -> NDArray[np.int64]:
    """Renumber clusters from 1 in the order of first appearance, so that equal partitions have equal labels.

    Examples
    --------
    >>> numbered(np.array([7, 7, 2, 7, 4])).tolist()
    [1, 1, 2, 1, 3]
    """
    _, first, codes = np.unique(labels, return_index=True, return_inverse=True)
    ranks = np.empty(len(first), np.int64)
    ranks[np.argsort(first)] = np.arange(1, len(first) + 1)
    return np.asarray(ranks[codes])
