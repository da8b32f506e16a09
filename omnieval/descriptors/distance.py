"""The shift-invariant distance between orientation descriptors, by FFT over the cells.

A rotation of the robot rolls the orientation descriptor, so two are compared at the roll that aligns them best
(section 4.2 of Román et al., doi 10.3390/app10186480)::

    dist(q, k) = min_s ||q - roll(k, s)||,   ||q - roll(k, s)||^2 = ||q||^2 + ||k||^2 - 2 corr(s)

with corr the sum over bins of the circular cross-correlation along the cells, for all s at once.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, rfft

_CANCELLATION = 1e-9
"""Below this share of the squared norms the closed form has lost its digits and the distance is computed directly."""

_ROUNDING = 1e-13
"""Relative error of a correlation."""

_BLOCK = 32
"""Spectra gathered at once: 1 MB, which stays in the processor's cache, where gathering all is three times slower."""


class OrientationStore:
    """Orientation descriptors that can be compared with each other; grows by doubling.

    Double precision, because the closed form subtracts nearly equal numbers: 49 kB an image of 256 cells x 16 bins.
    """

    def __init__(self) -> None:
        self._count = 0
        self._descriptors: NDArray[np.float32] = np.empty((0, 0, 0), np.float32)
        self._spectra: NDArray[np.complex128] = np.empty((0, 0, 0), np.complex128)
        self._squares: NDArray[np.float64] = np.empty(0)

    def __len__(self) -> int:
        return self._count

    def append(self, orientation: NDArray[np.float32]) -> int:
        """Keep a descriptor, shape (cells, bins), and return its number."""
        if self._count == len(self._squares):
            self._grow(orientation.shape)
        exact = orientation.astype(np.float64)
        self._descriptors[self._count] = orientation
        self._spectra[self._count] = rfft(exact, axis=0)
        self._squares[self._count] = np.square(exact).sum()
        self._count += 1
        return self._count - 1

    def compare(self, query: int, others: NDArray[np.int64]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Compare a descriptor with others, by their numbers.

        Returns
        -------
        distances
            Shape (m,), float64.
        shifts
            The roll s of each of the others that aligns it with the query, in cells, shape (m,); the smallest of
            equally good ones.
        """
        squared, shifts = np.empty(len(others)), np.empty(len(others), np.int64)
        for start in range(0, len(others), _BLOCK):
            block = slice(start, start + _BLOCK)
            squared[block], shifts[block] = self._compare(query, others[block])
        return np.sqrt(squared), shifts

    def _compare(self, query: int, others: NDArray[np.int64]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Return squared distances and shifts of a few."""
        cells = self._descriptors.shape[1]
        # conj(Q) K instead of Q conj(K): then only the small result has to be conjugated.
        products = np.einsum("mfb,fb->mf", self._spectra[others], self._spectra[query].conj())
        correlation = irfft(products.conj(), cells, axis=1)
        scale = self._squares[query] + self._squares[others]
        # Rounding must not choose among shifts that are equally good.
        best = correlation.max(axis=1) - _ROUNDING * scale
        shifts = (correlation >= best[:, np.newaxis]).argmax(axis=1)
        squared = scale - 2.0 * correlation[np.arange(len(others)), shifts]
        for index in np.flatnonzero(squared <= _CANCELLATION * scale):
            squared[index] = self._squared_distance(query, int(others[index]), int(shifts[index]))
        return squared, shifts

    def _squared_distance(self, query: int, other: int, shift: int) -> float:
        difference = self._descriptors[query].astype(np.float64) - np.roll(self._descriptors[other], shift, axis=0)
        return float(np.square(difference).sum())

    def _grow(self, shape: tuple[int, ...]) -> None:
        cells, bins = shape
        capacity = max(64, 2 * self._count)
        descriptors = np.empty((capacity, cells, bins), np.float32)
        spectra = np.empty((capacity, cells // 2 + 1, bins), np.complex128)
        squares = np.empty(capacity)
        if self._count:
            descriptors[: self._count] = self._descriptors
            spectra[: self._count] = self._spectra
            squares[: self._count] = self._squares
        self._descriptors, self._spectra, self._squares = descriptors, spectra, squares
