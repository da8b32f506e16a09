"""Holistic HOG descriptors of a panorama (sections 3.1 and 6.1 of Román et al., doi 10.3390/app10186480).

Gradient magnitudes vote for the bin of their angle. The position descriptor has one histogram per band of rows, of full
width; the orientation descriptor one per window of columns, of full height, windows overlapping and wrapping around.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Literal

import cv2
import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

from omnieval.descriptors.description import Description, with_neutral_cells
from omnieval.errors import ConfigError

_VOTE_UNIT = 2.0**-20
"""Votes are multiples of this, so that their sums are exact in double precision whatever the order of the pixels: a
rolled panorama gives the same position descriptor to the bit."""


class HogSettings(BaseModel):
    """Parameters of `Hog`; the defaults are the paper's where it states them."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    bins: int = Field(16, ge=2, le=256, description="bins of a histogram")
    position_cells: int = Field(16, ge=1, le=1024, description="bands of rows of the position descriptor")
    orientation_cells: int = Field(256, ge=4, le=4096, description="windows of columns of the orientation descriptor")
    orientation_width: int = Field(16, ge=1, le=1024, description="width of such a window in pixels")
    orientation_range: Literal["signed", "unsigned"] = Field(
        "signed", description="angles over 360 degrees, or over 180 without the sign of the contrast"
    )
    kernel: Literal["central", "sobel"] = Field("central", description="gradient by [-1 0 1], or Sobel 3 x 3")
    binning: Literal["hard", "linear"] = Field(
        "hard", description="a vote goes to its bin, or is shared with the nearest one"
    )
    normalisation: Literal["cell-l2", "none", "cell-l1", "global-l2"] = Field(
        "cell-l2", description="h / (||h||_2 + 0.01) per histogram, none, h / (||h||_1 + 0.01), or of the whole vector"
    )


@dataclass(frozen=True)
class _Votes:
    """For every gradient (D_x, D_y), as a flat table: the bin it votes for and with how much, once or twice."""

    bins: tuple[NDArray[np.intp], ...]
    weights: tuple[NDArray[np.float64], ...]


