"""How far images are from each other: position descriptors as they are, orientation descriptors at their best roll.

A rotation of the robot rolls the orientation descriptor, so two are compared at the roll that aligns them best
(section 4.2 of Román et al., doi 10.3390/app10186480), by FFT over the cells, for all rolls s at once::

    dist(q, k) = min_s ||q - roll(k, s)||,   ||q - roll(k, s)||^2 = ||q||^2 + ||k||^2 - 2 corr(s)

with corr the sum over bins of the circular cross-correlation along the cells.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, rfft

from omnieval.descriptors.description import Description

_CANCELLATION = 1e-9
"""Below this share of the squared norms the closed form has lost its digits and the distance is computed directly."""

_ROUNDING = 1e-13
"""Relative error of a correlation."""

_TILE = 64
"""Images compared at once. Tiles are whole and aligned, so that a distance has the same bits whoever asks for it."""


_TOGETHER = 8
"""Images compared with a tile at once: few enough to stay in the processor's cache, many enough to hide Python."""


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
        To compare with, where several images are compared at once.
    """

    def __init__(self, threads: int = 1) -> None:
        self._threads = threads
        self._count = 0
        self._tiles: list[_Tile] = []
        self._rows: dict[int, _Row] = {}
        self._expected: dict[int, _Query] = {}
        self._asked: set[int] = set()

    def __len__(self) -> int:
        return self._count

    def append(self, description: Description) -> int:
        """Keep a description and return its number."""
        tile, place = divmod(self._count, _TILE)
        if tile == len(self._tiles):
            self._tiles.append(_Tile.empty(len(description.position), *description.orientation.shape))
        self._tiles[tile].put(place, description)
        for row in self._rows.values():
            row.forget(tile)
        expected = self._expected.pop(self._count, None)
        if expected is not None and not expected.is_of(description):
            self._rows.pop(self._count, None)
        self._count += 1
        return self._count - 1

    def compare(self, query: int, others: NDArray[np.int64]) -> Distances:
        """Compare an image with others, by their numbers, shape (m,)."""
        row = self._rows.get(query)
        if row is None:
            row = _Row()
            self._rows = {query: row}
        row.reach(len(self._tiles))
        wanted = np.zeros(len(self._tiles), np.bool_)
        wanted[others // _TILE] = True
        self._asked.update(np.flatnonzero(wanted).tolist())
        missing = np.flatnonzero(wanted & ~row.known)
        if len(missing):
            asked = self._query(query)
            for tile in missing.tolist():
                self._fill([row], [asked], tile)
        return Distances(row.position[others], row.orientation[others], row.shifts[others])

    def expect(self, descriptions: Sequence[Description]) -> None:
        """Compare the images that come next with those that were asked for of late, which is faster all at once.

        A hint: what `compare` returns does not depend on it.
        """
        queries = {self._count + number: _Query.of(description) for number, description in enumerate(descriptions)}
        tiles = sorted(self._asked)
        self._asked.clear()
        self._expected = queries
        self._remember(queries, tiles)

    def anticipate(self, queries: Iterable[int]) -> None:
        """Compare some images that are here with all others, which is faster all at once.

        A hint: what `compare` returns does not depend on it.
        """
        self._remember({query: self._query(query) for query in queries}, range(len(self._tiles)))

    def _remember(self, queries: Mapping[int, _Query], tiles: Iterable[int]) -> None:
        rows = {query: _Row() for query in queries}
        for row in rows.values():
            row.reach(len(self._tiles))

        def fill(tile: int) -> None:
            for number in range(0, len(rows), _TOGETHER):
                some = list(rows)[number : number + _TOGETHER]
                self._fill([rows[query] for query in some], [queries[query] for query in some], tile)

        if self._threads == 1:
            for tile in tiles:
                fill(tile)
        else:
            with ThreadPoolExecutor(self._threads) as pool:
                list(pool.map(fill, tiles))
        self._rows = rows

    def _query(self, query: int) -> _Query:
        return self._tiles[query // _TILE].query(query % _TILE)

    def _fill(self, rows: Sequence[_Row], queries: Sequence[_Query], number: int) -> None:
        """Compare some images with those of one tile."""
        tile = self._tiles[number]
        orientations, shifts = tile.align(queries)
        for row, query, orientation, shift in zip(rows, queries, orientations, shifts, strict=True):
            difference = tile.positions - query.position
            row.put(number, np.sqrt(np.einsum("kd,kd->k", difference, difference)), orientation, shift)


@dataclass(frozen=True, slots=True)
class _Query:
    """An image to compare: its descriptors, spectrum of shape (frequencies, 1, bins), and squared norm."""

    position: NDArray[np.float64]
    orientation: NDArray[np.float32]
    spectrum: NDArray[np.complex128]
    square: float

    @classmethod
    def of(cls, description: Description) -> _Query:
        tile = _Tile.empty(len(description.position), *description.orientation.shape, images=1)
        tile.put(0, description)
        return tile.query(0)

    def is_of(self, description: Description) -> bool:
        return np.array_equal(self.position, description.position) and np.array_equal(
            self.orientation, description.orientation
        )


@dataclass(frozen=True, slots=True)
class _Tile:
    """Some images; of orientation descriptors also the conjugate spectra and the squared norms.

    Shapes (tile, d), (tile, cells, bins), (frequencies, bins, tile), (tile,).
    """

    positions: NDArray[np.float64]
    orientations: NDArray[np.float32]
    conjugates: NDArray[np.complex128]
    squares: NDArray[np.float64]

    @classmethod
    def empty(cls, dimensions: int, cells: int, bins: int, *, images: int = _TILE) -> _Tile:
        return cls(
            np.zeros((images, dimensions)),
            np.zeros((images, cells, bins), np.float32),
            np.zeros((cells // 2 + 1, bins, images), np.complex128),
            np.zeros(images),
        )

    def put(self, place: int, description: Description) -> None:
        exact = description.orientation.astype(np.float64)
        self.positions[place] = description.position
        self.orientations[place] = description.orientation
        self.conjugates[:, :, place] = rfft(exact, axis=0).conj()
        self.squares[place] = np.square(exact).sum()

    def query(self, place: int) -> _Query:
        return _Query(
            self.positions[place],
            self.orientations[place],
            np.ascontiguousarray(self.conjugates[:, :, place].conj())[:, np.newaxis],
            float(self.squares[place]),
        )

    def align(self, queries: Sequence[_Query]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Return orientation distances and shifts of q images, shape (q, tile) each.

        Every operation is one on each image by itself, so that no result depends on the company.
        """
        cells = self.orientations.shape[1]
        products = np.matmul(np.stack([query.spectrum for query in queries]), self.conjugates)[:, :, 0]
        # One pair a row, so that what looks for the best shift reads along memory.
        correlation = irfft(np.ascontiguousarray(products.transpose(0, 2, 1)), cells, axis=2)
        scale = np.array([[query.square] for query in queries]) + self.squares
        # Rounding must not choose among shifts that are equally good.
        best = correlation.max(axis=2) - _ROUNDING * scale
        shifts = (correlation >= best[:, :, np.newaxis]).argmax(axis=2)
        squared = scale - 2.0 * np.take_along_axis(correlation, shifts[:, :, np.newaxis], axis=2)[:, :, 0]
        for number, place in np.argwhere(squared <= _CANCELLATION * scale).tolist():
            rolled = np.roll(self.orientations[place], int(shifts[number, place]), axis=0)
            squared[number, place] = np.square(queries[number].orientation.astype(np.float64) - rolled).sum()
        return np.sqrt(squared), shifts


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
