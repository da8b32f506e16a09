"""Two methods on the same cases: by how much one is better, and whether that could be chance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from omnieval.statistics.estimate import Estimate, mean_estimate

_TABLED = 50
"""Pairs without ties up to which the p-value is exact."""
_ENUMERATED = 12
"""The same with ties."""


@dataclass(frozen=True, slots=True)
class Difference:
    """One method minus the other, pair by pair.

    Attributes
    ----------
    mean
        Of the differences, with its interval; `n` pairs.
    p
        Of Wilcoxon's signed rank test, two-sided; None of no pairs.
    effect
        Rank-biserial correlation, from -1 to 1: by how much the ranks of the pairs in which the one is higher outweigh
        those in which the other is (Kerby 2014, doi 10.2466/11.IT.3.1); None of no pairs.
    """

    mean: Estimate
    p: float | None
    effect: float | None


def paired_difference(one: NDArray[np.float64], other: NDArray[np.float64], *, seed: int = 0) -> Difference:
    """Compare two methods on the same cases.

    Parameters
    ----------
    one, other
        A value per case, shape (n,), all finite.
    seed
        Root seed of the interval.
    """
    differences = one - other
    mean = mean_estimate(differences, seed=seed)
    if not len(differences):
        return Difference(mean, None, None)
    different = differences[differences != 0]
    if not len(different):
        return Difference(mean, 1.0, 0.0)
    from scipy.stats import PermutationMethod, rankdata, wilcoxon

    ranks = rankdata(np.abs(different))
    tied = len(np.unique(np.abs(different))) < len(different)
    method: Any = "approx" if tied or len(different) > _TABLED else "exact"
    if tied and len(different) <= _ENUMERATED:
        method = PermutationMethod(n_resamples=2**_ENUMERATED)  # all signs, in place of a table that knows no ties
    p = wilcoxon(different, method=method).pvalue
    return Difference(mean, float(p), float((ranks * np.sign(different)).sum() / ranks.sum()))


def holm(ps: Sequence[float | None]) -> list[float | None]:
    """Return the p-values of a family of tests, adjusted as Holm (1979) does; None stays None and is not a test.

    Examples
    --------
    >>> holm([0.01, 0.04, None, 0.03])
    [0.03, 0.06, None, 0.06]
    """
    tests = sorted((p, place) for place, p in enumerate(ps) if p is not None)
    adjusted: list[float | None] = [None] * len(ps)
    highest = 0.0
    for done, (p, place) in enumerate(tests):
        highest = max(highest, min(1.0, p * (len(tests) - done)))
        adjusted[place] = highest
    return adjusted
