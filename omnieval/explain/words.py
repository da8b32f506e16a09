"""Decisions and events in words that say why."""

from __future__ import annotations

from typing import Protocol

from omnieval.mapping.step import Centroid, EventKind, FinalMap, NodeEvent, NodeGate, Placement, Verdict

_MOST_DIGITS = 17


class MatchedImage(Protocol):
    """What the words need of a match; `Match` and `BestMatch` have it."""

    @property
    def best_frame(self) -> int:
        """Number of the most similar image."""
        ...

    @property
    def node(self) -> int:
        """Its node."""
        ...

    @property
    def peaks(self) -> int:
        """Peaks of the similarity curve."""
        ...

    @property
    def prominence_ratio(self) -> float:
        """Prominence over its mean."""
        ...


class Decided(Protocol):
    """What the words need of a step; `Step` and `Decision` have it."""

    @property
    def verdict(self) -> Verdict:
        """What became of the image."""
        ...

    @property
    def node(self) -> int | None:
        """Its node after the step."""
        ...

    @property
    def gate(self) -> NodeGate | None:
        """Node-level loop closure."""
        ...

    @property
    def match(self) -> MatchedImage | None:
        """Image-level loop closure."""
        ...

    @property
    def centroid(self) -> Centroid | None:
        """The centroid condition."""
        ...

    @property
    def run(self) -> int:
        """Length of the run of unassigned images."""
        ...


def decision_text(step: Decided, gamma: float) -> str:
    """Say what became of an image and why.

    Parameters
    ----------
    step
        The step.
    gamma
        The factor of the prominence condition.

    Returns
    -------
    str
        One line, e.g. ``refused: prominence 3.1 x mean < 5``.
    """
    if step.verdict is Verdict.INITIAL:
        return f"initial image of node {step.node}"
    if step.verdict is Verdict.ASSIGNED and step.match is not None:
        return f"joined node {step.match.node}: best image {step.match.best_frame}, {_prominence(step.match)}"
    if step.verdict is Verdict.PENDING:
        return f"joined pending node {step.node}; active nodes: {_refusal(step, gamma)}"
    run = f" ({step.run} unassigned in a row)" if step.run > 1 else ""
    return _refusal(step, gamma) + run


def event_text(event: NodeEvent) -> str:
    """Say what happened to a node, e.g. ``created node 5 from images 300-319``."""
    if event.kind is EventKind.CREATED:
        return f"created node {event.node} from images {frame_ranges(event.frames)}"
    if event.kind is EventKind.MERGED:
        return f"node {event.node} merged into {event.into}"
    return f"node {event.node} became active"


def final_text(final: FinalMap) -> str:
    """Say what the map has become when the sequence has ended."""
    counts = {placement: final.placements.count(placement) for placement in Placement}
    return (
        f"final map: {len(final.nodes)} nodes, {len(final.active)} active; leftovers: "
        f"{counts[Placement.RETEST]} accepted, {counts[Placement.FORCED]} forced, "
        f"{counts[Placement.UNASSIGNED]} unassigned"
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


def counted(number: int, thing: str) -> str:
    """Write a number of things, e.g. ``1 peak`` or ``2 peaks``."""
    return f"1 {thing}" if number == 1 else f"{number} {thing}s"


def distinct(value: float, threshold: float, digits: int) -> str:
    """Write `value` with so many decimals, or more if it would else read like the threshold it differs from."""
    while value != threshold and f"{value:.{digits}f}" == f"{threshold:.{digits}f}" and digits < _MOST_DIGITS:
        digits += 1
    return f"{value:.{digits}f}"


def _refusal(step: Decided, gamma: float) -> str:
    """Say which condition of the active nodes the image failed."""
    if step.match is None:
        return f"no candidate: {_nearest(step.gate)}"
    if step.centroid is None:
        if step.match.peaks < 2:
            return f"refused: {_peaks(step.match)} on the similarity curve, too few to stand out"
        return f"refused: prominence {distinct(step.match.prominence_ratio, gamma, 1)} x mean < {gamma:g}"
    shift, bound = step.centroid.shift, step.centroid.bound
    return f"refused: centroid shift {distinct(shift, bound, 4)} > bound {distinct(bound, shift, 4)}"


def _nearest(gate: NodeGate | None) -> str:
    if gate is None or not len(gate.nodes):
        return "no active node"
    nearest = gate.ratios.argmin()
    ratio = float(gate.ratios[nearest])
    return f"nearest node {gate.nodes[nearest]} at {distinct(ratio, gate.x, 2)} > x = {gate.x:g}"


def _prominence(match: MatchedImage) -> str:
    if match.peaks < 2:
        return f"{_peaks(match)}, nothing to compare its prominence with"
    return f"prominence {match.prominence_ratio:.1f} x mean"


def _peaks(match: MatchedImage) -> str:
    return counted(match.peaks, "peak")
