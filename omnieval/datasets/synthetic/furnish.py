"""What stands in the rooms of a made building: pieces by kind of room, against walls, clear of doors and windows."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cache
from typing import Literal

import numpy as np

from omnieval.datasets.synthetic.building import Building, Opening, Placed, Room
from omnieval.datasets.synthetic.pieces import PIECES
from omnieval.datasets.synthetic.solids import Shape

Wall = Literal["N", "E", "S", "W"]
WALLS: tuple[Wall, ...] = ("N", "E", "S", "W")
_OPPOSITE: dict[Wall, Wall] = {"N": "S", "S": "N", "E": "W", "W": "E"}
_DOOR_CLEAR = 0.75
"""How far from a door's edge nothing stands on its wall, metres."""
_APART = 0.12
_FLAT = 0.06
"""What is thinner hangs on a wall and takes no room, metres."""
_LOW = 0.95
"""What is lower may stand below a window, metres."""
_DEEPEST_BESIDE = 0.45
"""What is deeper stands at the wall across from the door only, metres."""

_CONTENTS: dict[str, tuple[str, ...]] = {
    "1PO": ("workplace", "books", "cupboard", "plant", "poster-1", "radiator", "boxes", "poster-3", "bin", "coats"),
    "2PO": ("workplace", "workplace", "cupboard", "books", "whiteboard", "plant-low", "poster-2", "bin", "poster-4"),
    "CNR": ("whiteboard", "television", "sideboard", "plant", "poster-4", "radiator", "stool", "books-wide", "stool"),
    "KT": ("kitchen", "fridge", "noticeboard", "cooler", "bin", "stool", "stool", "poster-1", "cupboard-grey"),
    "PA": ("printer", "printer", "sideboard", "pigeonholes", "boxes", "bin", "noticeboard", "locker", "poster-3"),
    "TL": ("basins", "bin", "cupboard-grey", "coats", "locker", "radiator"),
    "ST": ("rack", "rack", "rack", "cupboard-grey", "boxes", "locker", "boxes", "books"),
    "LO": ("sofa-green", "sofa-red", "books-wide", "plant", "plant-low", "poster-3", "poster-4", "radiator", "coats"),
    "LAB": ("workplace", "bench", "cupboard-grey", "rack", "books", "whiteboard", "poster-2", "radiator", "boxes"),
    "OP": (
        *("workplace", "workplace", "workplace", "books-wide", "whiteboard", "plant", "sideboard", "poster-2"),
        *("cooler", "coats", "cupboard", "books", "noticeboard"),
    ),
    "CR": ("poster-3", "extinguisher", "noticeboard", "poster-1", "coats", "poster-4", "radiator", "poster-2"),
}
"""What each kind of room has, the most important first."""


@dataclass(frozen=True, slots=True)
class Size:
    """Extent of a kind of piece: along the wall to either side, into the room, and upwards, metres."""

    left: float
    right: float
    depth: float
    height: float


@cache
def size_of(kind: str) -> Size:
    """Return how large a kind of piece is."""
    solids = PIECES[kind]()
    reach = [(max(s.width, s.depth) / 2 if s.shape is Shape.CYLINDER else None, s) for s in solids]
    left = max(-(s.x - (r if r is not None else s.width / 2)) for r, s in reach)
    right = max(s.x + (r if r is not None else s.width / 2) for r, s in reach)
    depth = max(s.y + (r if r is not None else s.depth / 2) for r, s in reach)
    return Size(left, right, depth, max(s.z1 for s in solids))


def kind_of(code: str) -> str:
    """Return the kind of a room by its code, which may end in a number."""
    return code.rstrip("0123456789")


