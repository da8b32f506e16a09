"""Which earlier image a loop would rightly be closed with, by the ground truth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from omnieval.explain.capture import Capture
from omnieval.mapping.partition import Partition

NEAR_METRES = 1.0
"""Capture points up to so far apart are taken for the same place."""


@dataclass(frozen=True, slots=True)
class Revisit:
    """The image of an active node that was taken nearest to a new one, images of the current run left out.

    Attributes
    ----------
    capture
        The earlier image.
    node
        Its node at that step.
    distance
        Metres between the two capture points.
    """

    capture: Capture
    node: int
    distance: float

    @property
    def near(self) -> bool:
        """Whether both were taken at the same place, so that closing a loop would be right."""
        return self.distance <= NEAR_METRES


class Revisits:
    """Follows a replay and finds for every image the one it revisits.

    Parameters
    ----------
    ago
        Least number of steps between the two: the last images are near by whether a place is revisited or not.
    """

    def __init__(self, ago: int) -> None:
        self._ago = ago
        self._captures: list[Capture] = []
        self._positions = np.full((64, 2), np.nan)

    def find(self, capture: Capture, before: Partition) -> Revisit | None:
        """Return the image that the next one revisits; None if there is none with a known position.

        Parameters
        ----------
        capture
            The next image.
        before
            The map as it was when the image came.
        """
        frame = len(self._captures)
        if frame == len(self._positions):
            self._positions = np.concatenate([self._positions, np.full_like(self._positions, np.nan)])
        here = np.array([np.nan if value is None else value for value in (capture.x, capture.y)])
        self._positions[frame] = here
        self._captures.append(capture)
        count = max(frame - self._ago + 1, 0)
        labels = before.labels[:count]
        distances = np.linalg.norm(self._positions[:count] - here, axis=1)
        distances[~np.isin(labels, list(before.active)) | ~np.isfinite(distances)] = np.inf
        if not np.isfinite(distances).any():
            return None
        nearest = int(distances.argmin())
        return Revisit(self._captures[nearest], int(labels[nearest]), float(distances[nearest]))
