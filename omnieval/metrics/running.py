"""The silhouette while the map grows, from the steps as they come."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from omnieval.mapping.step import EventKind, Role, Step
from omnieval.metrics.silhouette import IncrementalSilhouette


class SilhouetteSoFar:
    """Follows a replay step by step.

    Parameters
    ----------
    positions
        True capture positions, shape (n, 2), metres; NaN where unknown, which leaves the image out.
    """

    def __init__(self, positions: NDArray[np.float64]) -> None:
        self._positions = positions
        self._silhouette = IncrementalSilhouette()

    def apply(self, step: Step) -> float | None:
        """Take in a step and return the silhouette after it, None while there are fewer than two nodes."""
        for event in step.events:
            if event.kind is EventKind.CREATED:
                for frame in event.frames:
                    self._add(frame, event.node)
            elif event.kind is EventKind.MERGED and event.into is not None:
                self._silhouette.merge(event.node, event.into)
        if step.role in {Role.JOINED, Role.PENDING} and step.node is not None:
            self._add(step.frame, step.node)
        return self._silhouette.value()

    def _add(self, frame: int, node: int) -> None:
        x, y = self._positions[frame].tolist()
        if math.isfinite(x) and math.isfinite(y):
            self._silhouette.add((x, y), node)
