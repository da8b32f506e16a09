"""Image-level loop closure in plain loops: similarities, peaks and prominences."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]

DISTANCE_FLOOR = 1e-9


@dataclass(frozen=True)
class Image:
    """The descriptors of one image in float64, and its orientation descriptor rolled by every shift."""

    position: Vector
    orientation: Vector
    rolled: Vector

    @staticmethod
    def of(position: NDArray[np.floating], orientation: NDArray[np.floating]) -> Image:
        """Keep copies of the descriptors; `rolled[s]` is the orientation descriptor rolled by s cells."""
        cells = orientation.astype(np.float64)
        rolled = np.stack([np.roll(cells, shift, axis=0) for shift in range(len(cells))])
        return Image(position.astype(np.float64), cells, rolled)


def orientation_distance(query: Image, image: Image) -> tuple[float, int]:
    """The smallest distance over all shifts of `image` and the first shift that reaches it."""
    differences = (query.orientation - image.rolled).reshape(len(image.rolled), -1)
    distances = np.sqrt((differences**2).sum(axis=1))
    shift = int(np.argmin(distances))
    return float(distances[shift]), shift


def similarities(query: Image, images: list[Image]) -> tuple[list[float], list[float], list[float], list[int]]:
    """s_pos, s_ori (each normalised to sum 1), their product, and the shift, for each of `images`."""
    position, orientation, shifts = [], [], []
    for image in images:
        distance, shift = orientation_distance(query, image)
        position.append(1 / max(float(np.linalg.norm(query.position - image.position)), DISTANCE_FLOOR))
        orientation.append(1 / max(distance, DISTANCE_FLOOR))
        shifts.append(shift)
    position_sum, orientation_sum = sum(position), sum(orientation)
    position = [value / position_sum for value in position]
    orientation = [value / orientation_sum for value in orientation]
    product = [p * o for p, o in zip(position, orientation, strict=True)]
    return position, orientation, product, shifts


def find_peaks(curve: list[float]) -> list[int]:
    """Indices of the strict local maxima; a plateau counts once, at its middle; the ends never count."""
    peaks = []
    start = 1
    while start < len(curve) - 1:
        end = start
        while end + 1 < len(curve) and curve[end + 1] == curve[start]:
            end += 1
        falls = end + 1 < len(curve) and curve[end + 1] < curve[start]
        if curve[start - 1] < curve[start] and falls:
            peaks.append((start + end) // 2)
        start = end + 1
    return peaks


def prominence(curve: list[float], peak: int) -> float:
    """Height of `peak` above the higher of its two side minima."""
    return curve[peak] - max(_side_minimum(curve, peak, -1), _side_minimum(curve, peak, +1))


def _side_minimum(curve: list[float], peak: int, direction: int) -> float:
    """The lowest sample between `peak` and the next strictly higher one (or the end), walking one way."""
    lowest = curve[peak]
    index = peak
    while 0 <= index < len(curve) and curve[index] <= curve[peak]:
        lowest = min(lowest, curve[index])
        index += direction
    return lowest
