"""What the viewer says of an image on the map that is hovered or selected."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from omnieval.explain.decision import Decision
from omnieval.explain.words import decision_text
from omnieval.recording.evidence import decision_state
from omnieval.recording.rows import Facts
from omnieval.recording.styles import lane_state

_UNKNOWN = "-"


class ImageFacts:
    """Collects a line of facts of every image with a position, in their order.

    They are written when the run is over, each of them twice: by the place of the image among all those of the map, and
    among those that were drawn since all were. Written whenever an image is drawn, they would be most of the
    recording.

    Parameters
    ----------
    gamma
        The prominence condition's factor.
    """

    def __init__(self, gamma: float) -> None:
        self._gamma = gamma
        self._frames: list[int] = []
        self._lines: list[dict[str, str]] = []

    def add(self, decided: Decision) -> None:
        """Take in the image of a step; one without a position is not on the map."""
        capture, match = decided.capture, decided.match
        if capture.x is None or capture.y is None or not math.isfinite(capture.x):
            return
        self._frames.append(capture.frame)
        self._lines.append(
            {
                "image": str(capture.frame),
                "file": capture.file or _UNKNOWN,
                "room": capture.room or _UNKNOWN,
                "outcome": decision_state(decided),
                "decision": decision_text(decided, self._gamma),
                "best_match_metres": _UNKNOWN if match is None or match.distance is None else f"{match.distance:.2f}",
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
