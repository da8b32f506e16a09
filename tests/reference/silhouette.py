"""The four silhouettes in plain loops: the oracle of `omnieval.metrics`."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

Point = Sequence[float]
Partition = dict[int, list[Point]]
Measure = Callable[[Point, Point], float]


def silhouettes(positions: Sequence[Point], labels: Sequence[int]) -> dict[str, float]:
    """The silhouettes of a partition; images with label 0 are left out; NaN for fewer than two clusters.

    Keys: ``silhouette``, ``silhouette_image``, ``silhouette_literal``, ``silhouette_sq``.
    """
    clusters: Partition = {}
    for point, label in zip(positions, labels, strict=True):
        if label != 0:
            clusters.setdefault(label, []).append(point)
    names = ("silhouette", "silhouette_image", "silhouette_literal", "silhouette_sq")
    if len(clusters) < 2:
        return dict.fromkeys(names, math.nan)
    nearest = values_by_cluster(clusters, nearest_other, math.dist)
    literal = values_by_cluster(clusters, all_others, math.dist)
    squared = values_by_cluster(clusters, nearest_other, squared_distance)
    scores = (mean_over_clusters(nearest), mean_over_images(nearest), mean_over_clusters(literal))
    return dict(zip(names, (*scores, mean_over_clusters(squared)), strict=True))


def values_by_cluster(
    clusters: Partition, other: Callable[[Partition, int, Point, Measure], float], measure: Measure
) -> list[list[float]]:
    """s_j = (b_j - a_j) / max(a_j, b_j) of every image, cluster by cluster; 0 in a singleton."""
    return [
        [
            silhouette_of(
                mean_distance(point, members[:j] + members[j + 1 :], measure),
                other(clusters, label, point, measure),
            )
            if len(members) > 1
            else 0.0
            for j, point in enumerate(members)
        ]
        for label, members in clusters.items()
    ]


def silhouette_of(a: float, b: float) -> float:
    """The silhouette of one image; 0 where all distances are 0."""
    return (b - a) / max(a, b) if max(a, b) > 0 else 0.0


def nearest_other(clusters: Partition, own: int, point: Point, measure: Measure) -> float:
    """b_j of Rousseeuw: mean distance to the images of the nearest other cluster."""
    return min(mean_distance(point, clusters[label], measure) for label in clusters if label != own)


def all_others(clusters: Partition, own: int, point: Point, measure: Measure) -> float:
    """b_j of the printed Eq. 13: mean distance to the images of all other clusters together."""
    others = [member for label in clusters if label != own for member in clusters[label]]
    return mean_distance(point, others, measure)


def mean_distance(point: Point, others: Sequence[Point], measure: Measure) -> float:
    return sum(measure(point, other) for other in others) / len(others)


def squared_distance(p: Point, q: Point) -> float:
    """Squared Euclidean distance."""
    return sum((a - b) ** 2 for a, b in zip(p, q, strict=True))


def mean_over_clusters(values: list[list[float]]) -> float:
    """Eq. 12: the mean over clusters of the cluster mean."""
    return sum(sum(cluster) / len(cluster) for cluster in values) / len(values)


def mean_over_images(values: list[list[float]]) -> float:
    """The mean over images, as scikit-learn's."""
    return sum(map(sum, values)) / sum(map(len, values))
