"""Times as tables have them: exactly, and in which unit where none is named."""

from __future__ import annotations

from collections.abc import Sequence
from decimal import Decimal, InvalidOperation
from itertools import pairwise
from statistics import median

from omnieval.datasets.trajectory.text import is_number

LARGEST_NS = 2**63 - 1
_SINCE_THE_EPOCH = (("ns", 1e17), ("us", 1e14), ("ms", 1e11))
"""From which size on times since the epoch are of a unit."""
_LONG_INTERVAL_S = 1e5
"""Seconds between two rows that are probably not seconds."""


def exact(text: str) -> Decimal | None:
    """Return a time as it is written, None if it is not a number: a float loses the last digits of an epoch time."""
    try:
        number = Decimal(text) if is_number(text) else None
    except InvalidOperation:
        return None
    return number if number is not None and number.is_finite() else None


def unit_of(times: Sequence[Decimal]) -> str:
    """Return the unit of times (s, ms, us or ns) of which only the size tells it.

    Raises
    ------
    ValueError
        If it does not; the message says why, and begins where the column's name ends.
    """
    ordered = sorted(map(float, times))  # near enough to tell how large they are
    size = median(map(abs, ordered)) if ordered else 0.0
    unit = next((unit for unit, least in _SINCE_THE_EPOCH if size >= least), "s")
    intervals = [later - earlier for earlier, later in pairwise(ordered) if later > earlier]
    if unit == "s" and intervals and median(intervals) > _LONG_INTERVAL_S:
        raise ValueError(f"grows by {median(intervals):g} a row, too much for seconds; name its unit, such as time_ns")
    return unit
