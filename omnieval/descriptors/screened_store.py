"""Descriptions that are compared in single precision first (`screening`), and exactly where somebody asks.

What it says exactly is, to the bit, what a `DescriptionStore` says.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from omnieval.descriptors.description import Description
from omnieval.descriptors.distance import WORTH_A_THREAD, Distances
from omnieval.descriptors.screening import Batch, Sketch, between, correlated
from omnieval.descriptors.tiles import TILE, TOGETHER, Group, Tile, position_distances

T = TypeVar("T")

_NARROWED = 32
"""Images that are compared in double precision at once."""

_EXACT_TILES = 48
"""Tiles that are kept in double precision: those of images that were the best of late."""


@dataclass(frozen=True, slots=True)
class Bounds:
    """An image screened against m others: what its distances are at least and at most, shape (m,) each."""

    position_low: NDArray[np.float64]
    position_high: NDArray[np.float64]
    orientation_low: NDArray[np.float64]
    orientation_high: NDArray[np.float64]


class ScreenedStore:
    """Descriptions that can be screened against each other, and compared; grows by whole tiles.

    17 kB an image of 256 cells x 16 bins, and 16 kB for the orientation descriptor itself where it is not in memory
    that cannot be written to, such as a mapped file.

    Parameters
    ----------
    threads
        To screen with, where an image is screened against many.
    """

    def __init__(self, threads: int = 1) -> None:
        self._threads = threads
        self._sketches: list[Sketch] = []
        self._squares = np.zeros((2, 0))
        self._count = 0
        self._expected: list[Description] = []
        self._anticipated: tuple[int, ...] = ()
        self._foreseen: dict[int, NDArray[np.bool_]] = {}
        self._screened: _Screened | None = None
        self._positions: _Positions | None = None
        self._tiles: dict[int, Tile] = {}
        self._group: Group | None = None

    def __len__(self) -> int:
        return self._count

    def append(self, description: Description) -> int:
        """Keep a description and return its number."""
        if not (self._expected and _same(self._expected.pop(0), description)):
            self._expected = []
            self._put(self._count, description)
        self._count += 1
        return self._count - 1

    def expect(self, descriptions: Sequence[Description]) -> None:
        """Get to know the descriptions that come next; see `DescriptionStore.expect`."""
        for place, description in enumerate(descriptions):
            self._put(self._count + place, description)
        self._expected = list(descriptions)
        self._foreseen = {}

    def anticipate(self, queries: Iterable[int]) -> None:
        """Get to know which images are asked about next; see `DescriptionStore.anticipate`."""
        self._anticipated = tuple(sorted(queries))
        self._foreseen = {}

    def foresee(self, query: int, others: NDArray[np.int64]) -> None:
        """Get to know with which others one of the next images will be screened; a hint, which changes no result."""
        self._foreseen[query] = self._tiles_of(others)

    def glance(self, query: int, others: NDArray[np.int64]) -> Bounds:
        """Bound the distances of an image from others, by their numbers, without a transform; shape (m,)."""
        screened = self._screened_for(query)
        return screened.bounds(screened.places[query], others, self._squares)

    def bounds(self, query: int, others: NDArray[np.int64]) -> Bounds:
        """Screen an image against others, by their numbers, shape (m,)."""
        screened = self._screened_for(query)
        place = screened.places[query]
        missing = np.flatnonzero(self._tiles_of(others) & ~screened.known[place])
        if len(missing):
            self._fill(screened, place, missing.tolist())
        return screened.bounds(place, others, self._squares)

    def narrow(self, query: int, others: NDArray[np.int64]) -> Bounds:
        """Bound the distances of an image from some others within rounding of double precision, shape (m,)."""
        screened = self._screened_for(query)
        sketch, there = self._place_of(query)

        def narrow(some: Sequence[int]) -> list[None]:
            for start in some:
                block = others[start : start + _NARROWED]
                places = [self._place_of(number) for number in block.tolist()]
                orientations = np.stack([other.orientations[place] for other, place in places])
                largest = correlated(sketch.orientations[there], orientations)
                screened.narrow(screened.places[query], block, largest)
            return []

        self._in_threads(narrow, range(0, len(others), _NARROWED))
        return screened.bounds(screened.places[query], others, self._squares)

    def position_distances(self, query: int, others: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return Euclidean distances of position descriptors, shape (m,)."""
        group = query // TOGETHER
        if self._positions is None or self._positions.group != group or self._positions.tiles < len(self._sketches):
            self._positions = _Positions(group, self._known_of(group), self._sketches)
        return self._positions.distances(query % TOGETHER, others, self._tiles_of(others))

    def compare(self, query: int, others: NDArray[np.int64]) -> Distances:
        """Compare an image with others exactly, by their numbers, shape (m,)."""
        group, place = self._group_of(query), query % TOGETHER
        wanted = np.flatnonzero(self._tiles_of(others)).tolist()

        def compared(some: Sequence[int]) -> list[tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]]:
            return [group.compare(self._tile(number, keep=few), place, place + 1) for number in some]

        few = len(wanted) <= _EXACT_TILES // 4
        found = self._in_threads(compared, wanted)
        row = np.empty(len(self._sketches), np.int64)
        row[wanted] = np.arange(len(wanted))
        at = row[others // TILE] * TILE + others % TILE
        position, orientation, shifts = (np.concatenate([one[part][0] for one in found]) for part in range(3))
        return Distances(position[at], orientation[at], shifts[at])

    def _put(self, number: int, description: Description) -> None:
        tile, place = divmod(number, TILE)
        if tile == len(self._sketches):
            self._sketches.append(Sketch.empty(description))
        if number >= self._squares.shape[1]:
            self._squares = np.append(self._squares, np.zeros((2, max(64, number))), axis=1)
        self._sketches[tile].put(place, description)
        self._squares[:, number] = self._sketches[tile].squares[:, place]
        self._tiles.pop(tile, None)
        self._group = self._screened = self._positions = None

    def _tiles_of(self, others: NDArray[np.int64]) -> NDArray[np.bool_]:
        wanted = np.zeros(len(self._sketches), np.bool_)
        wanted[others // TILE] = True
        return wanted

    def _known_of(self, group: int) -> list[tuple[Sketch, int]]:
        """Return where the images of a group are, as far as they are known."""
        end = min((group + 1) * TOGETHER, self._count + len(self._expected))
        return [self._place_of(number) for number in range(group * TOGETHER, end)]

    def _place_of(self, number: int) -> tuple[Sketch, int]:
        return self._sketches[number // TILE], number % TILE

    def _screened_for(self, query: int) -> _Screened:
        """Return the batch in which an image is screened: of the images that are asked about next, or alone."""
        if self._screened is not None and query in self._screened.places:
            return self._screened
        expected = range(max(self._count - 1, 0), self._count + len(self._expected))
        together = expected if query in expected else self._anticipated if query in self._anticipated else (query,)
        numbers = [number for number in together if number >= query]
        batch = Batch.of([self._place_of(number) for number in numbers])
        screened = self._screened = _Screened(numbers, batch, len(self._sketches))

        def glance(some: Sequence[int]) -> list[None]:
            for number in some:
                screened.glance(number, batch.glance(self._sketches[number]))
            return []

        self._in_threads(glance, range(len(self._sketches)))
        return screened

    def _fill(self, screened: _Screened, place: int, tiles: Sequence[int]) -> None:
        """Screen an image against some tiles, and with it those after it that will be asked about them."""
        later = np.arange(len(screened.places)) > place
        everything = np.ones(len(self._sketches), np.bool_)
        foreseen = np.stack([self._foreseen.get(number, everything) for number in screened.places])
        wanted = foreseen & later[:, np.newaxis] & ~screened.known
        wanted[place] = True
        # Most tiles are of the same few nodes, and so wanted by the same images.
        patterns, pattern_of = np.unique(wanted[:, tiles], axis=1, return_inverse=True)
        pattern_of = pattern_of.ravel()  # NumPy 2.0.0 returns a row
        rows = [np.flatnonzero(pattern) for pattern in patterns.T]
        batches = [screened.batch.only(some) for some in rows]

        def fill(some: Sequence[int]) -> list[None]:
            for index in some:
                number, pattern = tiles[index], int(pattern_of[index])
                screened.screen(number, rows[pattern], *batches[pattern].screen(self._sketches[number]))
            return []

        self._in_threads(fill, range(len(tiles)))

    def _in_threads(self, work: Callable[[Sequence[int]], list[T]], items: Sequence[int]) -> list[T]:
        """Divide work on tiles among threads, if it is worth that; results come in the order of the tiles."""
        threads = min(self._threads, len(items) // WORTH_A_THREAD)
        if threads < 2:
            return work(items)
        shares = np.array_split(np.array(items), threads)
        with ThreadPoolExecutor(threads) as pool:
            return [one for found in pool.map(work, [share.tolist() for share in shares]) for one in found]

    def _tile(self, number: int, *, keep: bool) -> Tile:
        """Return a tile in double precision."""
        tile = self._tiles.pop(number, None) or self._sketches[number].exact()
        if keep:
            self._tiles[number] = tile
            if len(self._tiles) > _EXACT_TILES:
                del self._tiles[next(iter(self._tiles))]
        return tile

    def _group_of(self, query: int) -> Group:
        number = query // TOGETHER
        if self._group is None or self._group.number != number:
            end = min((number + 1) * TOGETHER, self._count + len(self._expected))
            tiles = {one // TILE: self._tile(one // TILE, keep=True) for one in range(number * TOGETHER, end)}
            self._group = Group.of(number, [(tiles[one // TILE], one % TILE) for one in range(number * TOGETHER, end)])
        return self._group


class _Screened:
    """What is known of a batch of images and all tiles.

    Attributes
    ----------
    places
        Where in the batch an image is, by its number.
    batch
        The images.
    products, least, most
        See `Batch.glance`, shape (q, images); the last two are narrower where the images were screened.
    known
        Which tiles they were screened against, shape (q, tiles).
    """

    def __init__(self, numbers: Sequence[int], batch: Batch, tiles: int) -> None:
        self.places = {number: place for place, number in enumerate(numbers)}
        self.batch = batch
        self.products, self.least, self.most = np.empty((3, len(numbers), tiles * TILE))
        self.known = np.zeros((len(numbers), tiles), np.bool_)
        # How far products of positions may be off, relative to the squared norms (Higham 2002, section 3.1).
        self._position_error = (batch.positions.shape[1] + 8) * 2.0**-53

    def glance(self, tile: int, found: tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]) -> None:
        """Take in what is known of a tile without a transform."""
        place = slice(tile * TILE, (tile + 1) * TILE)
        self.products[:, place], self.least[:, place], self.most[:, place] = found

    def screen(
        self, tile: int, rows: NDArray[np.int64], largest: NDArray[np.float32], errors: NDArray[np.float32]
    ) -> None:
        """Take in what screening some images of the batch against a tile has found."""
        place = slice(tile * TILE, (tile + 1) * TILE)
        exact, off = largest.astype(np.float64), errors.astype(np.float64)
        known = np.isfinite(exact) & np.isfinite(off)
        exact, off = np.where(known, exact, 0.0), np.where(known, off, 0.0)
        least, most = self.least[rows, place], self.most[rows, place]
        self.least[rows, place] = np.maximum(least, exact - off, where=known, out=least)
        self.most[rows, place] = np.minimum(most, exact + off, where=known, out=most)
        self.known[rows, tile] = True

    def narrow(self, place: int, others: NDArray[np.int64], largest: NDArray[np.float64]) -> None:
        """Take in correlations of an image of the batch and others that are rounded in double precision only."""
        self.least[place, others] = self.most[place, others] = largest

    def bounds(self, place: int, others: NDArray[np.int64], squares: NDArray[np.float64]) -> Bounds:
        """Return what is known of an image of the batch and others, whose squared norms are given."""
        summed = squares[:, others] + self.batch.squares[:, place, np.newaxis]
        products, off = self.products[place, others], self._position_error * summed[0]
        position = between(summed[0], products - off, products + off)
        return Bounds(*position, *between(summed[1], self.least[place, others], self.most[place, others]))


class _Positions:
    """Exact distances of the position descriptors of a group from those of all tiles, as far as they are known."""

    def __init__(self, group: int, images: Sequence[tuple[Sketch, int]], sketches: Sequence[Sketch]) -> None:
        self.group, self.tiles = group, len(sketches)
        self._sketches, self._images = sketches, len(images)
        dimensions = sketches[0].positions.shape[1]
        self._positions, self._squares = np.zeros((TOGETHER, dimensions)), np.zeros(TOGETHER)
        for place, (sketch, there) in enumerate(images):
            self._positions[place], self._squares[place] = sketch.positions[there], sketch.squares[0, there]
        self._known = np.zeros((TOGETHER, self.tiles), np.bool_)
        self._distances = np.empty((TOGETHER, self.tiles * TILE))

    def distances(self, place: int, others: NDArray[np.int64], tiles: NDArray[np.bool_]) -> NDArray[np.float64]:
        """Return the distances of an image of the group; of those after it, which will soon be asked for, at once."""
        for number in np.flatnonzero(tiles & ~self._known[place]).tolist():
            sketch = self._sketches[number]
            self._distances[place : self._images, number * TILE : (number + 1) * TILE] = position_distances(
                self._positions, self._squares, sketch.positions, sketch.squares[0], place, self._images
            )
            self._known[place : self._images, number] = True
        distances: NDArray[np.float64] = self._distances[place, others]
        return distances


def _same(one: Description, other: Description) -> bool:
    return np.array_equal(one.position, other.position) and np.array_equal(one.orientation, other.orientation)
