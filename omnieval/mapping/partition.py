"""The map so far, replayed from Steps: which node every image is in, and how nodes follow each other."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from omnieval.mapping.step import EventKind, NodeEvent, Step


class Partition:
    """Labels of the images, kept up to date by applying Steps in their order.

    Nothing is decided here: from the Steps of a replay, live or read back from its table, one gets the same
    labels as the mapper had.
    """

    def __init__(self) -> None:
        self._labels = np.zeros(64, np.int64)
        self._count = 0
        self._nodes: set[int] = set()
        self._active: set[int] = set()

    def apply(self, step: Step) -> None:
        """Take in the next step.

        Raises
        ------
        ValueError
            If the step is not the one that follows the last.
        """
        if step.frame != self._count:
            raise ValueError(f"steps come in order: expected frame {self._count}, got {step.frame}")
        if self._count == len(self._labels):
            self._labels = np.concatenate([self._labels, np.zeros_like(self._labels)])
        self._labels[step.frame] = step.node or 0
        self._count += 1
        for event in step.events:
            self._relabel(event)

    @property
    def labels(self) -> NDArray[np.int64]:
        """Node of every image so far, shape (n,), 0 where unassigned. A copy."""
        return self._labels[: self._count].copy()

    @property
    def active(self) -> frozenset[int]:
        """The active nodes: those a loop closure can elect."""
        return frozenset(self._active)

    @property
    def count(self) -> int:
        """Number of nodes, active and pending."""
        return len(self._nodes)

    @property
    def unassigned(self) -> float:
        """Share of the images so far that belong to no node, 0..1."""
        return float((self._labels[: self._count] == 0).mean()) if self._count else 0.0

    def transitions(self) -> dict[tuple[int, int], int]:
        """Return how often consecutive images lie in different nodes; see `count_transitions`."""
        return count_transitions(self._labels[: self._count])

    def _relabel(self, event: NodeEvent) -> None:
        if event.kind is EventKind.CREATED:
            self._labels[list(event.frames)] = event.node
            self._nodes.add(event.node)
        elif event.kind is EventKind.MERGED:
            labels = self._labels[: self._count]
            labels[labels == event.node] = event.into or 0
            self._active.discard(event.node)
            self._nodes.discard(event.node)
        else:
            self._active.add(event.node)


def count_transitions(labels: NDArray[np.int64]) -> dict[tuple[int, int], int]:
    """Return the edges of the topological map: pairs of nodes that consecutive images pass between.

    Parameters
    ----------
    labels
        Node of every image in the order of capture, shape (n,), 0 where unassigned. Unassigned images are
        passed over: consecutive are two assigned images with none assigned between them.

    Returns
    -------
    dict
        (lower node, higher node) -> number of passages in either direction, keys ascending.
    """
    assigned = labels[labels > 0]
    passages = np.flatnonzero(assigned[:-1] != assigned[1:])
    pairs = np.sort(np.stack([assigned[passages], assigned[passages + 1]], axis=1), axis=1)
    edges, counts = np.unique(pairs, axis=0, return_counts=True)
    return {(int(a), int(b)): int(count) for (a, b), count in zip(edges, counts, strict=True)}
