"""Images compared with each other in fixed groups, `TOGETHER` with `TILE` others.

A processor is fast at that, and a distance has the same bits whoever asks for it and for what else at the same time.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from omnieval.descriptors.alignment import as_query, best_rolls, correlations, spectrum
from omnieval.descriptors.description import Description

_CANCELLATION = 1e-6
"""Below this share of the squared norms the closed form has lost digits and the distance is computed directly."""

TILE = 31
"""Others at once: odd, so that rows of pairs do not all fall on the same lines of the processor's cache."""

TOGETHER = 8
"""Images at once: few enough to want nearly the same others, many enough to be worth a matrix product."""


@dataclass(frozen=True, slots=True)
class Tile:
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
    def empty(cls, dimensions: int, cells: int, bins: int) -> Tile:
        """Return a tile for images with descriptors of these shapes."""
        return cls(
            np.zeros((TILE, dimensions)),
            np.zeros((TILE, cells, bins), np.float32),
            np.zeros((cells // 2 + 1, 2 * bins, TILE)),
            np.zeros((2, TILE)),
        )

    def put(self, place: int, description: Description) -> None:
        """Put an image at a place."""
        exact = description.orientation.astype(np.float64)
        self.positions[place] = description.position
        self.orientations[place] = description.orientation
        self.spectra[:, :, place] = spectrum(exact)
        self.squares[:, place] = np.square(self.positions[place]).sum(), np.square(exact).sum()

    def take(self, place: int, other: Tile, there: int) -> None:
        """Put the image at a place of another tile at a place of this one."""
        self.positions[place] = other.positions[there]
        self.orientations[place] = other.orientations[there]
        self.spectra[:, :, place] = other.spectra[:, :, there]
        self.squares[:, place] = other.squares[:, there]

    def copied(self) -> Tile:
        """Return one that changes by itself."""
        return Tile(self.positions.copy(), self.orientations.copy(), self.spectra.copy(), self.squares.copy())

    def has(self, place: int, description: Description) -> bool:
        """Whether this very image is at a place."""
        return np.array_equal(self.positions[place], description.position) and np.array_equal(
            self.orientations[place], description.orientation
        )


@dataclass(frozen=True, slots=True)
class Group:
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
    def of(cls, number: int, images: Sequence[tuple[Tile, int]]) -> Group:
        """Return a group of images that are at these places."""
        tile = images[0][0]
        positions = np.zeros((TOGETHER, tile.positions.shape[1]))
        orientations = np.zeros((TOGETHER, *tile.orientations.shape[1:]), np.float32)
        squares = np.zeros((2, TOGETHER))
        spectra = np.zeros((*tile.spectra.shape[:2], TOGETHER))
        for to, (tile, place) in enumerate(images):
            positions[to], orientations[to] = tile.positions[place], tile.orientations[place]
            squares[:, to], spectra[:, :, to] = tile.squares[:, place], tile.spectra[:, :, place]
        return cls(number, positions, orientations, squares, as_query(spectra))

    def compare(
        self, tile: Tile, first: int, last: int
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]:
        """Return distances of positions and of orientations, and shifts, of some of these images from a tile's."""
        scales = self.squares[:, first:last, np.newaxis] + tile.squares[:, np.newaxis]
        cells = self.orientations.shape[1]
        best, shifts = best_rolls(correlations(self.queries, tile.spectra, cells, first, last), scales[1])

        def between_orientations(one: int, other: int) -> float:
            rolled = np.roll(tile.orientations[other], int(shifts[one, other]), axis=0)
            return float(np.square(self.orientations[first + one].astype(np.float64) - rolled).sum())

        position = position_distances(self.positions, self.squares[0], tile.positions, tile.squares[0], first, last)
        return position, _distances(scales[1], best, between_orientations), shifts


def position_distances(
    positions: NDArray[np.float64],
    squares: NDArray[np.float64],
    others: NDArray[np.float64],
    other_squares: NDArray[np.float64],
    first: int,
    last: int,
) -> NDArray[np.float64]:
    """Return distances of some position descriptors of a group from a tile's, shape (last - first, tile).

    Parameters
    ----------
    positions, squares
        Of the whole group, shapes (group, d) and (group,).
    others, other_squares
        Of the whole tile, shapes (tile, d) and (tile,).
    first, last
        The images wanted. All are multiplied: what comes out must not depend on which are wanted.
    """
    products = (positions @ others.T)[first:last]

    def directly(one: int, other: int) -> float:
        return float(np.square(positions[first + one] - others[other]).sum())

    return _distances(squares[first:last, np.newaxis] + other_squares, products, directly)


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
