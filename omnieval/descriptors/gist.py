"""Holistic gist descriptors of a panorama (sections 3.2 and 6.1 of Román et al., doi 10.3390/app10186480).

A bank of Gabor filters, evenly spaced in orientation, answers on every resolution level; a descriptor keeps the mean
magnitude of each answer per cell. The filters are those of the reference gist code of A. Oliva and A. Torralba
(*Modeling the shape of the scene*, IJCV 2001, doi 10.1023/A:1011139631724), with frequencies f in cycles per pixel, so
that they hold for a panorama, which is not square::

    G_j(f) = exp(-3.5 (|f| / 0.3 - 1)^2 - 2 pi s wrap(angle(f) + j pi / n)^2),   s = 16 n^2 / 32^2,   j = 0 ... n - 1
    response_j = |IFFT(FFT(I) G_j)|

n orientations (s is 4 for 16 of them), angle(f) = atan2(f_row, f_column), rows downwards. As in the reference code G_j
is not zero at f = 0: without `prefilter` the mean brightness reaches the filters near j = 0 with a weight of 0.03.

Columns are periodic, as a panorama is; rows are mirrored beyond its edges before filtering and cropped afterwards. The
next level is the previous one after a Gaussian low-pass, every second row and column. So a panorama rolled by k columns
has the same position descriptor up to rounding if k is a multiple of 2^(levels - 1), else up to aliasing on the coarser
levels; the orientation descriptor, of full resolution, rolls with it whenever k is a multiple of its stride.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field
from scipy.fft import fft2, fftfreq, ifft, irfft2, rfft2, rfftfreq
from scipy.ndimage import gaussian_filter1d

from omnieval.descriptors.description import Description, with_neutral_cells
from omnieval.errors import ConfigError

_FREQUENCY = 0.3
"""Centre frequency f0 of the filters on every level, cycles per pixel of that level."""

_RADIAL_DECAY = 10 * 0.35

_PREFILTER_CUTOFF = 4 / (256 * np.sqrt(np.log(2)))
"""The reference code's 4 cycles per image, of 256 pixels, in cycles per pixel."""

_PREFILTER_FLOOR = 0.2

_NORM_FLOOR = 0.01
"""Keeps the descriptor of a black image finite."""


class GistSettings(BaseModel):
    """Parameters of `Gist`; the defaults are the paper's where it states them."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    orientations: int = Field(16, ge=2, le=64, description="filters on each level, evenly spaced over 180 degrees")
    levels: int = Field(2, ge=1, le=4, description="resolution levels of the position descriptor, each half the last")
    position_cells: int = Field(16, ge=1, le=1024, description="bands of rows of the position descriptor")
    orientation_cells: int = Field(256, ge=4, le=4096, description="windows of columns of the orientation descriptor")
    orientation_width: int = Field(16, ge=1, le=1024, description="width of such a window in pixels")
    padding: int = Field(16, ge=0, le=128, description="rows mirrored beyond the upper and lower edge of each level")
    lowpass_sigma: float = Field(
        1.0, ge=0.1, le=8, description="standard deviation in pixels of the Gaussian low-pass before a level is halved"
    )
    prefilter: Literal["none", "local-contrast"] = Field(
        "none", description="whiten and divide by the local contrast first, as the reference gist code does"
    )
    normalisation: Literal["none", "global-l2"] = Field(
        "none", description="none, or each descriptor as a whole: d / (||d||_2 + 0.01)"
    )


class Gist:
    """Describes a panorama by the mean magnitude of Gabor responses; implements `Descriptor`.

    Safe to use from several threads at once.

    Examples
    --------
    >>> import numpy as np
    >>> found = Gist().describe(np.zeros((128, 512), np.uint8))
    >>> found.position.shape, found.orientation.shape
    ((512,), (256, 16))
    """

    name = "gist"
    Settings = GistSettings

    def __init__(self, settings: GistSettings | None = None) -> None:
        self.settings = settings or GistSettings()

    def describe(self, panorama: NDArray[np.uint8]) -> Description:
        """Describe a panorama, shape (rows, columns).

        Returns
        -------
        Position descriptor, shape (levels * position_cells * orientations,), in this order, and orientation
        descriptor, shape (orientation_cells, orientations); grey levels unless normalised.

        Raises
        ------
        ConfigError
            If its size is not divisible into cells on every level.
        """
        return self._describe(panorama, None)

    def describe_masked(self, panorama: NDArray[np.uint8], seen: NDArray[np.bool_]) -> Description:
        """Describe the seen pixels of a panorama; see `description.MaskedDescriptor`.

        A mean is that over the seen pixels of a cell; the filters themselves reach into what is filled in. A band
        without a seen pixel is zero.

        Raises
        ------
        ConfigError
            See `describe`.
        """
        return self._describe(panorama, seen)

    def _describe(self, panorama: NDArray[np.uint8], seen: NDArray[np.bool_] | None) -> Description:
        config = self.settings
        self._check_size(*panorama.shape)
        image = panorama.astype(np.float32)
        if config.prefilter == "local-contrast":
            image = _local_contrast(image, config.padding)
        position = np.empty((config.levels, config.position_cells, config.orientations), np.float32)
        columns = np.empty((config.orientations, panorama.shape[1]), np.float32)
        for level in range(config.levels):
            if level:
                image = _halved(image, config.lowpass_sigma)
            visible = None if seen is None else seen[:: 2**level, :: 2**level]
            for j, response in enumerate(_responses(image, config.orientations, config.padding)):
                magnitude = response if visible is None else response * visible
                position[level, :, j] = magnitude.mean(axis=1).reshape(config.position_cells, -1).mean(axis=1)
                if level == 0:
                    columns[j] = magnitude.mean(axis=0)
            if visible is not None:
                shares = visible.reshape(config.position_cells, -1).mean(axis=1)
                position[level] /= np.maximum(shares, 1e-9)[:, np.newaxis]
        stride = panorama.shape[1] // config.orientation_cells
        orientation = _windows(columns, stride, config.orientation_width)
        if seen is not None:
            share = _windows(seen.mean(axis=0, dtype=np.float32)[np.newaxis], stride, config.orientation_width)
            scaled = orientation.astype(np.float64) / np.maximum(share, 1e-9)
            orientation = with_neutral_cells(scaled, share[:, 0].astype(np.float64)).astype(np.float32)
        return Description(
            _normalised(position.ravel(), config.normalisation), _normalised(orientation, config.normalisation)
        )

    def _check_size(self, rows: int, columns: int) -> None:
        config = self.settings
        scale = 2 ** (config.levels - 1)
        if rows % (config.position_cells * scale) or columns % config.orientation_cells or columns % scale:
            raise ConfigError(
                f"a panorama of {rows} x {columns} pixels is not divisible into {config.position_cells} bands of rows "
                f"on {config.levels} levels and {config.orientation_cells} columns; set imaging.rows to a multiple of "
                f"{config.position_cells * scale} and imaging.columns to one of {config.orientation_cells} and {scale}"
            )


def _responses(image: NDArray[np.float32], orientations: int, padding: int) -> Iterator[NDArray[np.float32]]:
    """Yield the magnitude of every filter's response, shape (rows, columns) each."""
    rows = len(image)
    # The transform of a real image, completed by symmetry: a filter is one-sided, and its response complex.
    spectrum = fft2(_mirrored(image, padding))
    for transfer in _filters(rows + 2 * padding, image.shape[1], orientations):
        # Columns first, so that the mirrored rows are gone before the longer transforms.
        down = ifft(spectrum * transfer, axis=0, overwrite_x=True)[padding : padding + rows]
        yield np.abs(ifft(down, axis=1))


