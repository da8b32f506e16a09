"""What a step notes down while it decides: events of nodes, and how close its comparisons were."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from omnieval.mapping.step import Margin, Match, NodeEvent


class Journal:
    """Events of one step in order, and its margin: the comparison that was nearest to going the other way."""

    def __init__(self) -> None:
        self.events: list[NodeEvent] = []
        self.margin: Margin | None = None

    def compare(self, gate: str, values: NDArray[np.float64] | Sequence[float] | float, threshold: float) -> None:
        """Note the comparison of each of some values with a threshold."""
        distances = np.abs(np.asarray(values, np.float64) - threshold)
        if distances.size:
            self._note(float(distances.min()) / (abs(threshold) or 1.0), gate)

    def compare_best(self, match: Match, sizes: Sequence[int]) -> None:
        """Note how much more similar the best image is than the best one of any other candidate node.

        `sizes` are the numbers of images of the candidate nodes, in the order of the match.
        """
        if len(sizes) < 2:
            return
        starts = np.cumsum([0, *sizes[:-1]])
        best_of_each = np.sort(np.maximum.reduceat(match.similarity, starts))
        self._note(1.0 - float(best_of_each[-2] / best_of_each[-1]), "match")

    def _note(self, value: float, gate: str) -> None:
        if self.margin is None or value < self.margin.value:
            self.margin = Margin(value, gate)
