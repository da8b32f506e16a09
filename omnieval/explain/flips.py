"""What would have turned each comparison of a step the other way, as far as its evidence proves it.

A gate that turns does not decide alone what becomes of the image: the ones behind it may refuse, and the map would
have been another one by then. So a flip speaks of its gate only.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from omnieval.explain.decision import BestMatch, Decision
from omnieval.explain.words import counted
from omnieval.mapping.conditions import gate_threshold
from omnieval.mapping.config import MapperConfig
from omnieval.mapping.step import Centroid, EventKind, NodeGate

_LARGEST_OMEGA = 100.0
_DIGITS = 3
_PLAIN = 1e6
"""Numbers from here on are written with an exponent."""


@dataclass(frozen=True, slots=True)
class Flip:
    """What would have turned one comparison.

    Attributes
    ----------
    gate
        Which one, by the names of `Margin`.
    passed
        Which way it went.
    value, threshold
        What was compared; None where the evidence does not hold it.
    parameter
        The parameter that sets the threshold; None if none does.
    needed
        The value of the parameter from which the comparison turns; None if no value does.
    text
        The same in words.
    """

    gate: str
    passed: bool
    value: float | None
    threshold: float | None
    parameter: str | None
    needed: float | None
    text: str


def flips(decision: Decision, config: MapperConfig) -> tuple[Flip, ...]:
    """Return what would have turned each comparison of a step, in the order in which they were made."""
    found: list[Flip] = []
    gate, match = decision.gate, decision.match
    if gate is not None and len(gate.nodes):
        found.append(_let_in(gate) if match is None else _shut_out(gate, match))
    if match is not None:
        found.append(_prominence(match, config))
    if decision.centroid is not None:
        found.append(_centroid(decision.centroid))
    merging = _merging(decision, config)
    return (*found, merging) if merging is not None else tuple(found)


def _let_in(gate: NodeGate) -> Flip:
    """Say what would make the nearest node a candidate when none is (Eq. 4)."""
    nearest = int(gate.ratios.argmin())
    node, ratio = int(gate.nodes[nearest]), float(gate.ratios[nearest])
    possible = ratio <= _LARGEST_OMEGA
    need = f"omega >= {_up(ratio)}" if possible else f"omega >= {ratio:.3g}, more than can be set,"
    return Flip(
        "node", False, ratio, gate.x, "omega", ratio if possible else None, f"{need} would make node {node} a candidate"
    )


def _shut_out(gate: NodeGate, match: BestMatch) -> Flip:
    """Say what would refuse the node of the best match: x below its ratio (Eq. 4)."""
    ratio = float(gate.ratios[gate.nodes == match.node][0])
    least = gate_threshold(0.0, len(gate.nodes))
    facts = ("node", True, ratio, gate.x, "omega")
    if ratio > max(least, 0.0):
        return Flip(*facts, ratio, f"omega < {_down(ratio)} would no longer make node {match.node} a candidate")
    reason = f"x is {least:.2f} or more" if least > 0.0 else "omega is above 0"
    active = counted(len(gate.nodes), "active node")
    return Flip(*facts, None, f"no omega would refuse node {match.node}: with {active} {reason}")


def _prominence(match: BestMatch, config: MapperConfig) -> Flip:
    """Say what would turn the condition that the prominence over its mean reaches gamma (section 4.3)."""
    ratio, gamma = match.prominence_ratio, config.gamma
    if match.peaks < 2:
        passed = config.single_peak == "accept"
        other = "single_peak=reject would refuse" if passed else "single_peak=accept would pass"
        peaks = counted(match.peaks, "peak")
        return Flip("prominence", passed, None, None, "single_peak", None, f"{other} here: {peaks}, nothing to compare")
    passed = ratio >= gamma
    facts = ("prominence", passed, ratio, gamma, "gamma", ratio)
    if passed:
        return Flip(*facts, f"gamma > {_up(ratio)} would refuse at this gate")
    return Flip(*facts, f"gamma <= {_down(ratio)} would pass this gate")


def _centroid(centroid: Centroid) -> Flip:
    """Say what would turn the condition that the node's mean shifts no further than the bound (Eq. 9)."""
    shift, bound = centroid.shift, centroid.bound
    passed = shift <= bound
    off = abs(shift - bound) / bound if bound else math.inf
    way = "refuse: it was" if passed else "pass: it was"
    side = "below" if passed else "above"
    words = f"a shift of {'more' if passed else 'no more'} than {bound:.3g} would {way} {100 * off:.2g} % {side}"
    return Flip("centroid", passed, shift, bound, None, None, f"{words}; no parameter sets this bound")


def _merging(decision: Decision, config: MapperConfig) -> Flip | None:
    """Say what would change whether a new node merges (Eq. 11)."""
    ratio, merge_y = decision.merge_ratio, config.merge_y
    if ratio is None or EventKind.CREATED not in {event.kind for event in decision.events}:
        return None
    merged = ratio <= merge_y
    words = (
        f"< {_down(ratio)} would keep the new node apart" if merged else f">= {_up(ratio)} would let the new node merge"
    )
    return Flip("merge", merged, ratio, merge_y, "merge_y", ratio, f"merge_y {words}")


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