@lru_cache(maxsize=16)
def _filters(rows: int, columns: int, orientations: int) -> NDArray[np.float32]:
    """Return the transfer functions G_j, shape (orientations, rows, columns), built once for each size."""
    down = fftfreq(rows)[:, np.newaxis]
    across = fftfreq(columns)[np.newaxis, :]
    sharpness = 16 * orientations**2 / 32**2
    centres = np.arange(orientations)[:, np.newaxis, np.newaxis] * np.pi / orientations
    turn = np.arctan2(down, across) + centres
    wrapped = turn - 2 * np.pi * np.round(turn / (2 * np.pi))
    radial = _RADIAL_DECAY * (np.hypot(down, across) / _FREQUENCY - 1) ** 2
    filters: NDArray[np.float32] = np.exp(-radial - 2 * np.pi * sharpness * wrapped**2).astype(np.float32)
    filters.setflags(write=False)
    return filters


def _mirrored(image: NDArray[np.float32], padding: int) -> NDArray[np.float32]:
    """Mirror rows beyond the edges; the edge row itself is repeated."""
    return np.pad(image, ((padding, padding), (0, 0)), "symmetric")


def _halved(image: NDArray[np.float32], sigma: float) -> NDArray[np.float32]:
    """Low-pass an image and keep every second row and column, beginning with the first."""
    kept = gaussian_filter1d(image, sigma, axis=0, mode="reflect")[::2]
    smooth: NDArray[np.float32] = gaussian_filter1d(kept, sigma, axis=1, mode="wrap")[:, ::2]
    return smooth


def _local_contrast(image: NDArray[np.float32], padding: int) -> NDArray[np.float32]:
    """Whiten the logarithm of an image and divide it by its local standard deviation (the reference gist code)."""
    rows, columns = image.shape
    padded = _mirrored(np.log1p(image), padding)
    squared = fftfreq(len(padded))[:, np.newaxis] ** 2 + rfftfreq(columns) ** 2
    lowpass = np.exp(-squared / _PREFILTER_CUTOFF**2).astype(np.float32)

    def smooth(signal: NDArray[np.float32]) -> NDArray[np.float32]:
        smoothed: NDArray[np.float32] = irfft2(rfft2(signal) * lowpass, signal.shape)
        return smoothed

    white = padded - smooth(padded)
    contrast: NDArray[np.float32] = np.sqrt(np.abs(smooth(np.square(white))))
    flat: NDArray[np.float32] = np.divide(white, contrast + np.float32(_PREFILTER_FLOOR))
    return flat[padding : padding + rows]


def _windows(columns: NDArray[np.float32], stride: int, width: int) -> NDArray[np.float32]:
    """Average over circular windows that begin at every `stride`-th column; shape (windows, orientations)."""
    count = columns.shape[1]
    wrapped = np.take(columns.astype(np.float64), np.arange(count + width), axis=1, mode="wrap")
    sums = np.concatenate([np.zeros((len(columns), 1)), np.cumsum(wrapped, axis=1)], axis=1)
    starts = np.arange(0, count, stride)
    means: NDArray[np.float32] = ((sums[:, starts + width] - sums[:, starts]) / width).T.astype(np.float32)
    return np.ascontiguousarray(means)


def _normalised(descriptor: NDArray[np.float32], kind: Literal["none", "global-l2"]) -> NDArray[np.float32]:
    if kind == "none":
        return descriptor
    norm = np.float32(np.linalg.norm(descriptor) + _NORM_FLOOR)
    normalised: NDArray[np.float32] = descriptor / norm
    return normalised
