"""What a step looked at and decided, as rows: curves, gate, plots over time, words."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from omnieval.explain.decision import Decision
from omnieval.explain.flips import flips
from omnieval.explain.page import lines
from omnieval.explain.words import decision_text, event_text
from omnieval.mapping.config import MapperConfig
from omnieval.mapping.step import EventKind, Match, NodeGate, Step, Verdict
from omnieval.recording import layout
from omnieval.recording.records import StepView
from omnieval.recording.rows import NO_BARS, Bars, Page, Row, Scalar, Words

CURVE_BARS = 512
"""Most bars of a curve, about the pixels it is shown on; this bounds what a step costs in a growing map."""
GATE_CEILING = 3.0
"""Gate ratios are drawn up to so many times x; far nodes would otherwise flatten the others."""

_WHY_REFUSED = (
    "event",
    "true place",
    "would flip",
    "best match",
    "prominence",
    "centroid",
    "candidates",
    "refused",
    "run",
    "margin",
    "image",
)
_WHY_CLOSED = (
    "event",
    "true place",
    "best match",
    "prominence",
    "centroid",
    "candidates",
    "would flip",
    "refused",
    "margin",
    "image",
)
"""The parts of an explanation that the page of a step has, in the order in which they are asked for: of a refused
image, what would have let it in; of an accepted one, whether it was rightly so."""
_LINE_BREAK = "  \n"
"""Markdown for a new line without a gap: the page has room for some ten lines on a small screen."""

_BEST_SHARE = 0.006
"""Least width of the best candidate's bar, as a share of the chart."""

_LEVELS = {
    Verdict.INITIAL: ("INFO", layout.GREY_TEXT_COLOR),
    Verdict.ASSIGNED: ("INFO", layout.ACCEPTED_COLOR),
    Verdict.PENDING: ("INFO", layout.PENDING_COLOR),
}
_REFUSED_LEVEL = ("WARN", layout.REFUSED_COLOR)


def verdict_color(verdict: Verdict) -> int:
    """Return the colour of a verdict, 0xRRGGBBAA: accepted, taken by a pending node, refused."""
    return _LEVELS.get(verdict, _REFUSED_LEVEL)[1]


def word_rows(step: Step, gamma: float) -> list[tuple[str, Words]]:
    """Return the decision and the events of a step in words."""
    level, color = _LEVELS.get(step.verdict, _REFUSED_LEVEL)
    decision = numbered(step.frame, decision_text(step, gamma))
    rows = [(layout.LOG_DECISION, Words(decision, level, color))]
    for event in step.events:
        color = layout.node_color(event.into if event.kind is EventKind.MERGED and event.into else event.node)
        words = Words(numbered(step.frame, event_text(event)), event.kind.value.upper(), color)
        rows.append((layout.LOG_EVENT, words))
    return rows


def numbered(step: int, text: str) -> str:
    """Return a line of the log with its step: the viewer's own column of steps is too narrow for three digits."""
    return f"{step}: {text}"


def why_rows(decided: Decision, config: MapperConfig) -> list[tuple[str, Row]]:
    """Return the decision and what was compared as a page, the reasons first; the plots beside it show the rest."""
    said: dict[str, str] = {}
    for label, text in lines(decided, config):
        said.setdefault(label, text)
    said["would flip"] = "; ".join(flip.text for flip in flips(decided, config) if flip.passed is _closed(decided))
    reasons = _WHY_CLOSED if _closed(decided) else _WHY_REFUSED
    why = [f"**{label}** {said[label]}" for label in reasons if said.get(label)]
    return [(layout.WHY, Page(f"**{said['decision']}**\n\n{_LINE_BREAK.join(why)}"))]


def _closed(decided: Decision) -> bool:
    return decided.verdict is Verdict.ASSIGNED


def decision_state(decided: Decision) -> str:
    """Return what the lane of decisions shows: a refused image at a known place is a missed loop closure."""
    if decided.verdict is Verdict.INITIAL:
        return "initial"
    if decided.verdict in (Verdict.ASSIGNED, Verdict.PENDING):
        return "closed"
    return "missed" if decided.revisit is not None and decided.revisit.near else "refused"


def missed_rows(decided: Decision) -> list[tuple[str, Row]]:
    """Return the mark of a missed loop closure in the plot of prominences: at 0 where the gate left no candidate."""
    if decision_state(decided) != "missed":
        return []
    ratio = decided.match.prominence_ratio if decided.match is not None else 0.0
    return [(layout.MISSED, Scalar(ratio if math.isfinite(ratio) else 0.0))]


DECISION_COLORS = {
    "initial": 0x4A5058FF,
    "closed": 0x5B77B8FF,
    "refused": 0x2B3138FF,
    "missed": layout.MISSED_COLOR,
}
"""Colours of the lane of decisions, dark to bright by how much they ask to be looked at."""


