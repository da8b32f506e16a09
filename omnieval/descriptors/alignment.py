"""How far orientation descriptors are from each other at their best roll, for many pairs at once.

A rotation of the robot rolls the orientation descriptor, so two are compared at the roll that aligns them best
(section 4.2 of Román et al., doi 10.3390/app10186480), by FFT over the cells, for all rolls s at once::

    dist(q, k) = min_s ||q - roll(k, s)||,   ||q - roll(k, s)||^2 = ||q||^2 + ||k||^2 - 2 corr(s)

with corr the sum over bins of the circular cross-correlation along the cells. Its spectrum is a sum over bins too: one
product of real matrices for each frequency.
"""

from __future__ import annotations

from typing import TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.fft import rfft

_ROUNDING = 1e-13
"""Relative error of a correlation."""

_BACK = cv2.DFT_INVERSE | cv2.DFT_ROWS | cv2.DFT_SCALE | cv2.DFT_REAL_OUTPUT


def spectrum(orientation: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return real above imaginary parts of a descriptor's spectrum, shape (frequencies, 2 bins), of (cells, bins)."""
    transformed = rfft(orientation, axis=0)
    return np.concatenate([transformed.real, transformed.imag], axis=1)


Real = TypeVar("Real", np.float32, np.float64)


def as_query(spectra: NDArray[Real]) -> NDArray[Real]:
    """Return what gives real and imaginary parts of a cross-spectrum when multiplied with `spectrum`.

    Parameters
    ----------
    spectra
        Of q images, shape (frequencies, 2 bins, q).

    Returns
    -------
    Rows for the real parts of all images, then for the imaginary ones, shape (frequencies, 2 q, 2 bins).
    """
    real, imaginary = np.split(spectra.transpose(0, 2, 1), 2, axis=2)
    return np.concatenate(
        [np.concatenate([real, imaginary], axis=2), np.concatenate([imaginary, -real], axis=2)], axis=1
    )


def correlations(
    queries: NDArray[np.float64], spectra: NDArray[np.float64], cells: int, first: int, last: int
) -> NDArray[np.float64]:
    """Return the cross-correlation of images with others at every roll, shape (last - first, k, cells).

    Parameters
    ----------
    queries
        Of q images, from `as_query`, shape (frequencies, 2 q, 2 bins).
    spectra
        Of k other images, shape (frequencies, 2 bins, k); faster where k is odd.
    cells
        Of the descriptors.
    first, last
        The queries wanted. All are multiplied: what comes out must not depend on which are wanted.
    """
    count, others = queries.shape[1] // 2, spectra.shape[2]
    # Rows are Re 0, Im 0, Re 1, Im 1, ...; columns are pairs.
    products = np.matmul(queries, spectra).reshape(-1, count * others)
    # OpenCV leaves out the parts that are zero: Im 0, and the last one of an even number of cells.
    products[1] = products[0]
    packed = cv2.transpose(products[1 : cells + 1, first * others : last * others])
    pairs: NDArray[np.float64] = cv2.dft(packed, flags=_BACK)
    return pairs.reshape(last - first, others, cells)


def best_rolls(
    correlation: NDArray[np.float64], scale: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return the largest correlation of each pair and its roll, the smallest of equally good ones.

    Parameters
    ----------
    correlation
        Shape (q, k, cells).
    scale
        Sum of the squared norms of each pair, shape (q, k): what correlations are rounded relative to.
    """
    pairs = correlation.reshape(-1, correlation.shape[2])
    numbers = np.arange(len(pairs))
    best = pairs[numbers, pairs.argmax(axis=1)]
    # Rounding must not choose among rolls that are equally good.
    shifts = (pairs >= (best - _ROUNDING * scale.ravel())[:, np.newaxis]).argmax(axis=1)
    return pairs[numbers, shifts].reshape(scale.shape), shifts.reshape(scale.shape)
