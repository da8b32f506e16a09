"""What would have changed the outcome of each comparison of a step, as far as the recorded evidence proves it.

A gate does not decide alone about the image: later gates may refuse it, and the map would
have been another one by then. So a flip is a statement about its gate only.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from omnieval.explain.words import distinct, subject
from omnieval.mapping.interface import Gate, Method
from omnieval.mapping.step import Comparison, Step

_DIGITS = 3
_PLAIN = 1e6
"""Numbers from here on are written with an exponent."""


@dataclass(frozen=True, slots=True)
class Flip:
    """What would have changed the outcome of one comparison.

    Attributes
    ----------
    gate
        Which one.
    passed
        Which way it went.
    value, threshold
        What was compared.
    parameter
        The parameter that sets the threshold; None if none does.
    needed
        The value of the parameter from which the comparison turns; None if no value does.
    text
        The same in words.
    """

    gate: str
    passed: bool
    value: float
    threshold: float
    parameter: str | None
    needed: float | None
    text: str


def flips(step: Step, method: Method) -> tuple[Flip, ...]:
    """Return what would have changed the outcome of each comparison of a step, in the order in which they were made.

    Those that neither a parameter sets nor a loop closure depends on are left out.
    """
    found = [
        (one, _flip(step, one, method))
        for one in step.comparisons
        if one.parameter is not None or (method.gate(one.gate).closes and not one.counts)
    ]
    # Of a count that no setting turns there is nothing to say: it goes on counting.
    return tuple(flip for one, flip in found if flip.needed is not None or not one.counts)


def refusing_first(found: tuple[Flip, ...]) -> list[Flip]:
    """Return flips with those of the gates that refused before the others, which a refused image would still pass."""
    return sorted(found, key=lambda flip: flip.passed)


def _flip(step: Step, comparison: Comparison, method: Method) -> Flip:
    one = subject(step, comparison)
    value = comparison.best if one is None else comparison.values[comparison.of.index(one)]
    gate, threshold = method.gate(comparison.gate), comparison.threshold
    passed = value >= threshold if comparison.reaches else value <= threshold
    outcome = (gate.refusing if passed else gate.passing).format(one=one)
    parameter = comparison.parameter
    if parameter is None:
        text = _without_parameter(comparison, gate, value, outcome)
        return Flip(comparison.gate, passed, value, threshold, None, None, text)
    # Strictly beyond the value, or up to it: whichever turns the comparison.
    at_most = comparison.reaches is not passed
    sign = ("<=" if comparison.reaches else "<") if at_most else (">" if comparison.reaches else ">=")
    if at_most and not comparison.reaches and value <= comparison.floor:
        text = f"no {parameter} would {outcome}: {gate.threshold} is {comparison.floor:.6g} or more"
        return Flip(comparison.gate, passed, value, threshold, parameter, None, text)
    low, high = method.ranges.get(parameter, (-math.inf, math.inf))
    written = _down(value) if at_most else _up(value)
    if not low <= value <= high:
        text = f"{parameter} {sign} {written}, {'less' if at_most else 'more'} than can be set, would {outcome}"
        return Flip(comparison.gate, passed, value, threshold, parameter, None, text)
    return Flip(
        comparison.gate, passed, value, threshold, parameter, value, f"{parameter} {sign} {written} would {outcome}"
    )


def _without_parameter(comparison: Comparison, gate: Gate, value: float, outcome: str) -> str:
    threshold = comparison.threshold
    off = abs(value - threshold) / abs(threshold) if threshold else math.inf
    side = "below" if value < threshold else "above"
    return (
        f"{gate.value} {distinct(value, threshold)} on the other side of {gate.threshold} {distinct(threshold, value)} "
        f"would {outcome}: it was {100 * off:.2g} % {side}; no parameter sets it"
    )


def _down(value: float) -> str:
    """Write a number with three decimals, not above what it is."""
    return _fixed(value, math.floor)


def _up(value: float) -> str:
    """Write a number with three decimals, not below what it is."""
    return _fixed(value, math.ceil)


def _fixed(value: float, rounded: Callable[[float], int]) -> str:
    if not abs(value) < _PLAIN:
        return f"{value:g}"
    return f"{rounded(value * 10**_DIGITS) / 10**_DIGITS:.{_DIGITS}f}".rstrip("0").rstrip(".")
