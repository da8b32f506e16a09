"""A replay compared with its case: one verdict per guarded value."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Literal

from omnieval.regression.guarded import DECIMALS, Case, Guard, NodeRange
from omnieval.statistics.estimate import Estimate
from omnieval.statistics.within import IntervalOf

Judgement = Literal["ok", "better", "worse", "outside", "missing"]
FAILURES: frozenset[Judgement] = frozenset({"worse", "outside", "missing"})
_ROUNDING = 1e-9
"""What a difference may exceed its tolerance by, so that 0.30 - 0.28 is within 0.02."""
_ROUNDED = 10.0**-DECIMALS
"""How far apart intervals may be that only rounding parts."""
Metrics = Mapping[str, float | int | None]


@dataclass(frozen=True)
class Outcome:
    """The judgement of one guarded value.

    Attributes
    ----------
    metric
        Its name.
    expected
        The value of the reference.
    allowed
        What may differ, in words: a tolerance, or a range.
    got
        The value of the replay; None where it has none.
    judgement
        ``ok``; ``better`` or ``worse`` by more than the tolerance, or with the whole interval; ``outside`` its range;
        ``missing``.
    interval
        The interval of the replay, where that is what is guarded; None elsewhere.
    """

    metric: str
    expected: float
    allowed: str
    got: float | None
    judgement: Judgement
    interval: tuple[float, float] | None = None

    @property
    def failed(self) -> bool:
        """Whether the replay is refused for it."""
        return self.judgement in FAILURES

    @property
    def difference(self) -> float | None:
        """Got minus expected."""
        return None if self.got is None else self.got - self.expected


def judge(case: Case, metrics: Metrics, within: IntervalOf) -> tuple[Outcome, ...]:
    """Hold the metrics of a replay (empty where it did not end) and their intervals against a case."""
    return tuple(_outcomes(case, metrics, within))


def _outcomes(case: Case, metrics: Metrics, within: IntervalOf) -> Iterator[Outcome]:
    nodes = _finite(metrics.get("nodes"))
    allowed = f"{case.nodes.min} to {case.nodes.max}"
    yield Outcome("nodes", case.nodes.value, allowed, nodes, _of_range(case.nodes, nodes))
    yield from judge_guards(case.guards, metrics, within)


def judge_guards(guards: Mapping[str, Guard], metrics: Metrics, within: IntervalOf) -> Iterator[Outcome]:
    """Hold metrics and their intervals against guards, both by name."""
    for name, guard in guards.items():
        got = _finite(metrics.get(name))
        if guard.interval is None:
            allowed = f"{guard.tolerance:g}"
            yield Outcome(name, guard.value, allowed, got, _of_guard(guard, got, guard.tolerance or 0.0))
        else:
            interval = _interval(within(name))
            allowed = "{:.4g} to {:.4g}".format(*guard.interval)
            judgement = _of_interval(guard.interval, interval, higher=guard.better == "higher")
            yield Outcome(name, guard.value, allowed, got, judgement, interval)


def _finite(value: float | int | None) -> float | int | None:
    return value if value is not None and math.isfinite(value) else None


def _interval(found: Estimate | None) -> tuple[float, float] | None:
    return None if found is None or found.low is None or found.high is None else (found.low, found.high)


def _of_range(nodes: NodeRange, got: float | None) -> Judgement:
    if got is None:
        return "missing"
    return "ok" if nodes.min <= got <= nodes.max else "outside"


def _of_guard(guard: Guard, got: float | None, tolerance: float) -> Judgement:
    if got is None:
        return "missing"
    gain = got - guard.value if guard.better == "higher" else guard.value - got
    if abs(gain) <= tolerance + _ROUNDING:
        return "ok"
    return "better" if gain > 0 else "worse"


def _of_interval(expected: tuple[float, float], got: tuple[float, float] | None, *, higher: bool) -> Judgement:
    """Judge by intervals that have nothing in common."""
    if got is None:
        return "missing"
    below, above = got[1] < expected[0] - _ROUNDED, got[0] > expected[1] + _ROUNDED
    if not (below or above):
        return "ok"
    return "better" if above == higher else "worse"
