"""How a robot moves in the plane, as far as its images tell: ahead, to a side, and how it turns."""

from __future__ import annotations

import math
from dataclasses import dataclass

_SUDDEN = 0.5
"""Radians that no robot turns from one image to the next: the images were aligned wrongly."""


@dataclass(frozen=True, slots=True)
class Motion:
    """Where a pose is, seen from another.

    Attributes
    ----------
    ahead, aside
        Frames of travel in the direction that the other looks in, and across it.
    turn
        The angle between the directions, radians. Which way counts as positive does not matter, if it is always the
        same one.
    """

    ahead: float = 0.0
    aside: float = 0.0
    turn: float = 0.0

    @staticmethod
    def step(travel: float, turn: float) -> Motion:
        """Return the motion from one image to the next, along an arc; a sudden turn is taken for none."""
        turn = 0.0 if abs(turn) > _SUDDEN else turn
        return Motion(travel * math.cos(turn / 2), travel * math.sin(turn / 2), turn)

    @property
    def distance(self) -> float:
        """Straight travel from one to the other."""
        return math.hypot(self.ahead, self.aside)

    @property
    def back(self) -> Motion:
        """The way back."""
        cos, sin = math.cos(self.turn), math.sin(self.turn)
        return Motion(-(cos * self.ahead + sin * self.aside), sin * self.ahead - cos * self.aside, -self.turn)

    def then(self, more: Motion) -> Motion:
        """Return this motion, and another from there."""
        cos, sin = math.cos(self.turn), math.sin(self.turn)
        return Motion(
            self.ahead + cos * more.ahead - sin * more.aside,
            self.aside + sin * more.ahead + cos * more.aside,
            self.turn + more.turn,
        )


def angle_of(shift: int, cells: int) -> float:
    """Return the turn that rolls an orientation descriptor by `shift` of its `cells`, radians in (-pi, pi].

    Examples
    --------
    >>> [round(math.degrees(angle_of(shift, 8))) for shift in (0, 1, 4, 7)]
    [0, 45, 180, -45]
    """
    return 2 * math.pi * (shift if 2 * shift <= cells else shift - cells) / cells
