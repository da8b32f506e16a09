"""What a step decided, in words: the log, the page that says why, and what is said of an image that is selected."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from omnieval.explain.flips import flips
from omnieval.explain.page import Line, lines
from omnieval.explain.scene import Scene
from omnieval.explain.words import decision_text, event_text
from omnieval.mapping.interface import Method
from omnieval.mapping.step import EventKind, Role, Step
from omnieval.recording import entities
from omnieval.recording.rows import Facts, Page, Words
from omnieval.recording.styles import ROLE_COLORS, lane_state, node_color

_LINE_BREAK = "  \n"
"""Markdown for a new line without a gap: the page has room for some ten lines on a small screen."""
_UNKNOWN = "-"
_LOUD = frozenset({Role.REFUSED, Role.UNASSIGNED})


def word_rows(step: Step, method: Method) -> list[tuple[str, Words]]:
    """Return the decision and the events of a step in words."""
    level = "WARN" if step.role in _LOUD else "INFO"
    decision = Words(numbered(step.frame, decision_text(step, method)), level, ROLE_COLORS[step.role])
    rows = [(entities.LOG_DECISION, decision)]
    for event in step.events:
        color = node_color(event.into if event.kind is EventKind.MERGED and event.into else event.node)
        words = Words(numbered(step.frame, event_text(event)), event.kind.value.upper(), color)
        rows.append((entities.LOG_EVENT, words))
    return rows


def numbered(step: int, text: str) -> str:
    """Return a line of the log with its step: the viewer's own column of steps is too narrow for three digits."""
    return f"{step}: {text}"


def why_row(scene: Scene, method: Method) -> tuple[str, Page]:
    """Return the decision and what was compared as a page; the plots beside it show the rest.

    The reasons come first: of a refused image, what would have let it in; of an accepted one, whether it was rightly
    so.
    """
    step, closed = scene.step, scene.step.role is Role.JOINED
    said: dict[str, str] = {}
    for label, text in _paragraphs(lines(scene, method)):
        said.setdefault(label, text)
    flip = "; ".join(flip.text for flip in flips(step, method) if flip.passed is closed)
    # A count that passes says nothing, nor does what an accepted image was compared with besides.
    gates = [
        one.gate
        for one in step.comparisons
        if not (one.counts and one.passed) and (method.gate(one.gate).closes or not (closed or one.of))
    ]
    reasons = ["event", "true place", "best match", *dict.fromkeys(gates), "margin", "image"]
    why = [(label, said[label]) for label in reasons if label in said]
    if flip:
        at = reasons.index("margin") if closed else reasons.index("best match")
        before = sum(label in said for label in reasons[:at])
        why.insert(before, ("would flip", flip))
    body = _LINE_BREAK.join(f"**{label}** {text}" for label, text in why)
    return entities.WHY, Page(f"**{said['decision']}**\n\n{body}")


def _paragraphs(page: list[Line]) -> Iterator[Line]:
    """Yield lines with those that are indented below them; how far off the far nodes are is left out."""
    label, texts = page[0][0], [page[0][1]]
    for one, text in page[1:]:
        if one.startswith(" "):
            if one.strip() != "far":
                texts.append(f"{one.strip()} {text}")
        elif one:
            yield label, "; ".join(texts)
            label, texts = one, [text]
    yield label, "; ".join(texts)


class ImageFacts:
    """Collects a line of facts of every image with a position, in their order.

    They are written when the run is over, each of them twice: by the place of the image among all those of the map, and
    among those that were drawn since all were. Written whenever an image is drawn, they would be most of the
    recording.
    """

    def __init__(self, method: Method) -> None:
        self._method = method
        self._frames: list[int] = []
        self._lines: list[dict[str, str]] = []

    def add(self, scene: Scene) -> None:
        """Take in the image of a step; one without a position is not on the map."""
        image, pose = scene.image, scene.image.pose
        if pose is None or not math.isfinite(pose.x):
            return
        self._frames.append(scene.step.frame)
        self._lines.append(
            {
                "image": str(scene.step.frame),
                "file": image.file or _UNKNOWN,
                "room": image.room or _UNKNOWN,
                "outcome": scene.outcome,
                "decision": decision_text(scene.step, self._method),
                "best_match_metres": _UNKNOWN if scene.metres is None else f"{scene.metres:.2f}",
            }
        )

    def all(self, labels: NDArray[np.int64] | None) -> Facts:
        """Return the facts of all images.

        Parameters
        ----------
        labels
            Node of every image in the final map, 0 where unassigned; None without a final map.
        """
        return self._between(0, len(self._frames), labels)

    def recent(self, drawn: Mapping[int, int], labels: NDArray[np.int64] | None) -> Iterator[tuple[int, Facts]]:
        """Yield from which step on the recent images are which, with their facts.

        Parameters
        ----------
        drawn
            At which steps how many images were drawn at once, ascending: later ones are the recent ones from there on.
        labels
            As for `all`.
        """
        starts = np.searchsorted(self._frames, list(drawn.values())).tolist()
        for step, first, last in zip(drawn, starts, [*starts[1:], len(self._frames)], strict=True):
            if first < last:
                yield step, self._between(first, last, labels)

    def _between(self, first: int, last: int, labels: NDArray[np.int64] | None) -> Facts:
        lines, frames = self._lines[first:last], self._frames[first:last]
        values = {name: [line[name] for line in lines] for name in (lines[0] if lines else ())}
        if lines and labels is not None:
            values["final_node"] = [lane_state(int(labels[frame])) for frame in frames]
        return Facts(values)
