"""Many methods on the same cases: their mean ranks, and which of them cannot be distinguished."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

SIGNIFICANT = 0.05


@dataclass(frozen=True)
class Ranking:
    """Mean ranks, 1 the best.

    Attributes
    ----------
    ranks
        Of each method over the cases, shape (k,).
    cases
        Over how many cases.
    p
        Of Friedman's test that all methods are alike; None of fewer than three methods or two cases.
    """

    ranks: tuple[float, ...]
    cases: int
    p: float | None


def mean_ranks(values: NDArray[np.float64], *, higher_is_better: bool) -> Ranking:
    """Rank methods case by case, ties sharing their ranks (Demšar 2006, jmlr.org/papers/v7/demsar06a.html).

    Parameters
    ----------
    values
        Of every case and method, shape (cases, k), all finite; at least one case.
    higher_is_better
        Which way is better.
    """
    from scipy.stats import friedmanchisquare, rankdata

    ranks = rankdata(-values if higher_is_better else values, axis=1)
    cases, methods = values.shape
    p = None
    if methods > 2 and cases > 1:
        # All ranks equal: nothing speaks against the methods being alike, and the statistic is 0 / 0.
        p = 1.0 if (ranks == ranks[0, 0]).all() else float(friedmanchisquare(*values.T).pvalue)
    return Ranking(tuple(ranks.mean(axis=0).tolist()), cases, p)


def cliques(ranks: Sequence[float], told_apart: NDArray[np.bool_]) -> list[tuple[int, ...]]:
    """Return the largest sets of methods, neighbours by rank, of which no two can be distinguished.

    They are what the bars of a critical-difference diagram join. Which are distinguished is said by paired tests, not
    by the mean ranks, which depend on what other methods take part (Benavoli et al. 2016,
    jmlr.org/papers/v17/benavoli16a.html).

    Parameters
    ----------
    ranks
        Mean rank of each method, length k.
    told_apart
        Whether two methods differ significantly, shape (k, k), symmetric.

    Examples
    --------
    >>> cliques([1.0, 2.0, 3.0], np.array([[0, 0, 1], [0, 0, 0], [1, 0, 0]], bool))
    [(0, 1), (1, 2)]
    """
    order = sorted(range(len(ranks)), key=lambda method: ranks[method])
    found: list[tuple[int, ...]] = []
    reached = 0
    for first in range(len(order)):
        last = first
        while last + 1 < len(order) and not told_apart[order[last + 1], order[first : last + 1]].any():
            last += 1
        if last > first and last >= reached + 1:
            found.append(tuple(order[first : last + 1]))
            reached = last
    return found
