"""A node of the map: its images, the model fitted to them, and the statistics its gate compares with."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from omnieval.mapping.roman2020.model import DiagonalModel, Moments, NodeModel, diagonal_model, fit_model
from omnieval.mapping.roman2020.settings import Roman2020Settings, Split
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
    """A place: some images of the map, immutable; it grows by being replaced.

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
    squared_radii
        Squared distances of its images from the representative, shape (n,), float64.
    moments
        Of the fit set, where the model can be kept up with them; else None.
    """

    id: int
    frames: NDArray[np.int64]
    model: NodeModel
    gate: GateStatistics
    representative: NDArray[np.float64]
    squared_radii: NDArray[np.float64]
    moments: Moments | None

    def ratio(self, position: NDArray[np.float64]) -> float:
        """Return the signed gate ratio (Delta - mu_ns) / sigma_ns of a position descriptor, shape (d,)."""
        return self.gate.ratio(float(self.model.delta(position[np.newaxis])[0]))


def fit_node(
    node_id: int,
    frames: NDArray[np.int64],
    positions: NDArray[np.float64],
    config: Roman2020Settings,
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
    moments = Moments.of(positions[fit]) if _keeps_up(config) else None
    model = diagonal_model(moments, config.covariance) if moments else fit_model(positions[fit], config.covariance)
    representative = positions.mean(axis=0)
    return Node(
        node_id,
        frames,
        model,
        gate or _gate_statistics(model.delta(positions[held_out])),
        representative,
        np.square(positions - representative).sum(axis=1),
        moments,
    )


def grow_node(
    node: Node,
    frame: int,
    positions: Callable[[NDArray[np.int64]], NDArray[np.float64]],
    config: Roman2020Settings,
    *,
    squared_distances: NDArray[np.float64] | None = None,
) -> Node:
    """Return the node with one image more, the newest; what `fit_node` makes of its images, without starting again.

    Parameters
    ----------
    node
        A node fitted with the same configuration.
    frame
        Number of the image.
    positions
        Gives the position descriptors of images, shape (m, d), by their numbers, shape (m,).
    config
        `covariance`, `split`, `seed` and `gate_refit` are read.
    squared_distances
        Squared distances of the image's position descriptor from those of the node's images, shape (n,), if known.
    """
    kept = node.gate if config.gate_refit == "creation" else None
    frames = np.append(node.frames, frame)
    if node.moments is None or squared_distances is None:
        return fit_node(node.id, frames, positions(frames), config, gate=kept)
    # Fit sets only grow at their end when the split is not random.
    fit, held_out = split_images(len(frames), config.split, seed=config.seed, node_id=node.id)
    if len(fit) > node.moments.count:
        moments = node.moments.add(positions(frames[fit[node.moments.count :]]))
        model: NodeModel = diagonal_model(moments, config.covariance)
    else:
        moments, model = node.moments, node.model
    deviation = positions(frames[-1:])[0] - node.representative
    return Node(
        node.id,
        frames,
        model,
        kept or _gate_statistics(model.delta(positions(frames[held_out]))),
        node.representative + deviation / len(frames),
        _grown_radii(node.squared_radii, squared_distances, float(deviation @ deviation)),
        moments,
    )


def _keeps_up(config: Roman2020Settings) -> bool:
    """Whether the model of a grown node follows from that of the node."""
    return config.covariance in {"diagonal", "identity"} and config.split != "random"


def _grown_radii(radii: NDArray[np.float64], distances: NDArray[np.float64], deviation: float) -> NDArray[np.float64]:
    """Return squared distances from the mean of n + 1 points.

    ||p_j - mean||^2 is the mean squared distance of p_j from all points less half the mean over all pairs. The sums
    over the n old points follow from their own squared radii.

    Parameters
    ----------
    radii
        Squared distances of the n old points from their mean, shape (n,).
    distances
        Squared distances of the new point from the old ones, shape (n,).
    deviation
        Squared distance of the new point from the old points' mean.
    """
    count = len(radii)
    total = float(radii.sum())
    grown = np.empty(count + 1)
    grown[:-1] = (count * radii + total + distances) / (count + 1)
    grown[:-1] -= (count * total + float(distances.sum())) / (count + 1) ** 2
    grown[-1] = deviation * (count / (count + 1)) ** 2
    return np.maximum(grown, 0.0)


def split_images(count: int, split: Split, *, seed: int, node_id: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the indices of the fit set (80 %) and of the held-out set (20 %) of `count` images, both ascending."""
    order = np.arange(count)
    fitted = (4 * count) // 5
    if split == "chronological":
        return order[:fitted], order[fitted:]
    if split == "interleaved":
        held_out = order % 5 == 4
        return order[~held_out], order[held_out]
    order = named_generator(seed, "split", node_id, count).permutation(count)
    return np.sort(order[:fitted]), np.sort(order[fitted:])


def _gate_statistics(deltas: NDArray[np.float64]) -> GateStatistics:
    mean = float(deltas.mean())
    deviations = deltas - mean
    std = math.sqrt(float(deviations @ deviations) / (len(deltas) - 1))
    return GateStatistics(mean, max(std, 1e-9 * max(mean, 1.0)))


class NodeBank:
    """Some nodes in the order of their ids; immutable.

    Parameters
    ----------
    nodes
        C nodes, their models of one kind.
    """

    def __init__(self, nodes: Sequence[Node]) -> None:
        self._nodes = tuple(sorted(nodes, key=lambda node: node.id))
        self.ids = np.array([node.id for node in self._nodes], np.int64)
        self._means = np.array([node.gate.mean for node in self._nodes])
        self._stds = np.array([node.gate.std for node in self._nodes])
        self._models = _stack(self._nodes)

    def replacing(self, node: Node) -> NodeBank:
        """Return the bank with one of its nodes in a new state."""
        index = int(self.ids.searchsorted(node.id))
        bank = NodeBank.__new__(NodeBank)
        bank.ids = self.ids
        bank._nodes = (*self._nodes[:index], node, *self._nodes[index + 1 :])
        bank._means, bank._stds = self._means.copy(), self._stds.copy()
        bank._means[index], bank._stds[index] = node.gate.mean, node.gate.std
        bank._models = self._models
        if self._models is not None and isinstance(node.model, DiagonalModel):
            centres, weights = self._models[0].copy(), self._models[1].copy()
            centres[index], weights[index] = node.model.mean, node.model.weights
            bank._models = centres, weights
        return bank

    def ratios(self, position: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the signed gate ratios (Delta - mu_ns) / sigma_ns of a position descriptor, shape (C,)."""
        if self._models is None:
            return np.array([node.ratio(position) for node in self._nodes])
        centres, weights = self._models
        deltas = (np.square(position - centres) * weights).sum(axis=1)
        ratios: NDArray[np.float64] = (deltas - self._means) / self._stds
        return ratios


def _stack(nodes: Sequence[Node]) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
    """Return the means and weights of diagonal models, shapes (C, d); None for models of another kind."""
    models = [node.model for node in nodes if isinstance(node.model, DiagonalModel)]
    if not models or len(models) < len(nodes):
        return None
    return np.stack([model.mean for model in models]), np.stack([model.weights for model in models])
