"""What a step notes down while it decides: events of nodes, and everything it compared."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from omnieval.mapping.step import Comparison, NodeEvent


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
        of: Sequence[int] = (),
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
        of
            The nodes or images that the values belong to.
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
        self.comparisons.append(Comparison(gate, tuple(values), threshold, low, high, parameter, floor, of=tuple(of)))

    def reach(
        self, gate: str, value: float, threshold: float, *, parameter: str | None = None, counts: bool = False
    ) -> bool:
        """Note that a value was compared with a threshold, and return whether it reaches it."""
        passed = value >= threshold
        low, high = (-np.inf, value) if passed else (value, np.inf)
        self.comparisons.append(
            Comparison(gate, (value,), threshold, low, high, parameter, reaches=True, counts=counts)
        )
        return passed

    def first(self, gate: str) -> float | None:
        """Return the smallest of the values that a gate was asked about first; None if it was not asked."""
        return next((min(one.values) for one in self.comparisons if one.gate == gate), None)
