"""HOG pixel by pixel: the oracle of `omnieval.descriptors`."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Kernel = Literal["central", "sobel"]
Norm = Literal["cell-l2", "none", "cell-l1", "global-l2"]

EPSILON = 0.01
SMOOTHING: dict[str, tuple[float, float, float]] = {"central": (0, 1, 0), "sobel": (1, 2, 1)}


def hog(
    panorama: NDArray[np.uint8],
    *,
    signed: bool = True,
    kernel: Kernel = "central",
    interpolate: bool = False,
    norm: Norm = "cell-l2",
    bins: int = 16,
    position_cells: int = 16,
    orientation_step: int = 2,
    orientation_width: int = 16,
) -> tuple[Floats, Floats]:
    """The position (position_cells, bins) and the orientation descriptor (columns / step, bins), float64.

    Rows must be a multiple of `position_cells`, columns of `orientation_step`. The position descriptor is
    still to be flattened.
    """
    rows, columns = panorama.shape
    votes = pixel_votes(panorama.astype(np.float64), signed=signed, kernel=kernel, interpolate=interpolate, bins=bins)
    height = rows // position_cells
    position = np.zeros((position_cells, bins))
    orientation = np.zeros((columns // orientation_step, bins))
    for row in range(rows):
        for column in range(columns):
            position[row // height] += votes[row, column]
    for cell in range(len(orientation)):
        for offset in range(orientation_width):
            orientation[cell] += votes[:, (cell * orientation_step + offset) % columns].sum(axis=0)
    return normalise(position, norm), normalise(orientation, norm)


def pixel_votes(image: Floats, *, signed: bool, kernel: Kernel, interpolate: bool, bins: int) -> Floats:
    """The histogram every single pixel contributes, shape (rows, columns, bins)."""
    turn = 2 * np.pi if signed else np.pi
    votes = np.zeros((*image.shape, bins))
    for row in range(image.shape[0]):
        for column in range(image.shape[1]):
            d_x, d_y = gradient(image, row, column, kernel)
            magnitude = np.sqrt(d_x**2 + d_y**2)
            place = np.mod(np.arctan2(d_y, d_x), turn) / turn * bins
            for index, share in shares(float(place), interpolate=interpolate):
                votes[row, column, index % bins] += share * magnitude
    return votes


def shares(place: float, *, interpolate: bool) -> list[tuple[int, float]]:
    """Which bins a pixel at `place` (in bins, [0, bins]) votes for, and with which share.

    A bin spans [k, k + 1); interpolation is linear between the centres k + 0.5 of neighbouring bins.
    """
    if not interpolate:
        return [(int(np.floor(place)), 1.0)]
    lower = int(np.floor(place - 0.5))
    upper_share = place - 0.5 - lower
    return [(lower, 1 - upper_share), (lower + 1, upper_share)]


def gradient(image: Floats, row: int, column: int, kernel: Kernel) -> tuple[float, float]:
    """D_x (to the right) and D_y (downwards) at one pixel; columns wrap around, rows are replicated."""
    rows, columns = image.shape

    def at(i: int, j: int) -> float:
        return float(image[min(max(i, 0), rows - 1), j % columns])

    d_x = d_y = 0.0
    for weight, step in zip(SMOOTHING[kernel], (-1, 0, 1), strict=True):
        d_x += weight * (at(row + step, column + 1) - at(row + step, column - 1))
        d_y += weight * (at(row + 1, column + step) - at(row - 1, column + step))
    return d_x, d_y


def normalise(histograms: Floats, norm: Norm) -> Floats:
    """Normalise per cell, or the descriptor as a whole; EPSILON keeps empty cells finite."""
    if norm == "none":
        return histograms
    if norm == "global-l2":
        return histograms / (np.linalg.norm(histograms) + EPSILON)
    order = 2 if norm == "cell-l2" else 1
    sizes: Floats = np.linalg.norm(histograms, ord=order, axis=1, keepdims=True)
    return histograms / (sizes + EPSILON)
