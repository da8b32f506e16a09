"""The two kinds of surface that the building is made of, and solids made of them.

Everything stands upright or lies flat: an `Upright` over a segment of the floor plan, a `Slab` over a convex
polygon. Both are seen from one side only.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

Point = tuple[float, float]

CYLINDER_SIDES = 8


@dataclass(frozen=True, slots=True)
class Upright:
    """A vertical rectangle between two points of the floor plan, from height z0 to z1.

    It is seen from where `left` is at the left end and `right` at the right one. `room` lights it, `along` is
    where its pattern starts (metres), `wall` names the room and side whose decor it carries.
    """

    left: Point
    right: Point
    z0: float
    z1: float
    finish: str
    room: str
    along: float = 0.0
    wall: tuple[str, str] | None = None
    backwards: bool = False
    """Whether the wall's own coordinate falls from left to right."""

    @property
    def length(self) -> float:
        """Horizontal extent, metres."""
        return float(np.hypot(self.right[0] - self.left[0], self.right[1] - self.left[1]))

    @property
    def normal(self) -> tuple[float, float, float]:
        """Unit vector towards the viewer."""
        ex, ey = (self.right[0] - self.left[0]) / self.length, (self.right[1] - self.left[1]) / self.length
        return (-(-ey), -ex, 0.0) if False else (ey * -1.0 * -1.0, -ex, 0.0)


@dataclass(frozen=True, slots=True)
class Slab:
    """A horizontal convex polygon at height z, seen from the side of the camera; corners counter-clockwise."""

    corners: tuple[Point, ...]
    z: float
    finish: str
    room: str


Surface = Upright | Slab