def furnished(building: Building, rng: np.random.Generator) -> tuple[Placed, ...]:
    """Return the furniture of a building that has none yet; the twins get the same."""
    first, second = (building.room(code) for code in building.twins)
    pieces: list[Placed] = []
    for room in building.rooms:
        if room is not second:
            pieces += _furnish(room, building.openings, rng)
    shift_x, shift_y = second.x0 - first.x0, second.y0 - first.y0
    for piece in [p for p in pieces if p.room == first.code]:
        along = piece.along + (shift_x if piece.wall in "NS" else shift_y)
        pieces.append(replace(piece, room=second.code, along=along))
    return tuple(pieces)


def _furnish(room: Room, openings: Iterable[Opening], rng: np.random.Generator) -> list[Placed]:
    """Put what belongs in a room at its walls, as long as there is room."""
    holes = {wall: _holes(room, wall, openings) for wall in WALLS}
    doors = [wall for wall, found in holes.items() if any(o.kind in ("door", "passage") for o in found)]
    across = _OPPOSITE[doors[0]] if len(doors) == 1 else None
    taken: dict[Wall, list[tuple[float, float, float]]] = {wall: [] for wall in WALLS}
    pieces: list[Placed] = []
    contents = _CONTENTS[kind_of(room.code)]
    if room.corridor:
        contents = tuple(contents[int(i)] for i in rng.permutation(len(contents)))
    for kind in contents:
        size = size_of(kind)
        deep = size.depth > _DEEPEST_BESIDE
        walls: list[Wall] = [across] if deep and across else [w for w in WALLS if not deep]
        places = [(w, p) for w in walls for p in _places(room, w, kind, holes[w], taken)]
        if not places:
            continue
        wall, along = places[int(rng.integers(len(places)))]
        taken[wall].append((along - size.left - _APART, along + size.right + _APART, size.depth))
        pieces.append(Placed(room.code, kind, wall, round(along, 3)))
    return pieces


def _holes(room: Room, wall: Wall, openings: Iterable[Opening]) -> list[Opening]:
    """Return the openings in a wall of a room."""
    axis = "x" if wall in "NS" else "y"
    at = {"N": room.y1, "S": room.y0, "E": room.x1, "W": room.x0}[wall]
    low, high = (room.x0, room.x1) if axis == "x" else (room.y0, room.y1)
    return [o for o in openings if o.axis == axis and abs(o.at - at) < 0.1 and low <= o.start < high]


def _places(
    room: Room, wall: Wall, kind: str, holes: list[Opening], taken: dict[Wall, list[tuple[float, float, float]]]
) -> list[float]:
    """Return where along a wall a piece may stand, every 0.1 m."""
    size = size_of(kind)
    low, high = (room.x0, room.x1) if wall in "NS" else (room.y0, room.y1)
    # Local x runs to the building's +x or +y on the S and E walls, the other way on N and W.
    before, behind = (size.left, size.right) if wall in "SE" else (size.right, size.left)
    lowest: Wall = "W" if wall in "NS" else "S"
    highest: Wall = "E" if wall in "NS" else "N"
    first = low + before + max([0.05, *(d + 0.05 for _, _, d in taken[lowest] if d > _FLAT and size.depth > _FLAT)])
    last = high - behind - max([0.05, *(d + 0.05 for _, _, d in taken[highest] if d > _FLAT and size.depth > _FLAT)])
    blocked = [(start, end) for start, end, _ in taken[wall]]
    for hole in holes:
        if hole.kind in ("door", "passage"):
            blocked.append((hole.start - _DOOR_CLEAR, hole.end + _DOOR_CLEAR))
        elif hole.kind == "glass" or size.height > _LOW or size.height > hole.z0 + 0.1:
            blocked.append((hole.start - 0.05, hole.end + 0.05))
    return [
        float(along)
        for along in np.arange(first, last + 1e-9, 0.1)
        if all(along + behind < start or along - before > end for start, end in blocked)
    ]


def depth_at(room: Room, wall: str, pieces: Iterable[Placed]) -> float:
    """Return how far the deepest piece at a wall reaches into the room, metres."""
    return max((size_of(p.kind).depth + p.gap for p in pieces if p.room == room.code and p.wall == wall), default=0.0)