class Hog:
    """Describes a panorama by histograms of oriented gradients; implements `Descriptor`."""

    name = "hog"
    Settings = HogSettings

    def __init__(self, settings: HogSettings | None = None) -> None:
        self.settings = settings or HogSettings()
        self._reach = 255 if self.settings.kernel == "central" else 1020
        self._votes = _tabulate(self.settings, self._reach)

    def describe(self, panorama: NDArray[np.uint8]) -> Description:
        """Describe a panorama, shape (rows, columns).

        Raises
        ------
        ConfigError
            If its size is not divisible into cells, or a cell would be wider than the panorama.
        """
        return self._describe(panorama, None)

    def describe_masked(self, panorama: NDArray[np.uint8], seen: NDArray[np.bool_]) -> Description:
        """Describe the seen pixels of a panorama; see `description.MaskedDescriptor`.

        A histogram is that of its seen pixels, times the cell's size over their number. A band without any is zero.

        Raises
        ------
        ConfigError
            See `describe`.
        """
        return self._describe(panorama, seen)

    def _describe(self, panorama: NDArray[np.uint8], seen: NDArray[np.bool_] | None) -> Description:
        config = self.settings
        rows, columns = panorama.shape
        if rows % config.position_cells or columns % config.orientation_cells:
            raise ConfigError(
                f"a panorama of {rows} x {columns} pixels is not divisible into {config.position_cells} bands of rows "
                f"and {config.orientation_cells} columns; set imaging.rows and imaging.columns to multiples"
            )
        if config.orientation_width > columns:
            raise ConfigError(
                f"cells {config.orientation_width} columns wide do not fit a panorama of {columns}; lower "
                "hog.orientation_width"
            )
        stride = columns // config.orientation_cells
        strip = math.gcd(stride, config.orientation_width)
        by_band, by_strip = self._histograms(panorama, strip, seen)
        across = stride // strip, config.orientation_width // strip
        orientation = _windows(by_strip, *across)
        if seen is None:
            orientation = _normalise(orientation, config.normalisation)
        else:
            bands = seen.reshape(config.position_cells, -1).mean(axis=1)
            by_band = by_band / np.maximum(bands, 1e-9)[:, np.newaxis]
            strips = seen.mean(axis=0).reshape(-1, strip).mean(axis=1)
            share = _windows(strips[:, np.newaxis], *across)[:, 0] / across[1]
            orientation = orientation / np.maximum(share, 1e-9)[:, np.newaxis]
            orientation = _normalised_about(orientation, share, config.normalisation)
        return Description(
            _normalise(by_band, config.normalisation).ravel().astype(np.float32),
            orientation.astype(np.float32),
        )

    def _histograms(
        self, panorama: NDArray[np.uint8], strip: int, seen: NDArray[np.bool_] | None
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the histograms of every band of rows and of every strip of columns, of seen pixels only.

        Shapes (bands, bins) and (columns / strip, bins). What both are sums of is counted once.
        """
        rows, columns = panorama.shape
        bands, bins = self.settings.position_cells, self.settings.bins
        gradient = _gradients(panorama, self.settings.kernel, self._reach).ravel()
        places = _places(rows, columns, bands, strip, bins)
        shape = bands, columns // strip, bins
        together = np.zeros(shape)
        for bin_of, weight_of in zip(self._votes.bins, self._votes.weights, strict=True):
            weights = weight_of.take(gradient)
            if seen is not None:
                weights *= seen.ravel()
            votes = np.bincount(places + bin_of.take(gradient), weights, together.size)
            together += votes.reshape(shape)
        return np.einsum("rcb->rb", together), together.sum(axis=0)


@lru_cache(maxsize=4)
def _places(rows: int, columns: int, bands: int, strip: int, bins: int) -> NDArray[np.intp]:
    """Return where the histogram that a pixel votes in begins, for pixels row by row."""
    band, of_strip = np.arange(rows) // (rows // bands), np.arange(columns) // strip
    places: NDArray[np.intp] = bins * (band[:, np.newaxis] * (columns // strip) + of_strip)
    return places.ravel()


def _gradients(panorama: NDArray[np.uint8], kernel: Literal["central", "sobel"], reach: int) -> NDArray[np.intp]:
    """Return where the votes of every pixel's gradient stand in the tables.

    D_x is circular in columns, at the border of D_y rows are replicated; both are exact integers.
    """
    padded = cv2.copyMakeBorder(panorama, 1, 1, 0, 0, cv2.BORDER_REPLICATE)
    padded = cv2.copyMakeBorder(padded, 0, 0, 1, 1, cv2.BORDER_WRAP)
    smooth = np.array([0.0, 1.0, 0.0] if kernel == "central" else [1.0, 2.0, 1.0])
    across = np.outer(smooth, [-1.0, 0.0, 1.0])
    # Both components in one number, which single precision holds exactly.
    pitch = 2 * reach + 1
    place = cv2.filter2D(padded, cv2.CV_32F, pitch * across + across.T, delta=reach * (pitch + 1))
    return place[1:-1, 1:-1].astype(np.intp)


@lru_cache(maxsize=1)
def _tabulate(config: HogSettings, reach: int) -> _Votes:
    """Decide every possible gradient once, in double precision: many angles lie exactly on the border of two bins."""
    values = np.arange(-reach, reach + 1, dtype=np.float64)
    dx, dy = np.meshgrid(values, values, indexing="ij")
    magnitude = np.hypot(dx, dy).ravel()
    full = 2.0 * np.pi if config.orientation_range == "signed" else np.pi
    place = np.mod(np.arctan2(dy, dx).ravel(), full) / full * config.bins
    if config.binning == "hard":
        return _Votes((np.floor(place).astype(np.intp) % config.bins,), (_quantised(magnitude),))
    lower = np.floor(place - 0.5)
    share = place - 0.5 - lower
    bins = tuple((lower + offset).astype(np.intp) % config.bins for offset in (0, 1))
    upper = _quantised(magnitude * share)
    return _Votes(bins, (_quantised(magnitude) - upper, upper))


def _quantised(votes: NDArray[np.float64]) -> NDArray[np.float64]:
    quantised: NDArray[np.float64] = np.rint(votes / _VOTE_UNIT) * _VOTE_UNIT
    return quantised


def _windows(by_strip: NDArray[np.float64], stride: int, width: int) -> NDArray[np.float64]:
    """Sum histograms over circular windows that begin at every `stride`-th one."""
    sums = np.cumsum(np.concatenate([np.zeros_like(by_strip[:1]), by_strip, by_strip[:width]]), axis=0)
    count = len(by_strip) // stride
    windows: NDArray[np.float64] = sums[width::stride][:count] - sums[::stride][:count]
    return windows


def _normalised_about(histograms: NDArray[np.float64], share: NDArray[np.float64], kind: str) -> NDArray[np.float64]:
    """Normalise the histograms of cells of which only some are seen; those that are not are neutral."""
    if kind == "global-l2":
        return _normalise(with_neutral_cells(histograms, share), kind)
    return with_neutral_cells(_normalise(histograms, kind), share)


def _normalise(histograms: NDArray[np.float64], kind: str) -> NDArray[np.float64]:
    if kind == "none":
        return histograms
    if kind == "global-l2":
        # Summed exactly, so that it does not depend on where the panorama begins either.
        norm: Any = math.sqrt(math.fsum(np.square(histograms).ravel().tolist()))
    else:
        norm = np.linalg.norm(histograms, ord=2 if kind == "cell-l2" else 1, axis=1, keepdims=True)
    normalised: NDArray[np.float64] = histograms / (norm + 0.01)
    return normalised
