"""The distance of a position descriptor from a node: squared Mahalanobis, for every way to invert a covariance.

A node has fewer images than its descriptor has dimensions, so its covariance is singular and must be
regularised; Román et al. (doi 10.3390/app10186480) do not say how, hence the option `covariance`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from omnieval.mapping.roman2020.settings import Covariance

VARIANCE_FLOOR = 1e-12
"""Keeps identical images (no variance at all) from dividing by zero."""


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


class NodeModel(Protocol):
    """Mean and inverse covariance of a node's fit set."""

    @property
    def mean(self) -> NDArray[np.float64]:
        """Mean position descriptor, shape (d,)."""
        ...

    def delta(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Squared Mahalanobis distance Delta (Eq. 3) of points, shape (m, d); returns shape (m,)."""
        ...


@dataclass(frozen=True)
class DiagonalModel:
    """Independent dimensions: Delta = sum_i w_i (p_i - mean_i)^2."""

    mean: NDArray[np.float64]
    weights: NDArray[np.float64]

    def delta(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """See `NodeModel.delta`."""
        delta: NDArray[np.float64] = np.square(points - self.mean) @ self.weights
        return delta


@dataclass(frozen=True)
class SpectralModel:
    """Weights along the principal axes of the fit set, and one weight for all directions outside them.

    Serves every covariance of the form S + c I (ridge, Ledoit-Wolf; rest weight 1/c) and the
    pseudo-inverse (rest weight 0) without ever building a d x d matrix.
    """

    mean: NDArray[np.float64]
    axes: NDArray[np.float64]
    weights: NDArray[np.float64]
    rest: float

    def delta(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """See `NodeModel.delta`."""
        centred = points - self.mean
        along = np.square(centred @ self.axes.T)
        outside = np.maximum(np.square(centred).sum(axis=1) - along.sum(axis=1), 0.0)
        delta: NDArray[np.float64] = along @ self.weights + self.rest * outside
        return delta


def fit_model(points: NDArray[np.float64], covariance: Covariance) -> NodeModel:
    """Fit mean and covariance to position descriptors.

    Parameters
    ----------
    points
        The fit set F of a node, shape (n, d), n >= 2.
    covariance
        `diagonal`: variances (ddof 1), floored at 1e-3 of their mean. `ledoit-wolf`: shrunk to a scaled
        identity (Ledoit & Wolf 2004, doi 10.1016/S0047-259X(03)00096-4). `ridge`: plus a tenth of the mean
        variance on the diagonal. `pinv`: Moore-Penrose inverse; ignores all outside the fitted subspace.
        `identity`: Euclidean.
    """
    if covariance in {"diagonal", "identity"}:
        return diagonal_model(Moments.of(points), covariance)
    return _fit_spectral(points, points.mean(axis=0), covariance)


def diagonal_model(moments: Moments, covariance: Covariance) -> DiagonalModel:
    """Return the model of points whose moments are known; `covariance` is ``diagonal`` or ``identity``."""
    if covariance == "identity":
        return DiagonalModel(moments.mean, np.ones(len(moments.mean)))
    variances = moments.variances
    floor = max(1e-3 * float(variances.mean()), VARIANCE_FLOOR)
    return DiagonalModel(moments.mean, 1.0 / np.maximum(variances, floor))


def _fit_spectral(points: NDArray[np.float64], mean: NDArray[np.float64], covariance: Covariance) -> SpectralModel:
    count, dimensions = points.shape
    _, singular, axes = np.linalg.svd(points - mean, full_matrices=False)
    eigenvalues = np.square(singular) / (count - 1)
    if covariance == "pinv":
        # MATLAB's tolerance: what is zero in exact arithmetic must not be inverted.
        kept = eigenvalues > dimensions * np.finfo(np.float64).eps * eigenvalues[0]
        return SpectralModel(mean, axes[kept], 1.0 / eigenvalues[kept], 0.0)
    if covariance == "ledoit-wolf":
        from sklearn.covariance import ledoit_wolf_shrinkage

        shrinkage = float(ledoit_wolf_shrinkage(points))
        eigenvalues = np.square(singular) / count
        identity = max(shrinkage * float(eigenvalues.sum()) / dimensions, VARIANCE_FLOOR)
        eigenvalues = (1.0 - shrinkage) * eigenvalues
    else:
        identity = max(0.1 * float(eigenvalues.sum()) / dimensions, VARIANCE_FLOOR)
    return SpectralModel(mean, axes, 1.0 / (eigenvalues + identity), 1.0 / identity)
