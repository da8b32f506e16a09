"""A mean with its interval, over cases that are independent of each other: sequences, or replicates of one."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from omnieval.seeding import named_generator

RESAMPLES = 2000
FEWEST = 5
"""Cases that an interval needs: of fewer, no resampling reaches as far as it should."""
CONFIDENCE = 0.95


@dataclass(frozen=True, slots=True)
class Estimate:
    """A value, its 95 % interval and over how many cases it is taken.

    Attributes
    ----------
    value
        None of no cases.
    low, high
        None where there are too few cases for an interval.
    n
        How many cases.
    """

    value: float | None
    low: float | None
    high: float | None
    n: int


def mean_estimate(values: NDArray[np.float64], *, seed: int = 0) -> Estimate:
    """Return the mean of independent values with a bootstrap interval (expanded percentile, `RESAMPLES` resamples).

    Parameters
    ----------
    values
        One a case, shape (n,), all finite.
    seed
        Root seed; equal values and seed give equal intervals.
    """
    count = len(values)
    value = float(values.mean()) if count else None
    if count < FEWEST:
        return Estimate(value, None, None, count)
    drawn = named_generator(seed, "bootstrap").integers(count, size=(RESAMPLES, count))
    low, high = ends(values[drawn].mean(axis=1), count)
    return Estimate(value, low, high, count)


def ends(resampled: NDArray[np.float64], cases: float, wider: float = 1.0) -> tuple[float, float]:
    """Return the ends of the interval that resampled values give; see `tail`.

    Parameters
    ----------
    resampled
        The value of each resample, shape (resamples,).
    cases
        How many independent cases were resampled.
    wider
        By how much the resampled values spread too little.
    """
    share = tail(cases, wider)
    low, high = np.quantile(resampled, [share, 1 - share])
    return float(low), float(high)


def tail(cases: float, wider: float = 1.0) -> float:
    """Return the share of resamples beyond each end of a percentile interval, so that it covers 95 %.

    Resamples of few cases spread less than samples do, and by how much is known of means: the percentiles are taken
    further out by sqrt(n / (n - 1)) and by Student's t in place of the normal distribution (Hesterberg 2015,
    doi 10.1080/00031305.2015.1089789, "expanded percentile").

    Parameters
    ----------
    cases
        How many are independent, more than 1.
    wider
        Another factor by which it is to be further out.
    """
    from scipy.stats import norm, t

    student = t.ppf((1 - CONFIDENCE) / 2, cases - 1)
    return float(norm.cdf(wider * student * math.sqrt(cases / (cases - 1))))
