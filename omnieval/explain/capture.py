"""Where and when an image was taken."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, slots=True)
class Capture:
    """What is known of an image besides its pixels.

    Attributes
    ----------
    frame
        Number of the image, 0-based.
    file
        Name it is recorded under; empty where it does not matter.
    time_ns
        Time of capture, nanoseconds since the epoch; None where unknown.
    x, y
        Where it was taken, metres; None without pose.
    yaw
        Heading, radians, counter-clockwise; None without pose.
    room
        Room label; None where there is none.
    """

    frame: int
    file: str
    time_ns: int | None = None
    x: float | None = None
    y: float | None = None
    yaw: float | None = None
    room: str | None = None

    @property
    def time(self) -> str | None:
        """Time of capture, ISO 8601 to the millisecond, in the dataset's own zone."""
        if self.time_ns is None:
            return None
        return str(np.datetime_as_string(np.datetime64(self.time_ns, "ns"), unit="ms"))

    def distance(self, other: Capture) -> float | None:
        """Return the distance between two capture points, metres; None unless both are known."""
        if self.x is None or self.y is None or other.x is None or other.y is None:
            return None
        distance = math.hypot(self.x - other.x, self.y - other.y)
        return distance if math.isfinite(distance) else None
