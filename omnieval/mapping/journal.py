"""What a step notes down while it decides: events of nodes, and everything it compared."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from omnieval.mapping.config import MapperConfig
from omnieval.mapping.step import Comparison, Margin, Match, NodeEvent


class Journal:
    """Events and comparisons of one step, in order."""

    def __init__(self) -> None:
        self.events: list[NodeEvent] = []
        self.comparisons: list[Comparison] = []

    def compare(
        self,
        gate: str,
        values: Sequence[float],
        threshold: float,
        *,
        parameter: str | None = None,
        floor: float = -np.inf,
        between: tuple[float, float] | None = None,
    ) -> None:
        """Note that values were compared with a threshold: at most the threshold, or more.

        Parameters
        ----------
        gate
            The gate they were compared for.
        values
            What was compared; may be empty.
        threshold
            With what.
        parameter, floor
            The parameter the threshold comes from, if it does, and what it is at least.
        between
            Between which thresholds the decision is the same; None if it takes every value to be on the same side.
        """
        if not values:
            return
        low, high = between or (
            max((value for value in values if value <= threshold), default=-np.inf),
            min((value for value in values if value > threshold), default=np.inf),
        )
        self.comparisons.append(Comparison(gate, tuple(values), threshold, low, high, parameter, floor))

    def reach(self, gate: str, value: float, threshold: float, *, parameter: str | None = None) -> None:
        """Note that a value was compared with a threshold: at least the threshold, or less."""
        low, high = (-np.inf, value) if value >= threshold else (value, np.inf)
        self.comparisons.append(Comparison(gate, (value,), threshold, low, high, parameter, reaches=True))

    def first(self, gate: str) -> float | None:
        """Return the smallest of the values that a gate was asked about first; None if it was not asked."""
        return next((min(one.values) for one in self.comparisons if one.gate == gate), None)

    def compare_best(self, match: Match, sizes: Sequence[int]) -> None:
        """Note how much more similar the best image is than the best one of any other candidate node.

        `sizes` are the numbers of images of the candidate nodes, in the order of the match.
        """
        if len(sizes) < 2:
            return
        starts = np.cumsum([0, *sizes[:-1]])
        second, best = np.sort(np.maximum.reduceat(match.similarity, starts))[-2:].tolist()
        self.comparisons.append(Comparison("match", (second,), best, second, np.inf))


def smallest_margin(comparisons: Iterable[Comparison], config: MapperConfig) -> Margin | None:
    """Return how near a step was to going another way; None when nothing was compared.

    `config` gives the thresholds. It may be another one than the step was decided with, as long as every comparison
    comes out the same.
    """
    smallest: Margin | None = None
    for one in comparisons:
        if one.gate == "run":
            continue
        threshold = one.threshold
        if one.parameter is not None:
            threshold = one.threshold_at(getattr(config, one.parameter))
        value = one.margin_at(threshold)
        if smallest is None or value < smallest.value:
            smallest = Margin(value, one.gate)
    return smallest
