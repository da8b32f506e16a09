"""Which earlier image a loop would rightly be closed with, by the ground truth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from omnieval.datasets.sequence import Frame
from omnieval.mapping.partition import Partition

NEAR_METRES = 1.0
"""Capture points up to so far apart are taken for the same place."""

AGO_STEPS = 20
"""Steps after which a place counts as left: the last images are near by whether it is met again or not."""


@dataclass(frozen=True, slots=True)
class Revisit:
    """The image of an active node that was taken nearest to a new one, the last images left out.

    Attributes
    ----------
    frame, image
        The earlier image.
    node
        Its node at that step.
    distance
        Metres between the two capture points.
    """

    frame: int
    image: Frame
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
        Least number of steps between the two.
    """

    def __init__(self, ago: int = AGO_STEPS) -> None:
        self._ago = ago
        self._images: list[Frame] = []
        self._positions = np.full((64, 2), np.nan)

    def find(self, image: Frame, before: Partition) -> Revisit | None:
        """Return the image that the next one revisits; None if there is none with a known position.

        Parameters
        ----------
        image
            The next image.
        before
            The map as it was when the image came.
        """
        frame = len(self._images)
        if frame == len(self._positions):
            self._positions = np.concatenate([self._positions, np.full_like(self._positions, np.nan)])
        here = np.full(2, np.nan) if image.pose is None else np.array([image.pose.x, image.pose.y])
        self._positions[frame] = here
        self._images.append(image)
        count = max(frame - self._ago + 1, 0)
        labels = before.labels[:count]
        distances = np.linalg.norm(self._positions[:count] - here, axis=1)
        distances[~np.isin(labels, list(before.active)) | ~np.isfinite(distances)] = np.inf
        if not np.isfinite(distances).any():
            return None
        nearest = int(distances.argmin())
        return Revisit(nearest, self._images[nearest], int(labels[nearest]), float(distances[nearest]))
