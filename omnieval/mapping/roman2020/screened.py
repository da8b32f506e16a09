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

from omnieval.descriptors.screened_store import Bounds
from omnieval.descriptors.tiles import TILE
from omnieval.mapping.memory import ImageMemory
from omnieval.mapping.roman2020.conditions import DISTANCE_FLOOR
from omnieval.mapping.roman2020.matching import Layout, laid_out
from omnieval.mapping.roman2020.settings import Roman2020Settings

_ROUNDING = 1e-12
"""Relative: more than similarities in double precision are rounded by."""
_SUMMING = 1e-9
"""Relative: more than sums of prominences are."""
_FIRST_TILES = 8
"""Tiles to look for the best image in first; then ever more at once."""
_LESS = 0.7
"""What a decision begins with, of what the last one took."""


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


class Effort:
    """How much of the candidates was screened for the last decisions: the next begins with somewhat less."""

    def __init__(self) -> None:
        self.share = 1.0

    def note(self, share: float) -> None:
        """Take in how much it took."""
        self.share = _LESS * share


def screened_best(
    images: ImageMemory, frame: int, members: Mapping[int, NDArray[np.int64]], candidates: Iterable[int]
) -> ScreenedMatch | None:
    """Return the most similar image; None if that is too close to call. See `match_image`."""
    curve = _Curve(images, frame, laid_out(members, candidates))
    return curve.best()


