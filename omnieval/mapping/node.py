"""A node of the map: its images, the model fitted to them, and the statistics its gate compares with."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from omnieval.mapping.config import MapperConfig, Split
from omnieval.mapping.model import NodeModel, fit_model
from omnieval.seeding import named_generator


@dataclass(frozen=True, slots=True)
class GateStatistics:
    """Mean mu_ns and standard deviation sigma_ns of Delta over a node's held-out images."""

    mean: float
    std: float

    def ratio(self, delta: float) -> float:
        """Return (Delta - mu_ns) / sigma_ns, signed."""
        return (delta - self.mean) / self.std


@dataclass(frozen=True)
class Node:
    """A place: some images of the map, immutable; it grows by being fitted again.

    Attributes
    ----------
    id
        Number of the node, from 1 in the order of creation.
    frames
        Its images in the order they were taken, shape (n,), int64.
    model
        Mean and covariance of the fit set.
    gate
        Statistics of the held-out images.
    representative
        Mean position descriptor over all its images, shape (d,), float64.
    """

    id: int
    frames: NDArray[np.int64]
    model: NodeModel
    gate: GateStatistics
    representative: NDArray[np.float64]

    def ratio(self, position: NDArray[np.float64]) -> float:
        """Return the signed gate ratio (Delta - mu_ns) / sigma_ns of a position descriptor, shape (d,)."""
        return self.gate.ratio(float(self.model.delta(position[np.newaxis])[0]))


def fit_node(
    node_id: int,
    frames: NDArray[np.int64],
    positions: NDArray[np.float64],
    config: MapperConfig,
    *,
    gate: GateStatistics | None = None,
) -> Node:
    """Fit a node to its images (section 4.1 of the paper).

    Parameters
    ----------
    node_id
        Number of the node.
    frames
        Its images, ascending, shape (n,).
    positions
        Position descriptors of these images, shape (n, d).
    config
        `covariance`, `split` and `seed` are read.
    gate
        Statistics to keep instead of fitting them (`gate_refit` = creation).
    """
    fit, held_out = split_images(len(frames), config.split, seed=config.seed, node_id=node_id)
    model = fit_model(positions[fit], config.covariance)
    if gate is None:
        gate = _gate_statistics(model.delta(positions[held_out]))
    return Node(node_id, frames, model, gate, positions.mean(axis=0))


def split_images(count: int, split: Split, *, seed: int, node_id: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the indices of the fit set (80 %) and of the held-out set (20 %) of `count` images, both ascending."""
    order = np.arange(count)
    fitted = (4 * count) // 5
    if split == "interleaved":
        held_out = order % 5 == 4
        return order[~held_out], order[held_out]
    if split == "random":
        order = named_generator(seed, "split", node_id, count).permutation(count)
    return np.sort(order[:fitted]), np.sort(order[fitted:])


def _gate_statistics(deltas: NDArray[np.float64]) -> GateStatistics:
    mean = float(deltas.mean())
    return GateStatistics(mean, max(float(deltas.std(ddof=1)), 1e-9 * max(mean, 1.0)))
