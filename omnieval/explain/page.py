"""A decision as lines of a page: a label and what is to be said under it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from omnieval.explain.flips import flips, refusing_first
from omnieval.explain.revisit import Revisit
from omnieval.explain.scene import Scene, image_text
from omnieval.explain.words import (
    comparison_text,
    decision_text,
    distinct,
    event_text,
    margin_text,
    threshold_text,
)
from omnieval.mapping.interface import Method
from omnieval.mapping.step import Comparison, Placement
from omnieval.wording import counted

Line = tuple[str, str]

NEAREST = 3
"""How many of the refused nodes are distinguished from the rest."""

_PLACEMENTS = {
    Placement.FOUNDING: "one of the images the node was made of",
    Placement.LOOP_CLOSURE: "assigned at its own step",
    Placement.PENDING: "taken by a pending node at its own step",
    Placement.RETEST: "a leftover that the final map accepted",
    Placement.FORCED: "a leftover put into the node of its most similar image",
    Placement.UNASSIGNED: "belongs to no node",
}


def lines(scene: Scene, method: Method) -> list[Line]:
    """Return everything that was compared at a step and the results; a label may be empty to continue with the last.

    The first line is the decision in a sentence.
    """
    step = scene.step
    page = [("decision", decision_text(step, method)), ("image", image_text(step.frame, scene.image))]
    for comparison in step.comparisons:
        page += _comparison_lines(scene, comparison, method)
    if step.match is not None:
        page.append(("best match", match_text(scene)))
    if measured := measured_text(scene, method):
        page.append(("measured", measured))
    if scene.revisit is not None:
        page.append(("true place", revisit_text(scene.revisit, step.frame)))
    page += [("event", event_text(event)) for event in step.events]
    if step.margin is not None:
        page.append(("margin", margin_text(step, method)))
    return page + labelled("would flip", (flip.text for flip in refusing_first(flips(step, method))))


def match_text(scene: Scene) -> str:
    """Say which image is the most similar one, where it was taken, and how it has to be turned."""
    match = scene.step.match
    if match is None:
        return "none"
    room = f" in {scene.best.room}" if scene.best is not None and scene.best.room is not None else ""
    away = f", {scene.metres:.2f} m away" if scene.metres is not None else ""
    degrees = f" ({scene.shift_degrees:.1f} deg)" if scene.shift_degrees is not None else ""
    return f"{match.frame} of node {match.node}{room}{away}, turned by {counted(match.shift, 'cell')}{degrees}"


def measured_text(scene: Scene, method: Method) -> str:
    """Return what else the mapper measured, in the order of its columns, unless a comparison shows it already."""
    said = {value for one in scene.step.comparisons for value in (*one.values, one.threshold)}
    values = [(column, scene.step.measured.get(column.name)) for column in method.columns]
    return ", ".join(
        f"{column.name} {value:.3g}{f' {column.unit}' if column.unit else ''}"
        for column, value in values
        if value is not None and value not in said
    )


def revisit_text(revisit: Revisit, frame: int) -> str:
    """Say whether the image was taken where an earlier one was that a node holds."""
    room = f" in {revisit.image.room}" if revisit.image.room is not None else ""
    ago = counted(frame - revisit.frame, "step")
    place = f"{revisit.frame} of node {revisit.node}{room}, {revisit.distance:.2f} m away and {ago} ago"
    return f"that of image {place}" if revisit.near else f"a new one; the nearest in an active node is image {place}"


def placement_text(node: int | None, placement: Placement | None) -> str:
    """Say where the image ended, and how it came there."""
    if placement is None:
        return "unknown: the run did not reach its end"
    where = f"node {node}" if node is not None else "no node"
    return f"{where}, {placement.value}: {_PLACEMENTS[placement]}"


def labelled(label: str, texts: Iterable[str]) -> list[Line]:
    """Return texts as lines under one label."""
    return [(label if number == 0 else "", text) for number, text in enumerate(texts)]


def _comparison_lines(scene: Scene, comparison: Comparison, method: Method) -> Iterator[Line]:
    """Yield a comparison; of one with several values the threshold, what passes, the nearest refused ones, the rest."""
    gate, threshold = method.gate(comparison.gate), comparison.threshold
    if not comparison.of or (len(comparison.of) == 1 and not gate.closes):
        yield comparison.gate, comparison_text(scene.step, comparison, method)
        return
    sign = ">=" if comparison.reaches else "<="
    yield comparison.gate, f"{gate.value} {sign} {threshold_text(comparison, method)}"
    pairs = sorted(zip(comparison.values, comparison.of, strict=True), reverse=comparison.reaches)
    passing = set(comparison.passing)
    said = {one: f"{one} at {distinct(value, threshold)}" for value, one in pairs}
    passed = [f"{gate.of} {said[one]}" for _, one in pairs if one in passing]
    refused = [said[one] for _, one in pairs if one not in passing]
    yield "  passed", ", ".join(passed) or "none"
    if refused:
        yield "  refused", ", ".join(f"{gate.of} {text}" for text in refused[:NEAREST])
    if len(refused) > NEAREST:
        yield "  far", ", ".join(refused[NEAREST:])
