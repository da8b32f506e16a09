"""A step with its surroundings: its image, the image it was matched with, and the one it truly revisits."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from omnieval.datasets.sequence import Frame
from omnieval.explain.revisit import Revisit
from omnieval.mapping.step import Role, Step


@dataclass(frozen=True)
class Scene:
    """A step with its surroundings.

    Attributes
    ----------
    step
        What was decided.
    image
        The image.
    best
        The image it was matched with (`Step.match`); None where there is none.
    revisit
        The earlier image with which a loop would rightly be closed; None where there is none, or no ground truth.
    cells
        Cells of the orientation descriptor, the unit of shifts.
    """

    step: Step
    image: Frame
    best: Frame | None = None
    revisit: Revisit | None = None
    cells: int | None = None

    @property
    def metres(self) -> float | None:
        """Metres between the capture points of the image and its match; None unless both are known."""
        return None if self.best is None else metres_between(self.image, self.best)

    @property
    def shift_degrees(self) -> float | None:
        """How far the match is turned to align with the image, degrees in (-180, 180]; None where it is not known."""
        if self.step.match is None or not self.cells:
            return None
        degrees = 360.0 * (self.step.match.shift % self.cells) / self.cells
        return degrees - 360.0 if degrees > 180.0 else degrees

    @property
    def outcome(self) -> str:
        """The outcome for the image as one word: a refused one at a known place is a missed loop closure."""
        if self.step.role is Role.REFUSED:
            return "missed" if self.revisit is not None and self.revisit.near else "refused"
        return "closed" if self.step.role is Role.JOINED else self.step.role.value


def metres_between(one: Frame, other: Frame) -> float | None:
    """Return the distance between two capture points, metres; None unless both are known."""
    if one.pose is None or other.pose is None:
        return None
    distance = math.hypot(one.pose.x - other.pose.x, one.pose.y - other.pose.y)
    return distance if math.isfinite(distance) else None


def image_text(frame: int, image: Frame) -> str:
    """Say which image it is and where and when it was taken."""
    parts = [f"{frame}: {image.file}" if image.file else f"{frame}"]
    if image.room is not None:
        parts.append(f"in {image.room}")
    if image.pose is not None:
        parts.append(f"at ({image.pose.x:.2f}, {image.pose.y:.2f}) m")
        if math.isfinite(image.pose.yaw):
            parts.append(f"heading {math.degrees(image.pose.yaw):.0f} deg")
    if image.time_ns is not None:
        parts.append(str(np.datetime_as_string(np.datetime64(image.time_ns, "ns"), unit="ms")))
    return ", ".join(parts)
