"""Keyframes, and the travel between those that the robot went between."""

from __future__ import annotations

import heapq
from copy import copy
from typing import Self

import numpy as np
from numpy.typing import NDArray


class KeyframeGraph:
    """An undirected graph with a length for every edge; vertices are numbered from 0."""

    def __init__(self) -> None:
        self._edges: list[dict[int, float]] = []
        self._flat: tuple[NDArray[np.int64], NDArray[np.int64]] | None = None

    def __len__(self) -> int:
        return len(self._edges)

    def add(self) -> int:
        """Add a vertex and return its number."""
        self._edges.append({})
        self._flat = None
        return len(self._edges) - 1

    def join(self, one: int, other: int, length: float) -> None:
        """Join two vertices; of several lengths between them the shortest holds."""
        if one == other or self._edges[one].get(other, np.inf) <= length:
            return
        if other not in self._edges[one]:
            self._flat = None
        self._edges[one][other] = self._edges[other][one] = length

    @property
    def edges(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Both ends of every edge, each edge in both directions, shape (2 edges,) each."""
        if self._flat is None:
            counts = [len(edges) for edges in self._edges]
            sources = np.repeat(np.arange(len(counts)), counts)
            targets = np.fromiter((other for edges in self._edges for other in edges), np.int64, sum(counts))
            self._flat = sources, targets
        return self._flat

    def within(self, start: int, reach: float) -> dict[int, float]:
        """Return the vertices within `reach` of one, nearest first, with the length of the shortest way (Dijkstra)."""
        found: dict[int, float] = {}
        waiting = [(0.0, start)]
        while waiting:
            length, one = heapq.heappop(waiting)
            if one in found:
                continue
            found[one] = length
            for other, more in self._edges[one].items():
                if other not in found and length + more <= reach:
                    heapq.heappush(waiting, (length + more, other))
        return found

    def copied(self) -> Self:
        """Return one that goes on by itself."""
        other = copy(self)
        other._edges = [edges.copy() for edges in self._edges]
        return other
