"""The active nodes side by side, so that an image is held against all of them at once."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from omnieval.mapping.model import DiagonalModel
from omnieval.mapping.node import Node


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
