"""gist straight from the formula, in double precision, every pixel and cell by itself: the oracle of `descriptors`."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def gist(
    panorama: NDArray[np.uint8],
    *,
    orientations: int = 16,
    levels: int = 2,
    position_cells: int = 16,
    orientation_cells: int = 256,
    orientation_width: int = 16,
    padding: int = 16,
    lowpass_sigma: float = 1.0,
    prefilter: Literal["none", "local-contrast"] = "none",
    normalisation: Literal["none", "global-l2"] = "none",
) -> tuple[Floats, Floats]:
    """The position (levels, position_cells, orientations) and orientation descriptor (cells, orientations), float64."""
    image = panorama.astype(np.float64)
    if prefilter == "local-contrast":
        image = local_contrast(image, padding)
    position = np.zeros((levels, position_cells, orientations))
    orientation = np.zeros((orientation_cells, orientations))
    for level in range(levels):
        if level > 0:
            image = halved(image, lowpass_sigma)
        rows, columns = image.shape
        height = rows // position_cells
        for j in range(orientations):
            response = magnitude(image, j, orientations, padding)
            for cell in range(position_cells):
                position[level, cell, j] = response[cell * height : (cell + 1) * height].mean()
            if level == 0:
                for cell in range(orientation_cells):
                    start = cell * (columns // orientation_cells)
                    window = [(start + offset) % columns for offset in range(orientation_width)]
                    orientation[cell, j] = response[:, window].mean()
    if normalisation == "global-l2":
        position /= math.sqrt((position**2).sum()) + 0.01
        orientation /= math.sqrt((orientation**2).sum()) + 0.01
    return position, orientation


def magnitude(image: Floats, j: int, orientations: int, padding: int) -> Floats:
    """|IFFT(FFT(I) G_j)| of the image with mirrored rows, cropped."""
    padded = mirrored(image, padding)
    rows, columns = padded.shape
    transfer = np.zeros((rows, columns))
    for row in range(rows):
        for column in range(columns):
            transfer[row, column] = gabor(frequency(row, rows), frequency(column, columns), j, orientations)
    response = np.fft.ifft2(np.fft.fft2(padded) * transfer)
    return np.abs(response)[padding : padding + len(image)]


def gabor(down: float, across: float, j: int, orientations: int) -> float:
    """G_j at one frequency, cycles/pixel down the rows and across the columns."""
    sharpness = 16 * orientations**2 / 32**2
    turn = math.atan2(down, across) + j * math.pi / orientations
    while turn > math.pi:
        turn -= 2 * math.pi
    radius = math.sqrt(down**2 + across**2)
    return math.exp(-10 * 0.35 * (radius / 0.3 - 1) ** 2 - 2 * math.pi * sharpness * turn**2)


def frequency(index: int, size: int) -> float:
    """Frequency of a coefficient of the discrete Fourier transform, in [-0.5, 0.5)."""
    return (index if index < (size + 1) // 2 else index - size) / size


def mirrored(image: Floats, padding: int) -> Floats:
    """Rows continue upwards and downwards as in a mirror on the edge of the image."""
    return np.array([image[reflected(row, len(image))] for row in range(-padding, len(image) + padding)])


def reflected(index: int, size: int) -> int:
    """The index inside the image that a mirrored one shows: -1 shows 0, `size` shows `size` - 1."""
    index %= 2 * size
    return index if index < size else 2 * size - 1 - index


def halved(image: Floats, sigma: float) -> Floats:
    """Every second row and column of the image smoothed by a Gaussian of up to four standard deviations."""
    reach = math.floor(4 * sigma + 0.5)
    kernel = [math.exp(-(offset**2) / (2 * sigma**2)) for offset in range(-reach, reach + 1)]
    rows, columns = image.shape
    half = np.zeros((rows // 2, columns // 2))
    for down, weight_down in zip(range(-reach, reach + 1), kernel, strict=True):
        for across, weight_across in zip(range(-reach, reach + 1), kernel, strict=True):
            taken_rows = [reflected(2 * row + down, rows) for row in range(rows // 2)]
            taken_columns = [(2 * column + across) % columns for column in range(columns // 2)]
            half += weight_down * weight_across * image[np.ix_(taken_rows, taken_columns)]
    return half / sum(kernel) ** 2


def local_contrast(image: Floats, padding: int) -> Floats:
    """The reference gist code's pre-filter, its cut-off of 4 cycles per 256 pixels in cycles per pixel."""
    padded = mirrored(np.log(image + 1), padding)
    rows, columns = padded.shape
    cutoff = 4 / 256 / math.sqrt(math.log(2))
    lowpass = np.array(
        [
            [math.exp(-(frequency(r, rows) ** 2 + frequency(c, columns) ** 2) / cutoff**2) for c in range(columns)]
            for r in range(rows)
        ]
    )
    white = padded - np.fft.ifft2(np.fft.fft2(padded) * lowpass).real
    contrast = np.sqrt(np.abs(np.fft.ifft2(np.fft.fft2(white**2) * lowpass)))
    return np.array(white / (0.2 + contrast))[padding : padding + len(image)]
