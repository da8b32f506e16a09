"""The node model, fitted from scratch, with explicit matrices and float64 everywhere."""

from __future__ import annotations

import zlib
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from sklearn.covariance import ledoit_wolf

from omnieval.mapping.roman2020.settings import Roman2020Settings

Vector = NDArray[np.float64]


@dataclass
class ReferenceNode:
    """A node: its images and what was fitted to their position descriptors at the last change."""

    id: int
    frames: list[int]
    active: bool = False
    representative: Vector = field(default_factory=lambda: np.empty(0))
    mean: Vector = field(default_factory=lambda: np.empty(0))
    inverse: Vector = field(default_factory=lambda: np.empty((0, 0)))
    mu_ns: float = 0.0
    sigma_ns: float = 0.0

    def fit(self, positions: list[Vector], config: Roman2020Settings, *, created: bool = False) -> None:
        """Refit everything from the images; `positions` holds the descriptors of every frame seen so far."""
        self.frames.sort()
        fitted, held_out = split_images(len(self.frames), self.id, config)
        fit_set = np.array([positions[self.frames[i]] for i in fitted])
        self.representative = np.mean([positions[frame] for frame in self.frames], axis=0)
        self.mean = fit_set.mean(axis=0)
        self.inverse = inverse_covariance(fit_set, config.covariance)
        if created or config.gate_refit == "insertion":
            deltas = [self.delta(positions[self.frames[i]]) for i in held_out]
            self.mu_ns = float(np.mean(deltas))
            self.sigma_ns = max(float(np.std(deltas, ddof=1)), 1e-9 * max(self.mu_ns, 1.0))

    def delta(self, position: Vector) -> float:
        """Squared Mahalanobis distance of a descriptor to the node (Eq. 3)."""
        difference = position - self.mean
        return float(difference @ self.inverse @ difference)

    def signed_ratio(self, position: Vector) -> float:
        """(Delta - mu_ns) / sigma_ns."""
        return (self.delta(position) - self.mu_ns) / self.sigma_ns


def split_images(n: int, node: int, config: Roman2020Settings) -> tuple[list[int], list[int]]:
    """Indices (into the node's images in frame order) of the fit set and of the held-out set."""
    n_fit = (8 * n) // 10
    if config.split == "chronological":
        held_out = list(range(n_fit, n))
    elif config.split == "interleaved":
        held_out = [i for i in range(n) if i % 5 == 4]
    else:
        sequence = np.random.SeedSequence(config.seed, spawn_key=(zlib.crc32(b"split"), node, n))
        permutation = np.random.default_rng(sequence).permutation(n)
        held_out = sorted(int(i) for i in permutation[n_fit:])
    return [i for i in range(n) if i not in held_out], held_out


def inverse_covariance(fit_set: Vector, kind: str) -> Vector:
    """The (pseudo-)inverse of the regularised covariance of the rows of `fit_set`, shape (d, d)."""
    d = fit_set.shape[1]
    if kind == "identity":
        return np.eye(d)
    centred = fit_set - fit_set.mean(axis=0)
    if kind == "pinv":
        # S+ = (n - 1) X+ X+^T for S = X^T X / (n - 1): twice the digits of pinv(S). The cutoff d eps is that of S.
        half = np.linalg.pinv(centred, rcond=np.sqrt(d * np.finfo(np.float64).eps))
        return (len(fit_set) - 1) * half @ half.T
    sample = centred.T @ centred / (len(fit_set) - 1)
    if kind == "diagonal":
        variances = np.diag(sample)
        return np.linalg.inv(np.diag(np.maximum(variances, max(1e-3 * variances.mean(), 1e-12))))
    if kind == "ridge":
        return np.linalg.inv(sample + max(0.1 * np.trace(sample) / d, 1e-12) * np.eye(d))
    if kind == "ledoit-wolf":
        _, shrinkage = ledoit_wolf(fit_set)
        biased = centred.T @ centred / len(fit_set)
        identity_part = max(shrinkage * np.trace(biased) / d, 1e-12)
        return np.linalg.inv((1 - shrinkage) * biased + identity_part * np.eye(d))
    raise ValueError(f"no covariance called {kind}")
