"""The contract of metrics."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable

import numpy as np

from omnieval.metrics.metric import Judged
from omnieval.testing.contract import require, same


def check_metric(compute: Callable[[Judged], float | int | str]) -> None:
    """Check that the function of a metric keeps its contract.

    - It returns a finite number, or one sentence that says why there is none; never NaN, None or an empty text. Maps
      without a node, without a known position, room or time, and of a single image are included.
    - Pure: what it is given is not changed, and the same map gives the same value.
    - What nodes are called does not matter: only which images share one.

    Parameters
    ----------
    compute
        The function under test; see `omnieval.Judged`.

    Raises
    ------
    AssertionError
        At the first clause that does not hold.
    """
    for what, judged in _maps().items():
        labels, positions = judged.labels.copy(), judged.positions.copy()
        value = compute(judged)
        require(
            (isinstance(value, str) and bool(value.strip()) and "\n" not in value)
            or (isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)),
            f"{what}: a metric must be a finite number, or a sentence that says why there is none, got {value!r}",
        )
        require(
            same(judged.labels, labels) and same(judged.positions, positions),
            f"{what}: a metric must not change what it is given",
        )
        require(same(compute(judged), value), f"{what}: a metric must be the same twice")
        renamed = np.where(labels > 0, 10 + 7 * (labels.max(initial=0) - labels), 0)
        other = compute(dataclasses.replace(judged, labels=renamed))
        require(
            other == value if isinstance(value, str) else not isinstance(other, str) and math.isclose(other, value),
            f"{what}: a metric must not depend on the numbers of nodes, but went from {value!r} to {other!r}",
        )


def _maps() -> dict[str, Judged]:
    """Return a usual map, and those that lack something."""
    rng = np.random.default_rng(0)
    count = 60
    whole = Judged(
        labels=np.sort(rng.integers(0, 6, count)),
        positions=rng.normal(size=(count, 2)).cumsum(axis=0),
        rooms=[None if number % 9 == 0 else "ABC"[number // 20] for number in range(count)],
        times=[200_000_000 * number for number in range(count)],
    )
    unposed = np.full((count, 2), np.nan)
    some = whole.positions.copy()
    some[::4] = np.nan
    return {
        "a map": whole,
        "a map with some positions": dataclasses.replace(whole, positions=some),
        "a map without positions": dataclasses.replace(whole, positions=unposed),
        "a map without rooms": dataclasses.replace(whole, rooms=[None] * count),
        "a map without times": dataclasses.replace(whole, times=[None] * count),
        "a map without nodes": dataclasses.replace(whole, labels=np.zeros(count, np.int64)),
        "a map of one node": dataclasses.replace(whole, labels=np.ones(count, np.int64)),
        "a map of one image": Judged(np.ones(1, np.int64), np.zeros((1, 2)), ["A"], [0]),
    }
