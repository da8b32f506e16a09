"""Decisions, comparisons and events in words that say why, whatever the mapper."""

from __future__ import annotations

from omnieval.mapping.interface import Method
from omnieval.mapping.step import Comparison, EventKind, FinalMap, NodeEvent, Placement, Role, Step

_MOST_DIGITS = 17
_PLAIN = 1e6
"""Numbers from here on are written with an exponent."""


def decision_text(step: Step, method: Method) -> str:
    """Say what became of an image and why, in one line, e.g. ``refused (prominence): ... 3.1 < gamma 5``."""
    if step.role is Role.FOUNDING:
        return f"{step.verdict} image of node {step.node}"
    if step.role is Role.JOINED:
        best = f": best image {step.match.frame}" if step.match else ""
        reason = deciding(step, method)
        return f"joined node {step.node}{best}{f', {_reason(step, reason, method)}' if reason else ''}"
    refused = deciding(step, method)
    why = f": {_reason(step, refused, method)}" if refused else ""
    if step.role is Role.PENDING:
        return f"joined pending node {step.node}; active nodes refused{why}"
    return f"refused ({step.verdict}){why}" if step.role is Role.REFUSED else f"{step.verdict}{why}"


def deciding(step: Step, method: Method) -> Comparison | None:
    """Return the comparison that decided about the loop closure: the last of those that an image must pass for it."""
    asked = [one for one in step.comparisons if method.gate(one.gate).closes]
    if step.role is not Role.JOINED:
        asked = [one for one in asked if not one.passed]
    return asked[-1] if asked else None


def subject(step: Step, comparison: Comparison) -> int | None:
    """Return the node or image that a comparison was about: the one that was chosen, else the nearest to passing."""
    if not comparison.of:
        return None
    chosen = [one for one in (step.match.node if step.match else None, step.node) if one in comparison.of]
    if comparison.passed and chosen:
        return chosen[0]
    return comparison.of[comparison.values.index(comparison.best)]


def comparison_text(step: Step, comparison: Comparison, method: Method) -> str:
    """Say what was compared and the result, for one value."""
    text = _reason(step, comparison, method)
    if not method.gate(comparison.gate).closes:
        return text
    return f"{text}: {'passed' if comparison.passed else 'refused'}"


def threshold_text(comparison: Comparison, method: Method) -> str:
    """Say what a threshold is and where it comes from, e.g. ``x = max(omega 2.3, 2.15) = 2.3``."""
    name, value = method.gate(comparison.gate).threshold, f"{comparison.threshold:.6g}"
    parameter = comparison.parameter
    if parameter is None or parameter == name:
        return f"{name} {value}"
    given = method.settings.get(parameter)
    inner = f"{parameter} {given:g}" if isinstance(given, int | float) else parameter
    if comparison.floor > float("-inf"):
        inner = f"max({inner}, {comparison.floor:.6g})"
    return f"{name} = {inner} = {value}"


def event_text(event: NodeEvent) -> str:
    """Say what happened to a node, e.g. ``created node 5 from images 300-319``."""
    if event.kind is EventKind.CREATED:
        return f"created node {event.node} from images {frame_ranges(event.frames)}"
    if event.kind is EventKind.MERGED:
        return f"node {event.node} merged into {event.into}"
    return f"node {event.node} became active"


def map_text(final: FinalMap) -> str:
    """Say what the map has become when the sequence has ended."""
    counts = {placement: final.placements.count(placement) for placement in Placement}
    return (
        f"final map: {len(final.nodes)} nodes, {len(final.active)} active; leftovers: "
        f"{counts[Placement.RETEST]} accepted, {counts[Placement.FORCED]} forced, "
        f"{counts[Placement.UNASSIGNED]} unassigned"
    )


def margin_text(step: Step, method: Method) -> str:
    """Say which comparison was nearest to going the other way, and how near it was."""
    margin = step.margin
    if margin is None:
        return "none: nothing was compared"
    gate = method.gate(margin.gate)
    return (
        f"{margin.value:.2g} ({margin.gate}): nearest to going the other way was {gate.value} against {gate.threshold}"
    )


def frame_ranges(frames: tuple[int, ...]) -> str:
    """Write ascending frame numbers in short, e.g. ``300-310, 312-320``."""
    runs: list[list[int]] = []
    for frame in frames:
        if runs and frame == runs[-1][1] + 1:
            runs[-1][1] = frame
        else:
            runs.append([frame, frame])
    return ", ".join(f"{first}" if first == last else f"{first}-{last}" for first, last in runs)


def distinct(value: float, threshold: float) -> str:
    """Write `value` with three digits, or more if it would else read like the threshold it differs from.

    Examples
    --------
    >>> distinct(4.9906, 5.0), distinct(4.9999, 5.0), distinct(5.0, 5.0)
    ('4.99', '4.9999', '5')
    """
    digits = 3
    while value != threshold and f"{value:.{digits}g}" == f"{threshold:.{digits}g}" and digits < _MOST_DIGITS:
        digits += 1
    text = f"{value:.{digits}g}"
    return f"{value:.0f}" if "e" in text and abs(value) < _PLAIN and abs(value) >= 1 else text


def _reason(step: Step, comparison: Comparison, method: Method) -> str:
    one = subject(step, comparison)
    value = comparison.best if one is None else comparison.values[comparison.of.index(one)]
    gate, threshold = method.gate(comparison.gate), comparison.threshold
    whose = "" if one is None or gate.of is None else f" of {gate.of} {one}:"
    passed, refused = (">=", "<") if comparison.reaches else ("<=", ">")
    sign = passed if (value >= threshold if comparison.reaches else value <= threshold) else refused
    return f"{gate.value}{whose} {distinct(value, threshold)} {sign} {threshold_name(comparison, method, value)}"


def threshold_name(comparison: Comparison, method: Method, value: float) -> str:
    """Say what a threshold is, with as many digits as tell it from `value`."""
    return f"{method.gate(comparison.gate).threshold} {distinct(comparison.threshold, value)}"
