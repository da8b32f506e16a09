"""A decision as lines of a page: a label and what is to be said under it."""

from __future__ import annotations

import math
from collections.abc import Iterable

from omnieval.explain.capture import Capture
from omnieval.explain.decision import BestMatch, Decision
from omnieval.explain.flips import Flip, flips
from omnieval.explain.revisit import Revisit
from omnieval.explain.words import counted, decision_text, distinct, event_text
from omnieval.mapping.config import MapperConfig
from omnieval.mapping.step import Margin, NodeGate, Placement

Line = tuple[str, str]

NEAREST = 3
"""How many of the refused nodes are told apart from the rest."""

_PLACEMENTS = {
    Placement.FOUNDING: "one of the images the node was made of",
    Placement.LOOP_CLOSURE: "assigned at its own step",
    Placement.PENDING: "taken by a pending node at its own step",
    Placement.RETEST: "a leftover that the final map accepted",
    Placement.FORCED: "a leftover put into the node of its most similar image",
    Placement.UNASSIGNED: "belongs to no node",
}

_COMPARISONS = {
    "node": "the gate ratio of a node against x",
    "match": "the best image against the best one of another candidate node",
    "prominence": "prominence against gamma",
    "centroid": "centroid shift against its bound",
    "pending": "the gate ratio of a pending node against x",
    "merge": "the ratio of a merging pair against merge_y",
    "activation": "the distance of a node from the others against their own",
}


def lines(decision: Decision, config: MapperConfig) -> list[Line]:
    """Return everything that was compared at a step and what came of it; a label may be empty to go on with the last.

    The first line is the decision in a sentence.
    """
    page = [("decision", decision_text(decision, config.gamma)), ("image", capture_text(decision.capture))]
    if decision.gate is not None:
        page += _gate_lines(decision.gate, config)
    if decision.match is not None:
        page += _match_lines(decision.match, config)
        page.append(("centroid", _centroid_text(decision)))
    if decision.revisit is not None:
        page.append(("true place", revisit_text(decision.revisit, decision.capture)))
    page += [("event", event_text(event)) for event in decision.events]
    if decision.node is None:
        page.append(("run", f"{decision.run} of the {config.n_new} unassigned images that make a node"))
    page.append(("nodes", f"{decision.active} active, {decision.pending} pending after the step"))
    if decision.margin is not None:
        page.append(("margin", margin_text(decision.margin)))
    return page + labelled("would flip", (flip.text for flip in _refusing_first(flips(decision, config))))


def capture_text(capture: Capture) -> str:
    """Say which image it is and where it was taken."""
    parts = [f"{capture.frame}: {capture.file}" if capture.file else f"{capture.frame}"]
    if capture.room is not None:
        parts.append(f"in {capture.room}")
    if capture.x is not None and capture.y is not None:
        parts.append(f"at ({capture.x:.2f}, {capture.y:.2f}) m")
    if capture.yaw is not None:
        parts.append(f"heading {math.degrees(capture.yaw):.0f} deg")
    if capture.time is not None:
        parts.append(capture.time)
    return ", ".join(parts)


def match_text(match: BestMatch) -> str:
    """Say which image is the most similar one, where it was taken, and how it has to be turned."""
    room = f" in {match.capture.room}" if match.capture.room is not None else ""
    away = f", {match.distance:.2f} m away" if match.distance is not None else ""
    degrees = f" ({match.shift_degrees:.1f} deg)" if match.shift_degrees is not None else ""
    return f"{match.best_frame} of node {match.node}{room}{away}, turned by {counted(match.shift, 'cell')}{degrees}"


def revisit_text(revisit: Revisit, capture: Capture) -> str:
    """Say whether the image was taken where an earlier one was that a node holds."""
    there = revisit.capture
    room = f" in {there.room}" if there.room is not None else ""
    ago = counted(capture.frame - there.frame, "step")
    place = f"{there.frame} of node {revisit.node}{room}, {revisit.distance:.2f} m away and {ago} ago"
    return f"that of image {place}" if revisit.near else f"a new one; the nearest in an active node is image {place}"


def margin_text(margin: Margin) -> str:
    """Say which comparison was nearest to going the other way, and how near it was."""
    compared = _COMPARISONS.get(margin.gate, margin.gate)
    return f"{margin.value:.2g} ({margin.gate}): nearest to going the other way was {compared}"


def final_text(node: int | None, placement: Placement | None) -> str:
    """Say where the image ended, and how it came there."""
    if placement is None:
        return "unknown: the run did not reach its end"
    where = f"node {node}" if node is not None else "no node"
    return f"{where}, {placement.value}: {_PLACEMENTS[placement]}"


def labelled(label: str, texts: Iterable[str]) -> list[Line]:
    """Return texts as lines under one label."""
    return [(label if number == 0 else "", text) for number, text in enumerate(texts)]


def _refusing_first(found: Iterable[Flip]) -> list[Flip]:
    """Return flips with those of the gates that refused before the others, which a refused image would still pass."""
    return sorted(found, key=lambda flip: flip.passed)


def _gate_lines(gate: NodeGate, config: MapperConfig) -> list[Line]:
    """Say x, and the gate ratio of every node: candidates, the nearest of the refused ones, the rest."""
    count = len(gate.nodes)
    threshold = (
        f"x = max(omega {config.omega:g}, 3.05 - 0.15 x {count}) = {gate.x:g} with {counted(count, 'active node')}"
    )
    order = gate.ratios.argsort(kind="stable")
    nodes = [(int(gate.nodes[index]), float(gate.ratios[index])) for index in order]
    passed = [f"node {node} at {distinct(ratio, gate.x, 2)}" for node, ratio in nodes if ratio <= gate.x]
    refused = [f"node {node} at {distinct(ratio, gate.x, 2)}" for node, ratio in nodes if ratio > gate.x]
    found = [("gate", threshold), ("candidates", ", ".join(passed) or "none")]
    if refused:
        found.append(("refused", ", ".join(refused[:NEAREST])))
    if len(refused) > NEAREST:
        found.append(("far nodes", ", ".join(text.removeprefix("node ") for text in refused[NEAREST:])))
    return found


def _match_lines(match: BestMatch, config: MapperConfig) -> list[Line]:
    similarity = f"{match.similarity:.3g} = position {match.position:.3g} x orientation {match.orientation:.3g}"
    return [
        ("best match", match_text(match)),
        ("similarity", similarity),
        ("prominence", _prominence_text(match, config)),
    ]


def _prominence_text(match: BestMatch, config: MapperConfig) -> str:
    if match.peaks < 2:
        outcome = "accepted" if config.single_peak == "accept" else "refused"
        return f"not compared: {counted(match.peaks, 'peak')} on the similarity curve, {outcome} (single_peak)"
    ratio, gamma = match.prominence_ratio, config.gamma
    sign, outcome = (">=", "passed") if ratio >= gamma else ("<", "refused")
    values = f"{match.prominence:.3g} / mean {match.prominence_mean:.3g} of {match.peaks} peaks"
    return f"{values} = {distinct(ratio, gamma, 2)} {sign} gamma {gamma:g}: {outcome}"


def _centroid_text(decision: Decision) -> str:
    if decision.centroid is None:
        return "not compared: the image was refused before"
    shift, bound = decision.centroid.shift, decision.centroid.bound
    sign, outcome = ("<=", "passed") if shift <= bound else (">", "refused")
    return f"shift {distinct(shift, bound, 4)} {sign} bound {distinct(bound, shift, 4)}: {outcome}"
