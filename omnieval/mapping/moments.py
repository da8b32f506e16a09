"""Mean and scatter of points, kept up as points are added."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class Moments:
    """Immutable statistics of n points.

    Welford's updates (doi 10.1080/00401706.1962.10490022) subtract no large numbers, so that they stay as exact as
    sums from scratch.

    Attributes
    ----------
    count
        Number of points n.
    mean
        Their mean, shape (d,), float64.
    scatter
        Sum of squared deviations from it in every dimension, shape (d,), float64.
    """

    count: int
    mean: NDArray[np.float64]
    scatter: NDArray[np.float64]

    @classmethod
    def of(cls, points: NDArray[np.float64]) -> Moments:
        """Return the moments of points, shape (n, d), n >= 1."""
        mean = points.mean(axis=0)
        return cls(len(points), mean, np.square(points - mean).sum(axis=0))

    def add(self, points: NDArray[np.float64]) -> Moments:
        """Return the moments with some points more, shape (m, d)."""
        count, mean, scatter = self.count, self.mean, self.scatter
        for point in points:
            count += 1
            deviation = point - mean
            mean = mean + deviation / count
            scatter = scatter + deviation * (point - mean)
        return Moments(count, mean, scatter)

    @property
    def variances(self) -> NDArray[np.float64]:
        """Sample variances (ddof 1), shape (d,)."""
        variances: NDArray[np.float64] = self.scatter / (self.count - 1)
        return variances
