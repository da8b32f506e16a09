"""The conditions of loop closure, activation and merging, each a small pure function.

Equations and sections are those of Román et al., doi 10.3390/app10186480.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import find_peaks, peak_prominences
from scipy.spatial.distance import pdist

DISTANCE_FLOOR = 1e-9
"""Identical images are this far apart, so that similarities stay finite."""


def gate_threshold(omega: float, active: int) -> float:
    """Return x(C) = max(omega, 3.05 - 0.15 C) for C active nodes (sections 4.1 and 6.2)."""
    return max(omega, gate_floor(active))


def gate_floor(active: int) -> float:
    """Return 3.05 - 0.15 C, what x(C) is at least."""
    return 3.05 - 0.15 * active


def similarities(distances: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the inverse distances, normalised to sum 1, shape (m,) (Eqs. 5 to 8)."""
    inverse: NDArray[np.float64] = 1.0 / np.maximum(distances, DISTANCE_FLOOR)
    inverse /= inverse.sum()
    return inverse


@dataclass(frozen=True, slots=True)
class Prominence:
    """Prominence of the best match, the sum over all peaks, and their number."""

    best: float
    total: float
    peaks: int


def prominence(similarity: NDArray[np.float64], slots: NDArray[np.int64], map_size: int, best: int) -> Prominence:
    """Measure how far the best match stands out of the similarity curve (section 4.3).

    Parameters
    ----------
    similarity
        Similarity s of the m candidate images, shape (m,), positive.
    slots
        Where they stand on the curve over all images of the map, ascending, shape (m,).
    map_size
        Length of that curve. It is 0 between the candidates and beyond both ends.
    best
        Index of the best match in `similarity`.
    """
    curve = np.zeros(map_size + 2)
    curve[slots + 1] = similarity
    peaks, _ = find_peaks(curve)
    # The best match is measured by itself: on a plateau the peak stands at its middle instead.
    values = peak_prominences(curve, np.append(peaks, slots[best] + 1))[0]
    return Prominence(float(values[-1]), float(values[:-1].sum()), len(peaks))


def centroid_shift(position: NDArray[np.float64], representative: NDArray[np.float64], count: int) -> float:
    """Return how far an image moves the mean of a node of `count` images: ||p - r|| / (n + 1) (Eq. 9)."""
    return float(np.linalg.norm(position - representative)) / (count + 1)


def centroid_bound(squared_radii: NDArray[np.float64]) -> float:
    """Return the largest leave-one-out shift of a node's mean: max_j ||p_j - r|| / (n - 1) (Eq. 9).

    `squared_radii` are the squared distances of its n images from the mean, shape (n,).
    """
    return math.sqrt(float(squared_radii.max())) / (len(squared_radii) - 1)


def mean_distance(representative: NDArray[np.float64], others: NDArray[np.float64]) -> float:
    """Return the mean distance of a representative, shape (d,), to others, shape (m, d) (section 4.5)."""
    return float(np.linalg.norm(others - representative, axis=1).mean())


def mean_pairwise_distance(representatives: NDArray[np.float64]) -> float:
    """Return the mean distance among representatives, shape (m, d), m >= 2 (section 4.5)."""
    return float(pdist(representatives).mean())
