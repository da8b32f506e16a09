"""What the building is made of: upright boxes and cylinders, as data."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import IntEnum

import numpy as np


class Shape(IntEnum):
    """The plan of a solid."""

    BOX = 0
    CYLINDER = 1


@dataclass(frozen=True, slots=True)
class Solid:
    """An upright box or cylinder between two heights.

    Attributes
    ----------
    x, y
        Centre in the building's frame, metres.
    width, depth
        Extent along the solid's own x and y axis, metres; a cylinder's diameter is `width`.
    z0, z1
        Heights of its bottom and top above the floor, metres.
    side, top
        Names of the textures of its faces and of its top and underside.
    yaw
        Rotation about the vertical, radians, counter-clockwise.
    shape
        Its plan.
    fit
        True: the side texture covers each face once. False: it repeats at its own size.
    glass
        Share of the light behind that the solid takes away; 0 for the opaque ones.
    """

    x: float
    y: float
    width: float
    depth: float
    z0: float
    z1: float
    side: str
    top: str
    yaw: float = 0.0
    shape: Shape = Shape.BOX
    fit: bool = False
    glass: float = 0.0

    def moved(self, dx: float, dy: float, turn: float = 0.0) -> Solid:
        """Return the solid turned about the origin by `turn`, then shifted by (dx, dy)."""
        c, s = np.cos(turn), np.sin(turn)
        x, y = c * self.x - s * self.y + dx, s * self.x + c * self.y + dy
        return replace(self, x=float(x), y=float(y), yaw=self.yaw + turn)


def box(x0: float, x1: float, y0: float, y1: float, z0: float, z1: float, side: str, top: str = "") -> Solid:
    """Return an axis-aligned box from its bounds; its top looks like its sides unless told."""
    return Solid((x0 + x1) / 2, (y0 + y1) / 2, x1 - x0, y1 - y0, z0, z1, side, top or side)


def pillar(x: float, y: float, diameter: float, z0: float, z1: float, side: str, top: str = "") -> Solid:
    """Return a cylinder; its top looks like its side unless told."""
    return Solid(x, y, diameter, diameter, z0, z1, side, top or side, shape=Shape.CYLINDER)