def screened_match(
    images: ImageMemory,
    frame: int,
    members: Mapping[int, NDArray[np.int64]],
    candidates: Iterable[int],
    settings: Roman2020Settings,
    effort: Effort,
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
    effort
        What it took before.
    """
    layout = laid_out(members, candidates)
    curve = _Curve(images, frame, layout)
    match = curve.best()
    if match is None:
        return None
    share = effort.share
    while True:
        curve.screen(share)
        prominent = _prominent(curve.similarity, layout.slots, layout.total, curve.height, settings)
        if prominent is not None or share >= 1.0:
            break
        share = 2.0 * share
    effort.note(min(share, 1.0))
    if prominent is None:
        # Most often it is open how many peaks there are, which some neighbours on the curve decide.
        for closely in (_unordered(curve.similarity, layout.slots, layout.total), np.arange(len(layout.frames))):
            curve.narrow(closely)
            prominent = _prominent(curve.similarity, layout.slots, layout.total, curve.height, settings)
            if prominent is not None:
                break
    return None if prominent is None else (match, prominent)


class _Curve:
    """What is known of the similarities of an image and all images of some nodes, which is ever more.

    Attributes
    ----------
    similarity
        Range of 1 / (d_pos d_ori) of the m images.
    height
        Range of the largest of them.
    """

    def __init__(self, images: ImageMemory, frame: int, layout: Layout) -> None:
        self._images, self._frame, self._layout = images, frame, layout
        self.similarity = _similarities(images.glance(frame, layout.frames))
        self.height = 0.0, np.inf
        tiles, self._tile_of = np.unique(layout.frames // TILE, return_inverse=True)
        self._screened = np.zeros(len(tiles), np.bool_)
        self._narrowed: NDArray[np.int64] = np.zeros(0, np.int64)

    def best(self) -> ScreenedMatch | None:
        """Return the most similar image; None if that is too close to call."""
        low, high = self.similarity.low, self.similarity.high
        at_once = _FIRST_TILES
        while True:
            highest = np.zeros(len(self._screened))
            np.maximum.at(highest, self._tile_of, high)
            hopeful = np.flatnonzero(~self._screened & (highest >= low.max()))
            if not len(hopeful):
                break
            self._screen(hopeful[np.argsort(-highest[hopeful], kind="stable")[:at_once]])
            at_once *= 2
        close = np.flatnonzero(high >= low.max())
        exact = self._images.compare(self._frame, self._layout.frames[close])
        distances = np.maximum(exact.position, DISTANCE_FLOOR) * np.maximum(exact.orientation, DISTANCE_FLOOR)
        equal = np.flatnonzero(distances <= distances.min() * (1.0 + _ROUNDING))
        first = int(equal[0])
        if (exact.position[equal] != exact.position[first]).any() or (
            exact.orientation[equal] != exact.orientation[first]
        ).any():
            return None
        low[close], high[close] = (1.0 - _ROUNDING) / distances, (1.0 + _ROUNDING) / distances
        self._narrowed = close
        best = int(close[first])
        self.height = float(low[best]), float(high[best])
        return ScreenedMatch(int(self._layout.frames[best]), self._layout.node_of(best), int(exact.shifts[first]))

    def screen(self, share: float) -> None:
        """Screen at least a share of the tiles, those first of whose similarities most is unknown."""
        wanted = int(np.ceil(share * len(self._screened))) - int(self._screened.sum())
        if wanted > 0:
            unknown = np.bincount(self._tile_of, self.similarity.high - self.similarity.low, len(self._screened))
            left = np.flatnonzero(~self._screened)
            self._screen(left[np.argsort(-unknown[left], kind="stable")[:wanted]])

    def narrow(self, which: NDArray[np.int64]) -> None:
        """Bound some similarities within rounding, but those that are known better."""
        at = np.setdiff1d(which, self._narrowed)
        self._narrowed = np.union1d(self._narrowed, at)
        found = _similarities(self._images.narrow(self._frame, self._layout.frames[at]))
        self.similarity.low[at], self.similarity.high[at] = found.low, found.high

    def _screen(self, tiles: NDArray[np.int64]) -> None:
        self._screened[tiles] = True
        chosen = np.zeros(len(self._screened), np.bool_)
        chosen[tiles] = True
        at = np.flatnonzero(chosen[self._tile_of])
        found = _similarities(self._images.bounds(self._frame, self._layout.frames[at]))
        known = np.zeros(len(self._tile_of), np.bool_)
        known[self._narrowed] = True
        new = ~known[at]
        self.similarity.low[at[new]], self.similarity.high[at[new]] = found.low[new], found.high[new]


def _similarities(bounds: Bounds) -> _Range:
    """Return the range of 1 / (d_pos d_ori)."""
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
    middle, radius = _on_curve(similarity, slots, total)
    fewest, most_peaks = _count_peaks(middle, radius)
    if most_peaks < 2:
        return settings.single_peak == "accept"
    if fewest < 2:
        return None
    summed = float(np.maximum(np.diff(middle), 0.0).sum())
    slack = float(radius.sum())
    least = (summed - slack) * (1.0 - _SUMMING)
    most = (summed + slack + _more_for_ties(middle, radius)) * (1.0 + _SUMMING)
    if settings.prominence_mean == "candidates":
        fewest = most_peaks = len(slots)
    if height[0] * fewest >= settings.gamma * most:
        return True
    if height[1] * most_peaks < settings.gamma * least:
        return False
    return None


def _on_curve(
    similarity: _Range, slots: NDArray[np.int64], total: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the middle of the range at every place of a curve that begins and ends at 0, and half its width."""
    middle, radius = np.zeros(total + 2), np.zeros(total + 2)
    middle[slots + 1] = (similarity.low + similarity.high) / 2.0
    radius[slots + 1] = (similarity.high - similarity.low) / 2.0
    return middle, radius


def _unordered(similarity: _Range, slots: NDArray[np.int64], total: int) -> NDArray[np.int64]:
    """Return which candidates may be higher or lower than a neighbour on the curve."""
    unsure = _unsure(*_on_curve(similarity, slots, total))
    beside = np.zeros(total + 2, np.bool_)
    beside[1:] |= unsure
    beside[:-1] |= unsure
    return np.flatnonzero(beside[slots + 1])


def _unsure(middle: NDArray[np.float64], radius: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return at which places of a curve it is not known whether the next one is higher or lower."""
    unsure: NDArray[np.bool_] = np.abs(np.diff(middle)) <= radius[1:] + radius[:-1]
    return unsure & ((radius[1:] > 0.0) | (radius[:-1] > 0.0))


def _count_peaks(middle: NDArray[np.float64], radius: NDArray[np.float64]) -> tuple[int, int]:
    """Return how many peaks a curve has at least and at most, for all values within the radius.

    There are as many peaks as changes from rising to falling. Those of the neighbours whose order is known are there
    whatever the order of the others, of which every two make at most one peak more.
    """
    unsure = _unsure(middle, radius)
    signs = np.sign(np.diff(middle)[~unsure])
    signs = signs[signs != 0.0]
    fewest = int(((signs[:-1] > 0.0) & (signs[1:] < 0.0)).sum())
    return fewest, fewest + int(unsure.sum())


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
