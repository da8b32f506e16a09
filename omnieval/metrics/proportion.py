"""Shares of a whole that say how many they were counted over, with their interval."""

from __future__ import annotations

import math
from dataclasses import dataclass

_Z = 1.959963984540054
"""The 97.5 % quantile of the normal distribution."""


@dataclass(frozen=True, slots=True)
class Proportion:
    """A count out of a total, such as 8 of 10.

    Examples
    --------
    >>> Proportion(8, 10).value
    0.8
    >>> [round(end, 3) for end in Proportion(8, 10).interval]
    [0.49, 0.943]
    """

    hits: int
    count: int

    @property
    def value(self) -> float | None:
        """The share; None of nothing."""
        return self.hits / self.count if self.count else None

    @property
    def interval(self) -> tuple[float, float]:
        """Wilson's 95 % interval (1927, doi 10.1080/01621459.1927.10502953); from 0 to 1 of nothing.

        It takes the cases to be independent of each other, which neighbouring images are not.
        """
        if not self.count:
            return 0.0, 1.0
        count, share, square = self.count, self.hits / self.count, _Z * _Z
        middle = (share + square / (2 * count)) / (1 + square / count)
        half = _Z / (1 + square / count) * math.sqrt(share * (1 - share) / count + square / (4 * count * count))
        # At the ends the formula gives them exactly, but for rounding.
        low = 0.0 if self.hits == 0 else max(0.0, middle - half)
        return low, 1.0 if self.hits == count else min(1.0, middle + half)


def harmonic_mean(precision: float | None, recall: float | None) -> float | None:
    """Return F1: None where nothing was to be found, 0 where nothing was found.

    Examples
    --------
    >>> harmonic_mean(0.5, 1.0), harmonic_mean(None, 0.0), harmonic_mean(1.0, None)
    (0.6666666666666666, 0.0, None)
    """
    if recall is None:
        return None
    if not precision or not recall:
        return 0.0
    return 2 * precision * recall / (precision + recall)
