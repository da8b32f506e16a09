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

WORTH_A_THREAD = 8
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

    Double precision, because the closed form subtracts nearly equal numbers: 49 kB per image of 256 cells x 16 bins.
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
        self._all = _Others()
        self._group: Group | None = None

    def __len__(self) -> int:
        return self._count

    def append(self, description: Description) -> int:
        """Keep a description and return its number."""
        if not (self._expected and self._all.tiles[self._count // TILE].has(self._count % TILE, description)):
            self._expected = 0
            self._put(self._count, description)
        else:
            self._expected -= 1
        self._count += 1
        return self._count - 1

    def compare(self, query: int, others: NDArray[np.int64]) -> Distances:
        """Compare an image with others, by their numbers, shape (m,)."""
        wanted = np.zeros(len(self._all.tiles), np.bool_)
        wanted[others // TILE] = True
        row = self._row(query, self._all, wanted)
        return Distances(row.position[others], row.orientation[others], row.shifts[others])

    def position_distances(self, query: int, others: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return Euclidean distances of position descriptors, shape (m,)."""
        return self.compare(query, others).position

    def compare_selected(self, query: int, selection: Selection) -> Distances:
        """Compare an image with all of a selection, in its order, shape (m,)."""
        others, count = selection.others, len(selection)
        group = self._group_of(query)
        if selection.group is not group:  # another group, or one of its images has changed
            others.rows, selection.group = {}, group
        row = self._row(query, others, np.ones(len(others.tiles), np.bool_))
        return Distances(row.position[:count], row.orientation[:count], row.shifts[:count])

    def select(self, number: int, selection: Selection) -> None:
        """Add an image to a selection."""
        tile, place = divmod(number, TILE)
        selection.add(self._all.tiles[tile], place)

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
        self._all.tile_for(number, description).put(number % TILE, description)
        self._all.rows.pop(number, None)
        if self._group is not None and number // TOGETHER == self._group.number:
            self._group = None

    def _row(self, query: int, others: _Others, wanted: NDArray[np.bool_]) -> _Row:
        """Return the distances of an image from others, of which some tiles are wanted."""
        group = self._group_of(query)
        row = others.row(query)
        missing = np.flatnonzero(wanted & ~row.known)
        if len(missing):
            self._fill(group, query, others, missing.tolist())
        return row

    def _fill(self, group: Group, query: int, others: _Others, tiles: Sequence[int]) -> None:
        """Compare an image with some tiles, and with it those that will be asked about after it."""
        first = group.number * TOGETHER
        place = query - first
        last = max(number for number in range(place, TOGETHER) if number == place or self._is_next(first + number)) + 1
        rows = [others.row(first + number) for number in range(place, last)]

        def fill(some: Sequence[int]) -> None:
            for number in some:
                compared = group.compare(others.tiles[number], place, last)
                for row, position, orientation, shifts in zip(rows, *compared, strict=True):
                    row.put(number, position, orientation, shifts)

        threads = min(self._threads, len(tiles) // WORTH_A_THREAD)
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
            self._all.rows = {}
            self._group = Group.of(number, [(self._all.tiles[one // TILE], one % TILE) for one in known])
        return self._group


class Selection:
    """Some images of a store, in the order in which they were selected, laid together so that few tiles hold them."""

    def __init__(self) -> None:
        self.others = _Others()
        self.group: Group | None = None
        self._count = 0

    def __len__(self) -> int:
        return self._count

    def add(self, tile: Tile, place: int) -> None:
        """Add the image at a place of a tile."""
        self.others.tile_like(tile, self._count).take(self._count % TILE, tile, place)
        self._count += 1

    def copied(self) -> Selection:
        """Return an independent copy; full tiles, which never change again, are shared."""
        other = Selection()
        other._count = self._count
        other.others.tiles = self.others.tiles.copy()
        if self._count % TILE:
            other.others.tiles[-1] = self.others.tiles[-1].copied()
        return other


class _Others:
    """Tiles of images to compare with, and what is known of their distances from the images last asked for."""

    def __init__(self) -> None:
        self.tiles: list[Tile] = []
        self.rows: dict[int, _Row] = {}

    def row(self, query: int) -> _Row:
        row = self.rows.setdefault(query, _Row())
        row.reach(len(self.tiles))
        return row

    def tile_for(self, number: int, description: Description) -> Tile:
        """Return the tile that an image with such a description is put into next."""
        if number // TILE == len(self.tiles):
            self.tiles.append(Tile.empty(len(description.position), *description.orientation.shape))
        return self._changing(number // TILE)

    def tile_like(self, tile: Tile, number: int) -> Tile:
        """Return the tile that an image of another tile is put into next."""
        if number // TILE == len(self.tiles):
            self.tiles.append(Tile.empty(tile.positions.shape[1], *tile.orientations.shape[1:]))
        return self._changing(number // TILE)

    def _changing(self, tile: int) -> Tile:
        for row in self.rows.values():
            row.forget(tile)
        return self.tiles[tile]


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
