"""Keyframes, and the ways between those that the robot went between."""

from __future__ import annotations

import heapq
from collections.abc import Iterator
from copy import copy
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from omnieval.mapping.geodesic.motion import Motion


@dataclass(frozen=True, slots=True)
class Way:
    """From one keyframe to another: how long, and where the other is seen from the one."""

    length: float
    motion: Motion


class KeyframeGraph:
    """A graph with a way for every edge, which can be gone both ways; vertices are numbered from 0."""

    def __init__(self) -> None:
        self._edges: list[dict[int, Way]] = []
        self._flat: tuple[NDArray[np.int64], NDArray[np.int64]] | None = None

    def __len__(self) -> int:
        return len(self._edges)

    def add(self) -> int:
        """Add a vertex and return its number."""
        self._edges.append({})
        self._flat = None
        return len(self._edges) - 1

    def join(self, one: int, other: int, way: Way) -> None:
        """Join two vertices; of several ways between them the shortest length holds, and the first motion."""
        known = self._edges[one].get(other)
        if one == other or (known is not None and known.length <= way.length):
            return
        if known is None:
            self._flat = None
        motion = way.motion if known is None else known.motion
        self._edges[one][other] = Way(way.length, motion)
        self._edges[other][one] = Way(way.length, motion.back)

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
        """Return the vertices within `reach` of one, nearest first, with the length of the shortest way."""
        return {one: length for length, one, _ in self._nearest_first(start, reach)}

    def seen_from(self, start: int, reach: float) -> dict[int, Motion]:
        """Return the vertices within `reach` of one, nearest first, and where each is, along the shortest way."""
        found: dict[int, Motion] = {}
        for _, one, before in self._nearest_first(start, reach):
            found[one] = Motion() if before < 0 else found[before].then(self._edges[before][one].motion)
        return found

    def copied(self) -> Self:
        """Return an independent copy."""
        other = copy(self)
        other._edges = [edges.copy() for edges in self._edges]
        return other

    def _nearest_first(self, start: int, reach: float) -> Iterator[tuple[float, int, int]]:
        """Yield length of the shortest way, vertex, and the one before it on that way (Dijkstra); -1 for none."""
        found: set[int] = set()
        waiting = [(0.0, start, -1)]
        while waiting:
            length, one, before = heapq.heappop(waiting)
            if one in found:
                continue
            found.add(one)
            yield length, one, before
            for other, way in self._edges[one].items():
                if other not in found and length + way.length <= reach:
                    heapq.heappush(waiting, (length + way.length, other, one))
