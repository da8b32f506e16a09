"""How far images are from each other: position descriptors as they are, orientation descriptors at their best roll.

What is asked for is computed a few images and many others at a time (`tiles`), and remembered for a while.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from omnieval.descriptors.description import Description
from omnieval.descriptors.tiles import TILE, TOGETHER, Group, Tile

_WORTH_A_THREAD = 8
"""Tiles that a thread is given at least."""


@dataclass(frozen=True, slots=True)
class Distances:
    """An image compared with m others.

    Attributes
    ----------
    position
        Euclidean distances of the position descriptors, shape (m,), float64.
    orientation
        Shift-invariant distances of the orientation descriptors, shape (m,), float64.
    shifts
        The roll s of each of the others that aligns it with the image, in cells, shape (m,), the smallest of
        equally good ones.
    """

    position: NDArray[np.float64]
    orientation: NDArray[np.float64]
    shifts: NDArray[np.int64]


class DescriptionStore:
    """Descriptions that can be compared with each other; grows by whole tiles.

    Double precision, because the closed form subtracts nearly equal numbers: 49 kB an image of 256 cells x 16 bins.
    What was computed of the images last asked for is remembered, so that several who ask pay once.

    Parameters
    ----------
    threads
        To compare with, where an image is compared with many.
    """

    def __init__(self, threads: int = 1) -> None:
        self._threads = threads
        self._count = 0
        self._expected = 0
        self._anticipated: frozenset[int] = frozenset()
        self._tiles: list[Tile] = []
        self._group: Group | None = None
        self._rows: dict[int, _Row] = {}

    def __len__(self) -> int:
        return self._count

    def append(self, description: Description) -> int:
        """Keep a description and return its number."""
        if not (self._expected and self._tiles[self._count // TILE].has(self._count % TILE, description)):
            self._expected = 0
            self._put(self._count, description)
        else:
            self._expected -= 1
        self._count += 1
        return self._count - 1

    def compare(self, query: int, others: NDArray[np.int64]) -> Distances:
        """Compare an image with others, by their numbers, shape (m,)."""
        if self._group is None or query // TOGETHER != self._group.number:
            self._rows = {}
        row = self._row(query)
        wanted = np.zeros(len(self._tiles), np.bool_)
        wanted[others // TILE] = True
        missing = np.flatnonzero(wanted & ~row.known)
        if len(missing):
            self._fill(query, missing.tolist())
        return Distances(row.position[others], row.orientation[others], row.shifts[others])

    def expect(self, descriptions: Sequence[Description]) -> None:
        """Get to know the descriptions that come next, which are then compared together.

        A hint: what `compare` returns does not depend on it.
        """
        for place, description in enumerate(descriptions):
            self._put(self._count + place, description)
        self._expected = len(descriptions)

    def anticipate(self, queries: Iterable[int]) -> None:
        """Get to know which images are compared next, which are then compared together.

        A hint: what `compare` returns does not depend on it.
        """
        self._anticipated = frozenset(queries)

    def _put(self, number: int, description: Description) -> None:
        tile, place = divmod(number, TILE)
        if tile == len(self._tiles):
            self._tiles.append(Tile.empty(len(description.position), *description.orientation.shape))
        self._tiles[tile].put(place, description)
        self._rows.pop(number, None)
        for row in self._rows.values():
            row.forget(tile)
        if self._group is not None and number // TOGETHER == self._group.number:
            self._group = None

    def _row(self, query: int) -> _Row:
        row = self._rows.setdefault(query, _Row())
        row.reach(len(self._tiles))
        return row

    def _fill(self, query: int, tiles: Sequence[int]) -> None:
        """Compare an image with some tiles, and with it those that will be asked about after it."""
        group = self._group_of(query)
        first = group.number * TOGETHER
        place = query - first
        last = max(number for number in range(place, TOGETHER) if number == place or self._is_next(first + number)) + 1
        rows = [self._row(first + number) for number in range(place, last)]

        def fill(some: Sequence[int]) -> None:
            for number in some:
                compared = group.compare(self._tiles[number], place, last)
                for row, position, orientation, shifts in zip(rows, *compared, strict=True):
                    row.put(number, position, orientation, shifts)

        threads = min(self._threads, len(tiles) // _WORTH_A_THREAD)
        if threads < 2:
            fill(tiles)
        else:
            with ThreadPoolExecutor(threads) as pool:
                list(pool.map(fill, [tiles[number::threads] for number in range(threads)]))

    def _is_next(self, number: int) -> bool:
        return self._count <= number < self._count + self._expected or number in self._anticipated

    def _group_of(self, query: int) -> Group:
        """Return the group of an image with all of its images that are known."""
        number = query // TOGETHER
        if self._group is None or self._group.number != number:
            known = range(number * TOGETHER, min((number + 1) * TOGETHER, self._count + self._expected))
            self._group = Group.of(number, [(self._tiles[one // TILE], one % TILE) for one in known])
        return self._group


class _Row:
    """Distances of one image from those of all tiles, as far as they are known."""

    def __init__(self) -> None:
        self.position = np.empty(0)
        self.orientation = np.empty(0)
        self.shifts = np.empty(0, np.int64)
        self.known = np.empty(0, np.bool_)

    def reach(self, tiles: int) -> None:
        """Make room for some tiles in all."""
        more = tiles - len(self.known)
        if more > 0:
            self.known = np.append(self.known, np.zeros(more, np.bool_))
            self.position = np.append(self.position, np.empty(more * TILE))
            self.orientation = np.append(self.orientation, np.empty(more * TILE))
            self.shifts = np.append(self.shifts, np.empty(more * TILE, np.int64))

    def put(
        self,
        tile: int,
        position: NDArray[np.float64],
        orientation: NDArray[np.float64],
        shifts: NDArray[np.int64],
    ) -> None:
        place = slice(tile * TILE, (tile + 1) * TILE)
        self.position[place] = position
        self.orientation[place] = orientation
        self.shifts[place] = shifts
        self.known[tile] = True

    def forget(self, tile: int) -> None:
        """Drop what is known of a tile, which has got another image."""
        if tile < len(self.known):
            self.known[tile] = False
