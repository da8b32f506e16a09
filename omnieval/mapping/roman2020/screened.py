"""Image-level loop closure by bounds: the best image and whether it stands out, without the whole curve.

Both follow from bounds on the similarities, unless these are too close to call; then `match_image` decides. What is
decided here is therefore what would be decided there. The normalisation of the curves changes neither: the best image
is the maximum of 1 / (d_pos d_ori), and prominences are compared with each other.

How high the peaks of a curve stand out, in sum, is half its total variation, for a curve that begins and ends at 0 and
of whose peaks no two are equally high: then the prominence of a peak is the persistence of its component (Edelsbrunner,
Letscher, Zomorodian, *Topological persistence and simplification*, 2002, doi 10.1007/s00454-002-2885-2). A peak that is
as high as another may count for more, at most for its height.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from omnieval.mapping.memory import ImageMemory
from omnieval.mapping.roman2020.conditions import DISTANCE_FLOOR
from omnieval.mapping.roman2020.matching import laid_out
from omnieval.mapping.roman2020.settings import Roman2020Settings

_ROUNDING = 1e-12
"""Relative: more than similarities in double precision are rounded by."""
_SUMMING = 1e-9
"""Relative: more than sums of prominences are."""


@dataclass(frozen=True)
class ScreenedMatch:
    """What is decided of the most similar image.

    Attributes
    ----------
    best_frame, node, shift
        As in `ImageMatch`.
    """

    best_frame: int
    node: int
    shift: int


@dataclass(frozen=True)
class _Range:
    """Values that are known to be between two, shape (m,) each."""

    low: NDArray[np.float64]
    high: NDArray[np.float64]


def screened_best(
    images: ImageMemory, frame: int, members: Mapping[int, NDArray[np.int64]], candidates: Iterable[int]
) -> ScreenedMatch | None:
    """Return the most similar image; None if that is too close to call. See `match_image`."""
    found = _screened(images, frame, members, candidates)
    return None if found is None else found[0]


def screened_match(
    images: ImageMemory,
    frame: int,
    members: Mapping[int, NDArray[np.int64]],
    candidates: Iterable[int],
    settings: Roman2020Settings,
) -> tuple[ScreenedMatch, bool] | None:
    """Return the most similar image and whether it is prominent; None if either is too close to call.

    Parameters
    ----------
    images
        The descriptors of all images so far, which are screened.
    frame, members, candidates
        See `match_image`.
    settings
        `prominence_mean`, `gamma` and `single_peak` are read.
    """
    found = _screened(images, frame, members, candidates)
    if found is None:
        return None
    match, similarity, slots, total, height = found
    prominent = _prominent(similarity, slots, total, height, settings)
    return None if prominent is None else (match, prominent)


def _screened(
    images: ImageMemory, frame: int, members: Mapping[int, NDArray[np.int64]], candidates: Iterable[int]
) -> tuple[ScreenedMatch, _Range, NDArray[np.int64], int, tuple[float, float]] | None:
    """Return the most similar image, the range of all similarities, where they stand, and the range of the largest."""
    layout = laid_out(members, candidates)
    similarity = _similarities(images, frame, layout.frames)
    if not np.isfinite(similarity.high).all():
        return None
    close = np.flatnonzero(similarity.high >= similarity.low.max())
    exact = images.compare(frame, layout.frames[close])
    distances = np.maximum(exact.position, DISTANCE_FLOOR) * np.maximum(exact.orientation, DISTANCE_FLOOR)
    equal = np.flatnonzero(distances <= distances.min() * (1.0 + _ROUNDING))
    first = int(equal[0])
    if (exact.position[equal] != exact.position[first]).any() or (
        exact.orientation[equal] != exact.orientation[first]
    ).any():
        return None
    best = int(close[first])
    largest = 1.0 / float(distances[first])
    match = ScreenedMatch(int(layout.frames[best]), layout.node_of(best), int(exact.shifts[first]))
    values = 1.0 / distances
    similarity.low[close], similarity.high[close] = values * (1.0 - _ROUNDING), values * (1.0 + _ROUNDING)
    return match, similarity, layout.slots, layout.total, (largest * (1.0 - _ROUNDING), largest * (1.0 + _ROUNDING))


def _similarities(images: ImageMemory, frame: int, frames: NDArray[np.int64]) -> _Range:
    """Return the range of 1 / (d_pos d_ori) of an image and others."""
    bounds = images.bounds(frame, frames)
    far = np.maximum(bounds.position_high, DISTANCE_FLOOR) * np.maximum(bounds.orientation_high, DISTANCE_FLOOR)
    near = np.maximum(bounds.position_low, DISTANCE_FLOOR) * np.maximum(bounds.orientation_low, DISTANCE_FLOOR)
    return _Range((1.0 - _ROUNDING) / far, (1.0 + _ROUNDING) / near)


def _prominent(
    similarity: _Range,
    slots: NDArray[np.int64],
    total: int,
    height: tuple[float, float],
    settings: Roman2020Settings,
) -> bool | None:
    """Return whether the best match stands out; None if that is too close to call.

    Parameters
    ----------
    similarity
        Of the m candidate images, shape (m,).
    slots, total
        Where they stand on the curve, and its length; see `conditions.prominence`.
    height
        Range of the largest similarity: no value is higher and the curve ends at 0, so that it is its prominence.
    settings
        See `screened_match`.
    """
    middle, radius = np.zeros(total + 2), np.zeros(total + 2)
    middle[slots + 1] = (similarity.low + similarity.high) / 2.0
    radius[slots + 1] = (similarity.high - similarity.low) / 2.0
    peaks, unsure = _count_peaks(middle, radius)
    if peaks + unsure < 2:
        return settings.single_peak == "accept"
    if peaks - unsure < 2:
        return None
    summed = float(np.maximum(np.diff(middle), 0.0).sum())
    slack = float(radius.sum())
    least = (summed - slack) * (1.0 - _SUMMING)
    most = (summed + slack + _more_for_ties(middle, radius)) * (1.0 + _SUMMING)
    fewest, highest = (peaks - unsure, peaks + unsure) if settings.prominence_mean == "peaks" else (len(slots),) * 2
    if height[0] * fewest >= settings.gamma * most:
        return True
    if height[1] * highest < settings.gamma * least:
        return False
    return None


def _count_peaks(middle: NDArray[np.float64], radius: NDArray[np.float64]) -> tuple[int, int]:
    """Return the number of peaks of a curve, and by how many it may differ for other values within the radius.

    Every neighbours whose order is not known make at most one peak more or less: there are as many peaks as changes
    from rising to falling.
    """
    steps = np.diff(middle)
    unsure = np.abs(steps) <= radius[1:] + radius[:-1]
    unsure &= (radius[1:] > 0.0) | (radius[:-1] > 0.0)
    signs = np.sign(steps)
    signs = signs[signs != 0.0]
    return int(((signs[:-1] > 0.0) & (signs[1:] < 0.0)).sum()), int(unsure.sum())


def _more_for_ties(middle: NDArray[np.float64], radius: NDArray[np.float64]) -> float:
    """Return by how much the prominences may exceed half the total variation, as some peaks may be equally high."""
    low, high = middle - radius, middle + radius
    may_be = (high[1:-1] > 0.0) & (high[1:-1] >= low[:-2]) & (high[1:-1] >= low[2:])
    low, high = low[1:-1][may_be], high[1:-1][may_be]
    order = np.argsort(low, kind="stable")
    low, high = low[order], high[order]
    tied = np.zeros(len(low), np.bool_)
    touching = low[1:] <= np.maximum.accumulate(high)[:-1]
    tied[1:] |= touching
    tied[:-1] |= touching
    return float(high[tied].sum())
