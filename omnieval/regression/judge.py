"""A replay held against its case: one verdict a guarded value."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Literal

from omnieval.regression.reference import Case, Guard, NodeRange

Judgement = Literal["ok", "better", "worse", "outside", "missing"]
FAILURES: frozenset[Judgement] = frozenset({"worse", "outside", "missing"})
_ROUNDING = 1e-9
"""What a difference may exceed its tolerance by, so that 0.30 - 0.28 is within 0.02."""


@dataclass(frozen=True)
class Outcome:
    """What became of one guarded value.

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
        ``ok``; ``better`` or ``worse`` by more than the tolerance; ``outside`` its range; ``missing``.
    """

    metric: str
    expected: float
    allowed: str
    got: float | None
    judgement: Judgement

    @property
    def failed(self) -> bool:
        """Whether the replay is refused for it."""
        return self.judgement in FAILURES

    @property
    def difference(self) -> float | None:
        """Got minus expected."""
        return None if self.got is None else self.got - self.expected


def judge(case: Case, metrics: Mapping[str, float | int | None]) -> tuple[Outcome, ...]:
    """Hold the metrics of a replay (empty where it did not end) against a case."""
    return tuple(_outcomes(case, metrics))


def _outcomes(case: Case, metrics: Mapping[str, float | int | None]) -> Iterator[Outcome]:
    nodes = _finite(metrics.get("nodes"))
    allowed = f"{case.nodes.min} to {case.nodes.max}"
    yield Outcome("nodes", case.nodes.value, allowed, nodes, _of_range(case.nodes, nodes))
    yield from judge_guards(case.guards, metrics)


def judge_guards(guards: Mapping[str, Guard], metrics: Mapping[str, float | int | None]) -> Iterator[Outcome]:
    """Hold metrics against guards, both by name."""
    for name, guard in guards.items():
        got = _finite(metrics.get(name))
        yield Outcome(name, guard.value, f"{guard.tolerance:g}", got, _of_guard(guard, got))


def _finite(value: float | int | None) -> float | int | None:
    return value if value is not None and math.isfinite(value) else None


def _of_range(nodes: NodeRange, got: float | None) -> Judgement:
    if got is None:
        return "missing"
    return "ok" if nodes.min <= got <= nodes.max else "outside"


def _of_guard(guard: Guard, got: float | None) -> Judgement:
    if got is None:
        return "missing"
    gain = got - guard.value if guard.better == "higher" else guard.value - got
    if abs(gain) <= guard.tolerance + _ROUNDING:
        return "ok"
    return "better" if gain > 0 else "worse"
