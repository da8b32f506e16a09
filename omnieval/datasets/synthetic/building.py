"""The plan of the building: rooms, openings and lamps as data, and the walls that follow from them.

x runs along the corridor, y to the left of a robot that drives along it; metres, the floor is z = 0.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal

from omnieval.datasets.synthetic.solids import Solid, box

CEILING = 2.6
"""Height of every room, metres."""
SHELL = 0.075
"""Every room has a wall shell of its own this thick; two shells, back to back, make a wall."""
FRAME = 0.05
FOOTPRINT = (-0.15, 20.15, -5.55, 6.15)
"""x0, x1, y0, y1 of the outer walls' outside."""


@dataclass(frozen=True, slots=True)
class Room:
    """A rectangular room: its inside bounds, its COLD-like code, and what its surfaces look like."""

    code: str
    x0: float
    x1: float
    y0: float
    y1: float
    wall: str
    floor: str
    lamps: tuple[tuple[float, float], ...]

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


def _grid(x0: float, x1: float, y0: float, y1: float) -> tuple[tuple[float, float], ...]:
    """Return the places of four lamps."""
    return tuple((x, y) for y in (y0, y1) for x in (x0, x1))


ROOMS: tuple[Room, ...] = (
    Room("CR", 0.0, 20.0, -1.0, 1.0, "plaster-dado", "linoleum", ((2.5, 0.0), (7.5, 0.0), (12.5, 0.0), (17.5, 0.0))),
    Room("1PO", 0.0, 3.45, 1.15, 6.0, "paper-stripes", "parquet", ((1.7, 3.5),)),
    Room("2PO1", 3.6, 7.25, 1.15, 6.0, "plaster-cream", "carpet-blue", ((5.4, 2.5), (5.4, 4.8))),
    Room("2PO2", 7.4, 11.05, 1.15, 6.0, "plaster-cream", "carpet-blue", ((9.2, 2.5), (9.2, 4.8))),
    Room("CNR", 11.2, 16.05, 1.15, 6.0, "panelling", "carpet-grey", _grid(12.6, 14.6, 2.6, 4.6)),
    Room("KT", 16.2, 20.0, 1.15, 6.0, "tiles-green", "checker", ((18.1, 2.6), (18.1, 4.6))),
    Room("PA", 0.0, 4.0, -5.4, -1.15, "plaster-dado", "linoleum", ((2.0, -3.2),)),
    Room("TL", 4.15, 6.45, -5.4, -1.15, "tiles-white", "tiles-small", ((5.3, -2.2), (5.3, -4.2))),
    Room("ST", 6.6, 9.2, -5.4, -1.15, "bricks", "concrete", ((7.9, -3.2),)),
    Room("LO", 9.35, 14.25, -5.4, -1.15, "paper-flowers", "planks", ((10.8, -3.2), (12.9, -3.2))),
    Room(
        "LAB",
        14.4,
        20.0,
        -5.4,
        -1.15,
        "concrete-wall",
        "tiles-large",
        _grid(15.8, 18.4, -4.3, -2.4),
    ),
)
TWINS = ("2PO1", "2PO2")
"""Two rooms alike on purpose: what is in one is in the other, shifted by `TWIN_SHIFT` along x."""
TWIN_SHIFT = 3.8

_NORTH, _SOUTH, _OUT_NORTH, _OUT_SOUTH = 1.075, -1.075, 6.075, -5.475
OPENINGS: tuple[Opening, ...] = (
    Opening("x", _NORTH, 2.1, 3.1, "door"),
    Opening("x", _NORTH, 4.0, 5.0, "door"),
    Opening("x", _NORTH, 7.8, 8.8, "door"),
    Opening("x", _NORTH, 11.5, 12.5, "door"),
    Opening("x", _NORTH, 12.7, 15.8, "glass", 0.1, 2.3),
    Opening("x", _NORTH, 16.8, 17.8, "door"),
    Opening("x", _SOUTH, 0.9, 3.1, "passage", 0.0, 2.3),
    Opening("x", _SOUTH, 4.8, 5.8, "door"),
    Opening("x", _SOUTH, 7.4, 8.4, "door"),
    Opening("x", _SOUTH, 9.8, 11.2, "passage", 0.0, 2.2),
    Opening("x", _SOUTH, 15.5, 16.5, "door"),
    Opening("x", _OUT_NORTH, 0.8, 2.6, "window", 0.9, 2.1),
    Opening("x", _OUT_NORTH, 4.2, 6.6, "window", 0.9, 2.1),
    Opening("x", _OUT_NORTH, 8.0, 10.4, "window", 0.9, 2.1),
    Opening("x", _OUT_NORTH, 11.8, 15.5, "window", 0.5, 2.2),
    Opening("x", _OUT_NORTH, 17.2, 19.2, "window", 1.1, 2.1),
    Opening("x", _OUT_SOUTH, 1.0, 2.6, "window", 0.9, 2.1),
    Opening("x", _OUT_SOUTH, 4.9, 5.7, "window", 1.5, 2.1),
    Opening("x", _OUT_SOUTH, 9.9, 13.7, "window", 0.25, 2.2),
    Opening("x", _OUT_SOUTH, 15.0, 16.9, "window", 0.9, 2.1),
    Opening("x", _OUT_SOUTH, 17.5, 19.4, "window", 0.9, 2.1),
    Opening("y", 20.075, -0.7, 0.7, "window", 0.8, 2.2),
    Opening("y", -0.075, -0.7, 0.7, "window", 0.1, 2.1),
)


def room_of(x: float, y: float) -> Room:
    """Return the room at (x, y) or the nearest; a doorway's halves belong to the rooms they open to."""
    return min(ROOMS, key=lambda room: room.distance(x, y))


def walls() -> list[Solid]:
    """Return the wall shells of all rooms, with frames and panes in their openings."""
    solids = [solid for room in ROOMS for solid in _shell(room)]
    return solids + [solid for opening in OPENINGS for solid in _filling(opening)]


def lamps() -> list[Solid]:
    """Return the lamps below the ceilings."""
    return [
        box(x - 0.6, x + 0.6, y - 0.12, y + 0.12, CEILING - 0.1, CEILING - 0.04, "lamp")
        for room in ROOMS
        for x, y in room.lamps
    ]


def _shell(room: Room) -> list[Solid]:
    """Return the four walls of a room, cut by its openings."""
    solids: list[Solid] = []
    for axis, at, low, high, inner in (
        ("x", room.y1 + SHELL / 2, room.x0, room.x1, room.y1),
        ("x", room.y0 - SHELL / 2, room.x0, room.x1, room.y0),
        ("y", room.x1 + SHELL / 2, room.y0, room.y1, room.x1),
        ("y", room.x0 - SHELL / 2, room.y0, room.y1, room.x0),
    ):
        holes = [o for o in OPENINGS if o.axis == axis and abs(o.at - inner) < 0.1 and low <= o.start < high]
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
