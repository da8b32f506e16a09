"""Silhouettes of a partition over ground-truth capture positions, whole and kept up incrementally.

s_j = (b_j - a_j) / max(a_j, b_j): a_j is image j's mean distance to the other images of its cluster, b_j to those
of other clusters (Rousseeuw 1987, doi 10.1016/0377-0427(87)90125-7; Eqs. 12 and 13 of doi 10.3390/app10186480).
A singleton scores 0.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.distance import cdist

_BLOCK_VALUES = 4_000_000
"""Distances held at once (32 MB), so that memory grows with n and not with n x n."""


@dataclass(frozen=True, slots=True)
class Silhouettes:
    """The four readings of the silhouette; they differ in b_j and in the average.

    Attributes
    ----------
    silhouette
        b_j: nearest other cluster; mean over clusters of the cluster mean (Eq. 12).
    silhouette_image
        b_j: nearest other cluster; mean over images (scikit-learn's).
    silhouette_literal
        b_j: all other clusters together (Eq. 13 as printed); mean over clusters.
    silhouette_sq
        b_j: nearest other cluster, squared distances (MATLAB's default); mean over clusters.
    """

    silhouette: float
    silhouette_image: float
    silhouette_literal: float
    silhouette_sq: float


def posed(positions: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Tell of which images the position is known, shape (n,); `positions` has shape (n, 2), NaN where it is not."""
    known: NDArray[np.bool_] = np.logical_and.reduce(np.isfinite(positions), axis=1)
    return known


def silhouettes(positions: NDArray[np.float64], labels: NDArray[np.int64]) -> Silhouettes:
    """Return the silhouettes of a partition, over the images whose positions are known.

    Parameters
    ----------
    positions
        Capture positions, shape (n, 2), metres; NaN where unknown, which leaves the image out.
    labels
        Cluster of each image, shape (n,), at least two different ones where positions are known.

    Raises
    ------
    ValueError
        If there are fewer than two clusters.
    """
    known = posed(positions)
    positions, labels = positions[known], labels[known]
    clusters, codes = np.unique(labels, return_inverse=True)
    if len(clusters) < 2:
        raise ValueError("a silhouette needs at least two clusters")
    counts = np.bincount(codes)
    distance, squared = _sums_to_clusters(positions, codes, len(clusters))
    nearest = _scores(distance, codes, counts, _nearest)
    return Silhouettes(
        silhouette=_over_clusters(nearest, codes, counts),
        silhouette_image=float(nearest.mean()),
        silhouette_literal=_over_clusters(_scores(distance, codes, counts, _together), codes, counts),
        silhouette_sq=_over_clusters(_scores(squared, codes, counts, _nearest), codes, counts),
    )


def image_silhouettes(positions: NDArray[np.float64], labels: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return s_j of every image (b_j: nearest other cluster), shape (n,); all positions known, two clusters or more."""
    clusters, codes = np.unique(labels, return_inverse=True)
    distance, _ = _sums_to_clusters(positions, codes, len(clusters))
    return _scores(distance, codes, np.bincount(codes), _nearest)


class IncrementalSilhouette:
    """`Silhouettes.silhouette` of a growing partition, without computing any distance twice.

    Adding an image costs O(n), a value O(n k); memory is O(n k) for n images in k clusters.
    """

    def __init__(self) -> None:
        self._positions: NDArray[np.float64] = np.empty((64, 2))
        self._codes: NDArray[np.int64] = np.empty(64, np.int64)
        self._sums: NDArray[np.float64] = np.zeros((64, 8))
        self._count = 0
        self._columns: dict[int, int] = {}

    def add(self, position: tuple[float, float], cluster: int) -> None:
        """Add an image taken at `position` (metres) to a cluster, which may be new."""
        column = self._columns.setdefault(cluster, len(self._columns))
        self._grow(column)
        count = self._count
        self._positions[count] = position
        self._codes[count] = column
        self._count = count + 1
        distances = np.hypot(*(self._positions[: count + 1] - self._positions[count]).T)
        self._sums[: count + 1, column] += distances
        width = self._sums.shape[1]
        self._sums[count] = np.bincount(self._codes[: count + 1], distances, minlength=width)

    def merge(self, cluster: int, into: int) -> None:
        """Move all images of a cluster into another; a cluster may be without any."""
        if cluster not in self._columns:
            return
        source, target = self._columns[cluster], self._columns.setdefault(into, len(self._columns))
        self._grow(target)
        codes = self._codes[: self._count]
        codes[codes == source] = target
        self._sums[:, target] += self._sums[:, source]
        self._sums[:, source] = 0.0

    def value(self) -> float | None:
        """Return the silhouette so far, None while there are fewer than two clusters."""
        columns, codes = np.unique(self._codes[: self._count], return_inverse=True)
        if len(columns) < 2:
            return None
        counts = np.bincount(codes)
        return _over_clusters(_scores(self._sums[: self._count, columns], codes, counts, _nearest), codes, counts)

    def _grow(self, column: int) -> None:
        rows, width = self._sums.shape
        rows = 2 * rows if self._count == rows else rows
        width = 2 * width if column == width else width
        if (rows, width) == self._sums.shape:
            return
        sums = np.zeros((rows, width))
        sums[: self._sums.shape[0], : self._sums.shape[1]] = self._sums
        self._sums = sums
        self._positions = np.resize(self._positions, (rows, 2))
        self._codes = np.resize(self._codes, rows)


def _sums_to_clusters(
    positions: NDArray[np.float64], codes: NDArray[np.int64], clusters: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the sums of distances and of squared distances of each image to each cluster, shape (n, clusters)."""
    membership = np.eye(clusters)[codes]
    block = max(1, _BLOCK_VALUES // len(positions))
    distance, squared = [], []
    for start in range(0, len(positions), block):
        distances = cdist(positions[start : start + block], positions)
        distance.append(distances @ membership)
        squared.append(np.square(distances) @ membership)
    return np.concatenate(distance), np.concatenate(squared)


def _scores(
    sums: NDArray[np.float64],
    codes: NDArray[np.int64],
    counts: NDArray[np.int64],
    others: Callable[[NDArray[np.float64], NDArray[np.int64], NDArray[np.int64]], NDArray[np.float64]],
) -> NDArray[np.float64]:
    """Return s_j of every image, shape (n,), from its sums of distances to the clusters."""
    own = np.arange(len(codes)), codes
    within = sums[own] / np.maximum(counts[codes] - 1, 1)
    between = others(sums, codes, counts)
    scale = np.maximum(within, between)
    scores = np.divide(between - within, scale, out=np.zeros(len(codes)), where=scale > 0)
    scores[counts[codes] == 1] = 0.0
    return scores


def _nearest(sums: NDArray[np.float64], codes: NDArray[np.int64], counts: NDArray[np.int64]) -> NDArray[np.float64]:
    """b_j: smallest mean distance to another cluster."""
    means = sums / counts
    means[np.arange(len(codes)), codes] = np.inf
    nearest: NDArray[np.float64] = means.min(axis=1)
    return nearest


def _together(sums: NDArray[np.float64], codes: NDArray[np.int64], counts: NDArray[np.int64]) -> NDArray[np.float64]:
    """b_j: mean distance to the images of all other clusters."""
    own = np.arange(len(codes)), codes
    together: NDArray[np.float64] = (sums.sum(axis=1) - sums[own]) / (len(codes) - counts[codes])
    return together


def _over_clusters(scores: NDArray[np.float64], codes: NDArray[np.int64], counts: NDArray[np.int64]) -> float:
    """Mean over clusters of the cluster mean (Eq. 12)."""
    return float((np.bincount(codes, scores) / counts).mean())
