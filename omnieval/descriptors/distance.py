"""How far images are from each other: position descriptors as they are, orientation descriptors at their best roll.

Images are compared in fixed groups, `_TOGETHER` with `_TILE` others, because a processor is fast at that, and because a
distance must have the same bits whoever asks for it, and for what else at the same time.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from omnieval.descriptors.alignment import as_query, best_rolls, correlations, spectrum
from omnieval.descriptors.description import Description

_CANCELLATION = 1e-9
"""Below this share of the squared norms the closed form has lost its digits and the distance is computed directly."""

_TILE = 31
"""Others at once: odd, so that rows of pairs do not all fall on the same lines of the processor's cache."""

_TOGETHER = 8
"""Images at once: few enough to want nearly the same others, many enough to be worth a matrix product."""

_WORTH_A_THREAD = 8
"""Tiles."""


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
        self._tiles: list[_Tile] = []
        self._group: _Group | None = None
        self._rows: dict[int, _Row] = {}

    def __len__(self) -> int:
        return self._count

    def append(self, description: Description) -> int:
        """Keep a description and return its number."""
        if not (self._expected and self._tiles[self._count // _TILE].has(self._count % _TILE, description)):
            self._expected = 0
            self._put(self._count, description)
        else:
            self._expected -= 1
        self._count += 1
        return self._count - 1

    def compare(self, query: int, others: NDArray[np.int64]) -> Distances:
        """Compare an image with others, by their numbers, shape (m,)."""
        if self._group is None or query // _TOGETHER != self._group.number:
            self._rows = {}
        row = self._row(query)
        wanted = np.zeros(len(self._tiles), np.bool_)
        wanted[others // _TILE] = True
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
        tile, place = divmod(number, _TILE)
        if tile == len(self._tiles):
            self._tiles.append(_Tile.empty(len(description.position), *description.orientation.shape))
        self._tiles[tile].put(place, description)
        self._rows.pop(number, None)
        for row in self._rows.values():
            row.forget(tile)
        if self._group is not None and number // _TOGETHER == self._group.number:
            self._group = None

    def _row(self, query: int) -> _Row:
        row = self._rows.setdefault(query, _Row())
        row.reach(len(self._tiles))
        return row

    def _fill(self, query: int, tiles: Sequence[int]) -> None:
        """Compare an image with some tiles, and with it those that will be asked about after it."""
        group = self._group_of(query)
        first = group.number * _TOGETHER
        place = query - first
        last = max(number for number in range(place, _TOGETHER) if number == place or self._is_next(first + number)) + 1
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
                list(pool.map(fill, [tiles[first::threads] for first in range(threads)]))

    def _is_next(self, number: int) -> bool:
        return self._count <= number < self._count + self._expected or number in self._anticipated

    def _group_of(self, query: int) -> _Group:
        """Return the group of an image with all of its images that are known."""
        number = query // _TOGETHER
        if self._group is None or self._group.number != number:
            known = range(number * _TOGETHER, min((number + 1) * _TOGETHER, self._count + self._expected))
            self._group = _Group.of(number, [(self._tiles[one // _TILE], one % _TILE) for one in known])
        return self._group


@dataclass(frozen=True, slots=True)
class _Tile:
    """Some images, as those that others are compared with.

    Attributes
    ----------
    positions
        Shape (tile, d).
    orientations
        Shape (tile, cells, bins).
    spectra
        Shape (frequencies, 2 bins, tile).
    squares
        Squared norms of positions and of orientations, shape (2, tile).
    """

    positions: NDArray[np.float64]
    orientations: NDArray[np.float32]
    spectra: NDArray[np.float64]
    squares: NDArray[np.float64]

    @classmethod
    def empty(cls, dimensions: int, cells: int, bins: int) -> _Tile:
        return cls(
            np.zeros((_TILE, dimensions)),
            np.zeros((_TILE, cells, bins), np.float32),
            np.zeros((cells // 2 + 1, 2 * bins, _TILE)),
            np.zeros((2, _TILE)),
        )

    def put(self, place: int, description: Description) -> None:
        exact = description.orientation.astype(np.float64)
        self.positions[place] = description.position
        self.orientations[place] = description.orientation
        self.spectra[:, :, place] = spectrum(exact)
        self.squares[:, place] = np.square(self.positions[place]).sum(), np.square(exact).sum()

    def has(self, place: int, description: Description) -> bool:
        return np.array_equal(self.positions[place], description.position) and np.array_equal(
            self.orientations[place], description.orientation
        )


@dataclass(frozen=True, slots=True)
class _Group:
    """Some images, as those that are compared with others: places of images not there are zero.

    Attributes
    ----------
    number
        Which.
    positions, orientations, squares
        As in a tile.
    queries
        Shape (frequencies, 2 group, 2 bins).
    """

    number: int
    positions: NDArray[np.float64]
    orientations: NDArray[np.float32]
    squares: NDArray[np.float64]
    queries: NDArray[np.float64]

    @classmethod
    def of(cls, number: int, images: Sequence[tuple[_Tile, int]]) -> _Group:
        tile = images[0][0]
        positions = np.zeros((_TOGETHER, tile.positions.shape[1]))
        orientations = np.zeros((_TOGETHER, *tile.orientations.shape[1:]), np.float32)
        squares = np.zeros((2, _TOGETHER))
        spectra = np.zeros((*tile.spectra.shape[:2], _TOGETHER))
        for to, (tile, place) in enumerate(images):
            positions[to], orientations[to] = tile.positions[place], tile.orientations[place]
            squares[:, to], spectra[:, :, to] = tile.squares[:, place], tile.spectra[:, :, place]
        return cls(number, positions, orientations, squares, as_query(spectra))

    def compare(
        self, tile: _Tile, first: int, last: int
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]:
        """Return distances of positions and of orientations, and shifts, of some of these images from a tile's."""
        scales = self.squares[:, first:last, np.newaxis] + tile.squares[:, np.newaxis]
        cells = self.orientations.shape[1]
        best, shifts = best_rolls(correlations(self.queries, tile.spectra, cells, first, last), scales[1])

        def between_positions(one: int, other: int) -> float:
            return float(np.square(self.positions[first + one] - tile.positions[other]).sum())

        def between_orientations(one: int, other: int) -> float:
            rolled = np.roll(tile.orientations[other], int(shifts[one, other]), axis=0)
            return float(np.square(self.orientations[first + one].astype(np.float64) - rolled).sum())

        products = (self.positions @ tile.positions.T)[first:last]
        position = _distances(scales[0], products, between_positions)
        return position, _distances(scales[1], best, between_orientations), shifts


def _distances(
    scales: NDArray[np.float64], products: NDArray[np.float64], directly: Callable[[int, int], float]
) -> NDArray[np.float64]:
    """Return distances from sums of squared norms and inner products, of close pairs from their squared distance."""
    squared = scales - 2.0 * products
    close = squared <= _CANCELLATION * scales
    if close.any():
        for one, other in np.argwhere(close).tolist():
            squared[one, other] = directly(one, other)
    return np.sqrt(squared)


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
            self.position = np.append(self.position, np.empty(more * _TILE))
            self.orientation = np.append(self.orientation, np.empty(more * _TILE))
            self.shifts = np.append(self.shifts, np.empty(more * _TILE, np.int64))

    def put(
        self,
        tile: int,
        position: NDArray[np.float64],
        orientation: NDArray[np.float64],
        shifts: NDArray[np.int64],
    ) -> None:
        place = slice(tile * _TILE, (tile + 1) * _TILE)
        self.position[place] = position
        self.orientation[place] = orientation
        self.shifts[place] = shifts
        self.known[tile] = True

    def forget(self, tile: int) -> None:
        """Drop what is known of a tile, which has got another image."""
        if tile < len(self.known):
            self.known[tile] = False