def plot_rows(view: StepView, gamma: float, unassigned: float) -> list[tuple[str, Row]]:
    """Return every plot's points at this step; NaN where a condition was not reached."""
    step, match, centroid = view.step, view.step.match, view.step.centroid
    ratios = step.gate.ratios if step.gate is not None else np.zeros(0)
    values = {
        f"{layout.PLOT_GATE}/nearest": float(ratios.min()) if ratios.size else math.nan,
        f"{layout.PLOT_GATE}/x": step.gate.x if step.gate is not None else math.nan,
        f"{layout.PLOT_PROMINENCE}/ratio": match.prominence_ratio if match is not None else math.nan,
        f"{layout.PLOT_PROMINENCE}/gamma": gamma,
        f"{layout.PLOT_CENTROID}/shift": centroid.shift if centroid is not None else math.nan,
        f"{layout.PLOT_CENTROID}/bound": centroid.bound if centroid is not None else math.nan,
        f"{layout.PLOT_MARGIN}/value": step.margin.value if step.margin is not None else math.nan,
        f"{layout.PLOT_NODES}/active": float(step.active),
        f"{layout.PLOT_NODES}/pending": float(step.pending),
        f"{layout.PLOT_QUALITY}/silhouette": math.nan if view.silhouette is None else view.silhouette,
        f"{layout.PLOT_QUALITY}/unassigned": unassigned,
        f"{layout.PLOT_COST}/milliseconds": view.milliseconds,
    }
    return [(entity, Scalar(value if math.isfinite(value) else math.nan)) for entity, value in values.items()]


def gate_rows(gate: NodeGate | None) -> list[tuple[str, Row]]:
    """Return the gate ratio of every active node as a bar at its number, over the band that x lets pass."""
    candidates = refused = threshold = NO_BARS
    if gate is not None and gate.nodes.size:
        heights = np.clip(gate.ratios, -GATE_CEILING * gate.x, GATE_CEILING * gate.x)
        passed = gate.ratios <= gate.x
        candidates, refused = (
            Bars(heights[chosen], gate.nodes[chosen] - 0.4, np.full(chosen.sum(), 0.8)) for chosen in (passed, ~passed)
        )
        threshold = _bar(gate.x, 0.5, float(gate.nodes.max()))
    return [
        (f"{layout.GATE}/{layout.CANDIDATES}", candidates),
        (f"{layout.GATE}/{layout.REFUSED}", refused),
        (f"{layout.GATE}/{layout.THRESHOLD}", threshold),
    ]


def curve_rows(match: Match | None, gamma: float) -> list[tuple[str, Row]]:
    """Return the three similarity curves over the images of the map, each relative to its maximum.

    The threshold is drawn where the peak has to reach: its base plus gamma times the mean prominence. It is left
    out where the condition compares nothing, on a curve of fewer than two peaks.
    """
    rows: list[tuple[str, Row]] = []
    for entity, name in (
        (layout.SIMILARITY, "similarity"),
        (layout.POSITION, "position"),
        (layout.ORIENTATION, "orientation"),
    ):
        curve = best = NO_BARS
        if match is not None:
            values: NDArray[np.float64] = getattr(match, name)
            relative = values / values.max()
            curve = pooled_bars(match.slots, relative, match.map_size)
            width = max(1.0, _BEST_SHARE * match.map_size)
            best = _bar(float(relative[match.best]), match.slots[match.best] + 0.5 - width / 2, width)
        rows += [(f"{entity}/{layout.CURVE}", curve), (f"{entity}/{layout.BEST}", best)]
    threshold = NO_BARS
    if match is not None and match.peaks >= 2:
        threshold = _bar(prominence_level(match, gamma), 0.0, float(match.map_size))
    return [*rows, (f"{layout.SIMILARITY}/{layout.THRESHOLD}", threshold)]


def prominence_level(match: Match, gamma: float) -> float:
    """Return what the best match's similarity has to reach, relative to it: at most 1 iff it is prominent enough."""
    required = gamma * match.prominence_mean - match.prominence
    return 1.0 + required / float(match.similarity[match.best])


def pooled_bars(slots: NDArray[np.int64], values: NDArray[np.float64], size: int) -> Bars:
    """Draw a curve of `size` images, 0 outside `slots`, with at most `CURVE_BARS` bars.

    Neighbours that share a bar are represented by their maximum, so that no peak is lost.
    """
    curve = np.zeros(size)
    curve[slots] = values
    together = -(-size // CURVE_BARS)
    left = np.arange(0, size, together)
    return Bars(np.maximum.reduceat(curve, left), left.astype(float), np.full(len(left), float(together)))


def _bar(height: float, left: float, width: float) -> Bars:
    return Bars(np.array([height]), np.array([left]), np.array([width]))
