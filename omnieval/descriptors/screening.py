"""Distances in single precision with bounds on their error: enough to decide most comparisons, at a third of the cost.

The correlation of two images at every roll (`alignment`) is computed with half the bytes, its mean apart, and only its
largest value is kept. Whoever cannot decide within the bounds asks for the distances themselves (`Sketch.exact`).

The bound on the error of a correlation c(s), u being the rounding unit of single precision::

    |c~(s) - c(s)| <= 2 u (A |q| |k| + B R),   R^2 = sum_s' c(s')^2 <= sum_f w_f / N |Q_f|^2 |K_f|^2   (f > 0)

A is what rounding the spectra and summing 2 bins products comes to in every frequency (Higham, *Accuracy and Stability
of Numerical Algorithms*, 2002, section 3.1, with Cauchy-Schwarz over the bins and Parseval over the frequencies). B is
that of a Fourier transform (section 24.1: log2 N stages of at most 8 u for powers of two, p + 6 for a factor p),
relative to the root of the sum of squares R, which bounds the largest error. The 2 is for terms of higher order.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.fft import rfft

from omnieval.descriptors.alignment import as_query, spectrum
from omnieval.descriptors.description import Description
from omnieval.descriptors.tiles import TILE, Tile

_UNIT = 2.0**-24
"""Rounding unit of single precision."""
_EXACT = 1e-12
"""Relative to the squared norms, more than distances in double precision are rounded by."""
_NORMS = 1e-4
"""Relative: more than inner products of norms in single precision are rounded by, of 4096 cells at most."""
_TINY, _HUGE = 1e-12, 1e18
"""Products of norms beyond which single precision loses digits of their squares, or overflows."""
_BACK = cv2.DFT_INVERSE | cv2.DFT_ROWS | cv2.DFT_SCALE | cv2.DFT_REAL_OUTPUT


@dataclass(frozen=True, slots=True)
class Sketch:
    """A tile of images, as those that others are screened against.

    Attributes
    ----------
    positions
        Shape (tile, d), double precision.
    orientations
        The orientation descriptors themselves, as far as there are images.
    spectra
        Shape (frequencies, 2 bins, tile), single precision.
    norms
        Of the spectra over the bins, so that their squares sum to that of the descriptor, shape (tile, frequencies).
    means
        Sums over the cells, divided by the root of their number, shape (tile, bins).
    squares
        Squared norms of positions and of orientations, shape (2, tile), double precision.
    """

    positions: NDArray[np.float64]
    orientations: list[NDArray[np.float32]]
    spectra: NDArray[np.float32]
    norms: NDArray[np.float32]
    means: NDArray[np.float64]
    squares: NDArray[np.float64]

    @classmethod
    def empty(cls, description: Description) -> Sketch:
        """Return a sketch for images with descriptors of these shapes."""
        cells, bins = description.orientation.shape
        return cls(
            np.zeros((TILE, len(description.position))),
            [],
            np.zeros((cells // 2 + 1, 2 * bins, TILE), np.float32),
            np.zeros((TILE, cells // 2 + 1), np.float32),
            np.zeros((TILE, bins)),
            np.zeros((2, TILE)),
        )

    def put(self, place: int, description: Description) -> None:
        """Put an image at a place; those at later places are dropped."""
        exact = description.orientation.astype(np.float64)
        transformed = spectrum(exact)
        bins = exact.shape[1]
        power = np.square(transformed[:, :bins]).sum(axis=1) + np.square(transformed[:, bins:]).sum(axis=1)
        self.positions[place] = description.position
        # What nobody can change, such as a file that is mapped into memory, need not be copied.
        kept = description.orientation.copy() if description.orientation.flags.writeable else description.orientation
        self.orientations[place:] = [kept]
        with np.errstate(over="ignore"):
            self.spectra[:, :, place] = transformed
            self.norms[place] = np.sqrt(power * weights(len(exact)))
        self.means[place] = transformed[0, :bins] / math.sqrt(len(exact))
        self.squares[:, place] = np.square(self.positions[place]).sum(), np.square(exact).sum()

    def exact(self) -> Tile:
        """Return the same images in double precision."""
        tile = Tile.empty(self.positions.shape[1], *self.orientations[0].shape)
        there = len(self.orientations)
        tile.positions[:], tile.squares[:] = self.positions, self.squares
        tile.orientations[:there] = np.stack(self.orientations)
        transformed = rfft(tile.orientations[:there].astype(np.float64), axis=1).transpose(1, 2, 0)
        bins = transformed.shape[1]
        tile.spectra[:, :bins, :there], tile.spectra[:, bins:, :there] = transformed.real, transformed.imag
        return tile


@dataclass(frozen=True, slots=True)
class Batch:
    """Some images, as those that are screened together.

    Attributes
    ----------
    positions
        Shape (q, d), double precision.
    queries
        From `as_query`, shape (frequencies, 2 q, 2 bins), single precision.
    norms, means, squares
        As in a sketch, shapes (q, frequencies), (q, bins) and (2, q).
    cells
        Of the orientation descriptors.
    """

    positions: NDArray[np.float64]
    queries: NDArray[np.float32]
    norms: NDArray[np.float32]
    means: NDArray[np.float64]
    squares: NDArray[np.float64]
    cells: int

    @classmethod
    def of(cls, images: Sequence[tuple[Sketch, int]]) -> Batch:
        """Return a batch of images that are at these places."""
        spectra = np.stack([sketch.spectra[:, :, place] for sketch, place in images], axis=2)
        return cls(
            np.stack([sketch.positions[place] for sketch, place in images]),
            np.ascontiguousarray(as_query(spectra)),
            np.stack([sketch.norms[place] for sketch, place in images]),
            np.stack([sketch.means[place] for sketch, place in images]),
            np.stack([sketch.squares[:, place] for sketch, place in images], axis=1),
            len(images[0][0].orientations[0]),
        )

    def only(self, rows: NDArray[np.int64]) -> Batch:
        """Return some of the batch."""
        both = np.concatenate([rows, rows + len(self.positions)])
        queries = np.ascontiguousarray(self.queries[:, both])
        return Batch(
            self.positions[rows], queries, self.norms[rows], self.means[rows], self.squares[:, rows], self.cells
        )

    def glance(self, sketch: Sketch) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Return what is known of the batch and a tile without a transform, each of shape (q, tile).

        Returns
        -------
        Inner products of positions; what correlations of orientations are at least, at their best roll, which is not
        below their mean; and at most: in no frequency more than the product of the norms (Cauchy-Schwarz).
        """
        with np.errstate(over="ignore", invalid="ignore"):
            most = (self.norms @ sketch.norms.T).astype(np.float64) * (1.0 + _NORMS)
        most[~_representable(self._sizes(sketch))] = np.inf
        return self.positions @ sketch.positions.T, self.means @ sketch.means.T, most

    def screen(self, sketch: Sketch) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Return the largest correlations of orientations with a tile, and how far they may be off, shape (q, tile)."""
        with np.errstate(over="ignore", invalid="ignore"):
            products = np.matmul(self.queries, sketch.spectra).reshape(-1, len(self.positions) * TILE)
            mean = products[0] / np.float32(self.cells)
            products[1] = 0.0
            rolls = cv2.dft(cv2.transpose(products[1 : self.cells + 1]), flags=_BACK).reshape(len(mean), -1)
            largest = rolls[np.arange(len(rolls)), rolls.argmax(axis=1)] + mean
        return largest.reshape(-1, TILE), self._errors(sketch)

    def _errors(self, sketch: Sketch) -> NDArray[np.float32]:
        """Return how far correlations in single precision may be off, shape (q, tile)."""
        bins = self.queries.shape[2] // 2
        sizes = self._sizes(sketch)
        with np.errstate(over="ignore", invalid="ignore"):
            # 1 / w_f brings the weight of a frequency, which is in both norms, back to once.
            spread = np.square(self.norms[:, 1:]) / weights(self.cells)[1:].astype(np.float32)
            energy = spread @ np.square(sketch.norms[:, 1:]).T
        summing = math.sqrt(2.0) * (2 * bins + 4) + 3
        errors: NDArray[np.float32] = (
            2.0 * _UNIT * (summing * sizes + transforming(self.cells) * np.sqrt(energy))
        ).astype(np.float32)
        errors[~_representable(sizes)] = np.inf
        return errors

    def _sizes(self, sketch: Sketch) -> NDArray[np.float64]:
        """Return the products of the norms of the batch and a tile, shape (q, tile)."""
        sizes: NDArray[np.float64] = np.sqrt(self.squares[1][:, np.newaxis] * sketch.squares[1])
        return sizes


def _representable(sizes: NDArray[np.float64]) -> NDArray[np.bool_]:
    return (sizes > _TINY) & (sizes < _HUGE)


def correlated(query: NDArray[np.float32], others: NDArray[np.float32]) -> NDArray[np.float64]:
    """Return the largest correlation of an orientation descriptor, (cells, bins), with others, shape (m, cells, bins).

    In double precision, but not to the bit what tiles say. Fastest for a few dozen, which fit into the cache.
    """
    count, cells, bins = others.shape
    rows = np.ascontiguousarray(others.transpose(0, 2, 1), np.float64).reshape(count * bins, cells)
    queries = np.tile(cv2.dft(np.ascontiguousarray(query.T, np.float64), flags=cv2.DFT_ROWS), (count, 1))
    crossed = cv2.mulSpectrums(cv2.dft(rows, flags=cv2.DFT_ROWS), queries, cv2.DFT_ROWS, conjB=True)
    crossed = crossed.reshape(count, bins, cells).sum(axis=1)
    largest: NDArray[np.float64] = cv2.dft(crossed, flags=_BACK).max(axis=1)
    return largest


@cache
def weights(cells: int) -> NDArray[np.float64]:
    """Return how often each frequency of a real transform counts in a sum of squares, over the cells, shape (f,)."""
    doubled = np.full(cells // 2 + 1, 2.0)
    doubled[0] = 1.0
    if cells % 2 == 0:
        doubled[-1] = 1.0
    return doubled / cells


@cache
def transforming(cells: int) -> float:
    """Return B: rounding units a real inverse transform of so many cells may be off by, relative to its result."""
    units, rest, factor = 8.0, cells, 2
    while rest > 1:
        while rest % factor == 0:
            units, rest = units + factor + 6.0, rest // factor
        factor += 1
    return units


def between(
    squares: NDArray[np.float64], least: NDArray[np.float64], most: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return bounds of distances, below and above, of sums of squared norms and bounds of inner products."""
    slack = _EXACT * squares
    with np.errstate(invalid="ignore"):
        low = np.sqrt(np.maximum(squares - 2.0 * most - slack, 0.0))
        high = np.sqrt(np.maximum(squares - 2.0 * least + slack, 0.0))
    known = np.isfinite(most) & np.isfinite(least)
    return np.where(known, low, 0.0), np.where(known, high, np.inf)
