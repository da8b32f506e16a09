"""What a building is: rooms, openings, lamps and furniture as data, and the walls that follow from them.

x points east, y north; metres, the floor is z = 0.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

from omnieval.datasets.synthetic.solids import Solid, box

CEILING = 2.6
"""Height of every room, metres."""
SHELL = 0.075
"""Every room has a wall shell of its own this thick; two shells, back to back, make a wall."""
FRAME = 0.05


@dataclass(frozen=True, slots=True)
class Room:
    """A rectangular room: inside bounds, COLD-like code, what its surfaces look like, lamps and their tint (BGR)."""

    code: str
    x0: float
    x1: float
    y0: float
    y1: float
    wall: str
    floor: str
    lamps: tuple[tuple[float, float], ...]
    tint: tuple[float, float, float] = (1.0, 1.0, 1.0)

    @property
    def corridor(self) -> bool:
        """Whether it is a way between rooms."""
        return self.code.startswith("CR")

    def distance(self, x: float, y: float) -> float:
        """Return how far (x, y) lies outside the room's bounds, metres; 0 inside."""
        return math.hypot(max(self.x0 - x, x - self.x1, 0.0), max(self.y0 - y, y - self.y1, 0.0))


@dataclass(frozen=True, slots=True)
class Opening:
    """A hole in a wall: along `axis` from `start` to `end`, at `at` on the other axis.

    `kind` says what fills it: nothing but a frame (door, passage), panes (window), or floor-to-head panes (glass).
    """

    axis: Literal["x", "y"]
    at: float
    start: float
    end: float
    kind: Literal["door", "passage", "window", "glass"]
    z0: float = 0.0
    z1: float = 2.05


@dataclass(frozen=True, slots=True)
class Placed:
    """A piece of furniture against a wall of a room.

    `along` is where its middle stands on that wall (x for N and S, y for E and W), `gap` how far its back is from the
    wall, both in metres; `turn` is an extra rotation in radians.
    """

    room: str
    kind: str
    wall: Literal["N", "E", "S", "W"]
    along: float
    gap: float = 0.0
    turn: float = 0.0


@dataclass(frozen=True)
class Building:
    """Rooms, the holes in their walls, and what stands in them.

    Attributes
    ----------
    number
        Its name: the N of ``synthetic:LIGHT:N``.
    rooms
        Rooms and corridors; no two overlap.
    openings
        Doors, passages, windows and glass walls.
    furniture
        What stands in the rooms, where no day has moved it.
    twins
        Codes of two rooms alike on purpose.
    """

    number: int
    rooms: tuple[Room, ...]
    openings: tuple[Opening, ...]
    furniture: tuple[Placed, ...]
    twins: tuple[str, str]

    @cached_property
    def footprint(self) -> tuple[float, float, float, float]:
        """x0, x1, y0, y1 of the outer walls' outside."""
        thick = 2 * SHELL
        return (
            round(min(room.x0 for room in self.rooms) - thick, 6),
            round(max(room.x1 for room in self.rooms) + thick, 6),
            round(min(room.y0 for room in self.rooms) - thick, 6),
            round(max(room.y1 for room in self.rooms) + thick, 6),
        )

    def room(self, code: str) -> Room:
        """Return the room of that code."""
        return next(room for room in self.rooms if room.code == code)

    def room_at(self, x: float, y: float) -> Room:
        """Return the room at (x, y) or the nearest; a doorway's halves belong to the rooms they open to."""
        return min(self.rooms, key=lambda room: room.distance(x, y))


def walls(building: Building) -> list[Solid]:
    """Return the wall shells of all rooms, with frames and panes in their openings."""
    solids = [solid for room in building.rooms for solid in _shell(room, building.openings)]
    return solids + [solid for opening in building.openings for solid in _filling(opening)]


def lamps(building: Building) -> list[Solid]:
    """Return the lamps below the ceilings."""
    return [
        box(x - 0.6, x + 0.6, y - 0.12, y + 0.12, CEILING - 0.1, CEILING - 0.04, "lamp")
        for room in building.rooms
        for x, y in room.lamps
    ]


def _shell(room: Room, openings: tuple[Opening, ...]) -> list[Solid]:
    """Return the four walls of a room, cut by its openings."""
    solids: list[Solid] = []
    for axis, at, low, high, inner in (
        ("x", room.y1 + SHELL / 2, room.x0, room.x1, room.y1),
        ("x", room.y0 - SHELL / 2, room.x0, room.x1, room.y0),
        ("y", room.x1 + SHELL / 2, room.y0, room.y1, room.x1),
        ("y", room.x0 - SHELL / 2, room.y0, room.y1, room.x0),
    ):
        holes = [o for o in openings if o.axis == axis and abs(o.at - inner) < 0.1 and low <= o.start < high]
        edge = low - SHELL
        for hole in sorted(holes, key=lambda o: o.start):
            solids.append(_piece(axis, at, edge, hole.start, 0.0, CEILING, room.wall))
            if hole.z0 > 0.0:
                solids.append(_piece(axis, at, hole.start, hole.end, 0.0, hole.z0, room.wall, "sill"))
            solids.append(_piece(axis, at, hole.start, hole.end, hole.z1, CEILING, room.wall, "sill"))
            edge = hole.end
        solids.append(_piece(axis, at, edge, high + SHELL, 0.0, CEILING, room.wall))
    return solids


def _piece(
    axis: str, at: float, start: float, end: float, z0: float, z1: float, side: str, top: str = "", thick: float = SHELL
) -> Solid:
    """Return an upright slab along a wall axis."""
    if axis == "x":
        return box(start, end, at - thick / 2, at + thick / 2, z0, z1, side, top)
    return box(at - thick / 2, at + thick / 2, start, end, z0, z1, side, top)


def _filling(opening: Opening) -> list[Solid]:
    """Return frame, mullions and panes of an opening."""
    o = opening
    colour = "frame-dark" if o.kind in ("door", "glass") else "frame-white"
    thick = 0.19 if o.kind in ("door", "passage") else 0.06

    def bar(start: float, end: float, z0: float, z1: float, thickness: float = thick) -> Solid:
        return _piece(o.axis, o.at, start, end, z0, z1, colour, thick=thickness)

    solids = [
        bar(o.start - FRAME, o.start + FRAME, o.z0, o.z1 + FRAME),
        bar(o.end - FRAME, o.end + FRAME, o.z0, o.z1 + FRAME),
        bar(o.start, o.end, o.z1 - FRAME / 2, o.z1 + FRAME),
    ]
    if o.kind in ("window", "glass"):
        panes = max(1, round((o.end - o.start) / (1.0 if o.kind == "window" else 0.8)))
        step = (o.end - o.start) / panes
        solids += [bar(o.start + i * step - 0.03, o.start + i * step + 0.03, o.z0, o.z1, 0.06) for i in range(1, panes)]
        solids.append(bar(o.start, o.end, o.z0, o.z0 + FRAME))
        pane = _piece(o.axis, o.at, o.start, o.end, o.z0, o.z1, "pane", thick=0.01)
        solids.append(replace(pane, glass=0.06 if o.kind == "window" else 0.22))
    if o.kind == "glass":
        solids.append(bar(o.start, o.end, 1.02, 1.12, 0.03))
    return solids
