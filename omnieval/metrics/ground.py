"""What is true of a sequence whatever the map: where and when its images were taken, and what follows from that.

It is computed once for all maps of a sequence. Memory grows with the number of images, not with that of their pairs:
these are looked at in blocks.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import connected_components, dijkstra
from scipy.spatial import cKDTree

THETAS = (0.5, 1.0, 2.0, 3.0)
"""The distances within which two images are taken at one place, metres."""
ROUNDING_M = 1e-9
"""What a distance may exceed its limit by: positions are rounded, and 20 times 0.1 m is within 2 m."""
NO_LENGTH_M = 1e-15
"""How long a link between images at one position is: of a sparse graph, what is 0 is not a link."""
APART_S = 10.0
"""Images so near in time (W) are near in space because the robot has hardly moved."""
STEP_M = 0.5
"""Images so near are linked in the true graph, as successive ones are."""
_PER_SECOND_UNTIMED = 5
"""Images a second where no times are known: 10 s are 50 images."""
_BLOCK_PAIRS = 1_000_000
_MOST_LINKS = 100
"""Of an image in the true graph, on average, before images that are nearly at one place become one."""
_SQUARE_M = 0.1
_KEPT_BYTES = 64_000_000
"""Of the distances along the true graph that are kept for the next map."""


@dataclass(frozen=True)
class Clock:
    """When the images were taken.

    Attributes
    ----------
    stamps
        Time of each image, shape (n,), not decreasing.
    second
        How much of that is a second.
    """

    stamps: NDArray[np.int64]
    second: int

    @classmethod
    def of(cls, times: Sequence[int | None] | None, images: int) -> Clock:
        """Return the clock of images taken at these nanoseconds.

        Without a time of every image, or where they run backwards (several drives as one), an image is a fifth of a
        second.
        """
        if times is not None and None not in times:
            stamps = np.array(times, np.int64)
            if (np.diff(stamps) >= 0).all():
                return cls(stamps, 10**9)
        return cls(np.arange(images, dtype=np.int64), _PER_SECOND_UNTIMED)

    def span(self, seconds: float) -> int:
        """Return this many seconds in the unit of the stamps."""
        return round(seconds * self.second)

    def of_images(self, images: NDArray[np.int64]) -> Clock:
        """Return the clock of some of the images, in their order."""
        return Clock(self.stamps[images], self.second)


@dataclass(frozen=True)
class Near:
    """Pairs of images within a distance of each other, more than W apart in time.

    Attributes
    ----------
    pairs
        How many.
    known
        Whether an image lies within the distance of an earlier one, shape (m,).
    groups
        What such pairs link together, one after another: the group of each image, shape (m,), from 0. An image that is
        in no pair is a group of its own.
    """

    pairs: int
    known: NDArray[np.bool_]
    groups: NDArray[np.int64]


class Ground:
    """The true positions of a sequence, and its times.

    Parameters
    ----------
    positions
        Capture positions, shape (n, 2), metres; NaN where they are not known.
    times
        Nanoseconds of each image, length n, None where unknown; None if all are.

    Attributes
    ----------
    images
        The m images whose position is known, ascending, shape (m,).
    positions
        Theirs, shape (m, 2).
    clock
        Theirs.
    """

    def __init__(self, positions: NDArray[np.float64], times: Sequence[int | None] | None = None) -> None:
        self.images: NDArray[np.int64] = np.flatnonzero(np.isfinite(positions).all(axis=1))
        self.positions = np.ascontiguousarray(positions[self.images], np.float64)
        self.clock = Clock.of(times, len(positions)).of_images(self.images)
        self._near: dict[float, Near] = {}
        self._rows: OrderedDict[int, NDArray[np.float64]] = OrderedDict()

    def __len__(self) -> int:
        return len(self.images)

    @property
    def apart(self) -> int:
        """W, in the unit of the clock."""
        return self.clock.span(APART_S)

    @cached_property
    def tree(self) -> cKDTree:
        """The positions, to be searched."""
        return cKDTree(self.positions)

    def near(self, thetas: Sequence[float]) -> dict[float, Near]:
        """Return the pairs within each of some distances (metres)."""
        if missing := [theta for theta in thetas if theta not in self._near]:
            self._near |= self._found(missing)
        return {theta: self._near[theta] for theta in thetas}

    def distances(self, images: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return the lengths of the shortest ways through the true graph between some of the m images, (k, k), metres.

        Its vertices are the images; linked are successive ones, and those within `STEP_M` of each other. Where images
        lie so close that they have more than `_MOST_LINKS` such neighbours each, those in a square of `_SQUARE_M` are
        one vertex.
        """
        vertices = self._vertices[images]
        found: dict[int, NDArray[np.float64]] = {}
        for vertex in dict.fromkeys(vertices.tolist()):
            if vertex in self._rows:
                self._rows.move_to_end(vertex)
            else:
                self._rows[vertex] = dijkstra(self._graph, indices=vertex)
            found[vertex] = self._rows[vertex][vertices]
            if len(self._rows) > max(1, _KEPT_BYTES // self._rows[vertex].nbytes):
                self._rows.popitem(last=False)
        return np.array([found[vertex] for vertex in vertices.tolist()]).reshape(len(images), len(images))

    @cached_property
    def _vertices(self) -> NDArray[np.int64]:
        """The vertex of the true graph that each image is, shape (m,), numbered by their first images."""
        if self.tree.count_neighbors(self.tree, STEP_M) <= (_MOST_LINKS + 1) * len(self):
            return np.arange(len(self))
        squares = np.floor(self.positions / _SQUARE_M)
        _, first, codes = np.unique(squares, axis=0, return_index=True, return_inverse=True)
        codes = codes.ravel()  # NumPy 2.0.0 returns a column
        ranks = np.argsort(np.argsort(first))
        return np.asarray(ranks[codes], np.int64)

    @cached_property
    def _graph(self) -> csr_array:
        places = self.positions[np.unique(self._vertices, return_index=True)[1]]
        count = len(places)
        near = cKDTree(places).query_pairs(STEP_M + ROUNDING_M, output_type="ndarray")
        successive = np.sort(np.stack([self._vertices[:-1], self._vertices[1:]], axis=1), axis=1)
        successive = successive[successive[:, 0] < successive[:, 1]]
        one, other = np.divmod(np.unique(np.concatenate([near, successive]) @ np.array([count, 1])), count)
        lengths = np.maximum(np.hypot(*(places[one] - places[other]).T), NO_LENGTH_M)
        ends = one.astype(np.int32), other.astype(np.int32)  # all that older SciPy takes
        half = csr_array((lengths, ends), shape=(count, count))
        return half + half.T

    def _found(self, thetas: Sequence[float]) -> dict[float, Near]:
        counts = dict.fromkeys(thetas, 0)
        known = {theta: np.zeros(len(self), np.bool_) for theta in thetas}
        groups = {theta: np.arange(len(self)) for theta in thetas}
        stamps = self.clock.stamps
        for pairs in self._pairs(max(thetas) + ROUNDING_M):
            left = pairs[stamps[pairs["i"]] - stamps[pairs["j"]] > self.apart]
            for theta in sorted(thetas, reverse=True):
                left = left[left["v"] <= theta + ROUNDING_M]
                counts[theta] += len(left)
                known[theta][left["i"]] = True
                groups[theta] = _joined(groups[theta], left["i"], left["j"])
        return {theta: Near(counts[theta], known[theta], groups[theta]) for theta in thetas}

    def _pairs(self, radius: float) -> Iterator[NDArray[Any]]:
        """Yield all ordered pairs of images within a radius, in blocks: fields i, j, and v, their distance."""
        if not len(self):
            return
        sizes = np.cumsum(self.tree.query_ball_point(self.positions, radius, return_length=True))
        cuts = np.searchsorted(sizes, np.arange(0, int(sizes[-1]), _BLOCK_PAIRS))
        for block in np.split(np.arange(len(self)), np.unique(cuts[cuts > 0])):
            if len(block):
                pairs = cKDTree(self.positions[block]).sparse_distance_matrix(self.tree, radius, output_type="ndarray")
                pairs["i"] += block[0]
                yield pairs


def _joined(groups: NDArray[np.int64], one: NDArray[np.int64], other: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the groups of images when some pairs of these are linked as well."""
    count = int(groups.max()) + 1
    links = coo_array((np.ones(len(one), np.bool_), (groups[one], groups[other])), shape=(count, count))
    merged: NDArray[np.int64] = connected_components(links, directed=False)[1].astype(np.int64)
    return merged[groups]
