"""How far apart two images were taken, in frames of usual travel, from their distance alone.

Images become unlike at a pace that depends on descriptor, building and speed. The sequence itself shows it: the median
distance between images that are 1, 2, 3, 5, ... frames apart is a curve that turns any distance back into frames.
"""

from __future__ import annotations

import math
from bisect import insort
from copy import copy
from typing import Self

import numpy as np
from numpy.typing import NDArray

LAGS = (1, 2, 3, 5, 8, 13, 21, 34)
"""Frames between the images that the curve is made of."""

_LEAST, _MOST = 0.05, 2.0
"""Frames between successive images: never nothing, so that no two places are the same; no leap by one odd image."""

_STILL = 0.5
"""Successive images that are less unlike than this, relative to the median, were taken standing still."""


class RunningMedian:
    """The median of the numbers so far."""

    def __init__(self) -> None:
        self._sorted: list[float] = []

    def __bool__(self) -> bool:
        return bool(self._sorted)

    def add(self, number: float) -> None:
        """Add a number."""
        insort(self._sorted, number)

    @property
    def value(self) -> float:
        """The median; of an even count, the mean of the middle two."""
        middle = len(self._sorted) // 2
        return (self._sorted[middle] + self._sorted[~middle]) / 2

    def copied(self) -> Self:
        """Return an independent copy."""
        other = copy(self)
        other._sorted = self._sorted.copy()
        return other


class Odometer:
    """Turns distances of images into frames of travel.

    Attributes
    ----------
    travelled
        Frames of travel so far: a pause adds next to nothing.
    """

    def __init__(self) -> None:
        self.travelled = 0.0
        self._medians = [RunningMedian() for _ in LAGS]
        self._curve: NDArray[np.float64] = np.array([0.0])

    def add(self, distances: NDArray[np.float64]) -> float:
        """Take in how far an image is from those `LAGS` before it, as many as there are, shape (at most 8,).

        Returns
        -------
        The travel since the image before. What a distance says of so short a way is half noise: it is halved on a
        logarithmic scale.
        """
        for median, distance in zip(self._medians, distances.tolist(), strict=False):
            median.add(distance)
        known = [median.value for median in self._medians if median]
        # Farther apart is never nearer; where the medians say otherwise, they say nothing.
        self._curve = np.concatenate([[0.0], np.maximum.accumulate(known)])
        moved = distances[0] > _STILL * self.step
        travel = math.sqrt(min(self.frames(distances[0]), _MOST)) if moved else _LEAST
        self.travelled += travel
        return travel

    def frames(self, distance: float | np.floating) -> float:
        """Return the frames of travel between images at a distance: never nothing, at most the largest known lag."""
        if distance <= 0.0:
            return _LEAST
        lags = (0, *LAGS)[: len(self._curve)]
        return max(float(np.interp(distance, self._curve, lags)), _LEAST)

    @property
    def step(self) -> float:
        """Median distance of successive images."""
        return self._medians[0].value

    def copied(self) -> Self:
        """Return an independent copy."""
        other = copy(self)
        other._medians = [median.copied() for median in self._medians]
        return other
