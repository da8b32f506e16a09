"""What stands in which room, and what the other lights' days have moved."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal

from omnieval.datasets.synthetic.building import ROOMS, TWIN_SHIFT, TWINS, Room
from omnieval.datasets.synthetic.pieces import PIECES
from omnieval.datasets.synthetic.solids import Solid

_TURN = {"S": 0.0, "W": -math.pi / 2, "N": math.pi, "E": math.pi / 2}
"""How a piece is turned so that its back is against that wall."""


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


_TWIN: tuple[Placed, ...] = (
    Placed(TWINS[0], "desk", "N", 4.55),
    Placed(TWINS[0], "desk", "N", 6.3),
    Placed(TWINS[0], "cupboard", "W", 3.9),
    Placed(TWINS[0], "books", "E", 3.7),
    Placed(TWINS[0], "whiteboard", "E", 2.0),
    Placed(TWINS[0], "plant-low", "S", 6.85),
    Placed(TWINS[0], "poster-2", "W", 2.8),
    Placed(TWINS[0], "leaf", "S", 4.0, turn=0.08),
)

FURNITURE: tuple[Placed, ...] = (
    *_TWIN,
    *(replace(p, room=TWINS[1], along=p.along + (TWIN_SHIFT if p.wall in "NS" else 0.0)) for p in _TWIN),
    Placed("CR", "plant", "N", 1.2),
    Placed("CR", "noticeboard", "S", 6.6),
    Placed("CR", "locker", "N", 6.3),
    Placed("CR", "extinguisher", "S", 9.1),
    Placed("CR", "poster-3", "N", 10.2),
    Placed("CR", "poster-1", "S", 12.4),
    Placed("CR", "sideboard", "S", 13.6),
    Placed("CR", "poster-4", "S", 18.2),
    Placed("CR", "plant-low", "S", 19.5),
    Placed("CR", "cooler", "N", 18.9),
    Placed("CR", "coats", "S", 3.9),
    Placed("1PO", "desk", "N", 1.5),
    Placed("1PO", "books", "W", 2.4),
    Placed("1PO", "books", "W", 3.4),
    Placed("1PO", "sofa-red", "E", 4.3, 0.0),
    Placed("1PO", "poster-1", "E", 2.6),
    Placed("1PO", "plant", "S", 0.4),
    Placed("1PO", "leaf", "S", 3.1, turn=-0.1),
    Placed("CNR", "meeting", "S", 13.95, 1.35),
    Placed("CNR", "whiteboard", "W", 3.4),
    Placed("CNR", "television", "E", 3.6),
    Placed("CNR", "plant", "N", 15.75),
    Placed("CNR", "poster-4", "W", 5.2),
    Placed("CNR", "leaf", "S", 11.5, turn=0.05),
    Placed("KT", "kitchen", "N", 17.6),
    Placed("KT", "fridge", "N", 19.6),
    Placed("KT", "table", "E", 2.9),
    Placed("KT", "stool", "E", 2.6, 0.7),
    Placed("KT", "stool", "E", 3.2, 0.7),
    Placed("KT", "noticeboard", "W", 3.4),
    Placed("KT", "cooler", "S", 18.6),
    Placed("KT", "bin", "W", 4.9),
    Placed("KT", "leaf", "S", 16.8, turn=0.1),
    Placed("PA", "printer", "W", -2.2),
    Placed("PA", "printer", "W", -3.7),
    Placed("PA", "sideboard", "S", 1.9),
    Placed("PA", "pigeonholes", "E", -2.5),
    Placed("PA", "boxes", "E", -4.3),
    Placed("PA", "bin", "N", 3.6),
    Placed("TL", "cabins", "S", 5.3),
    Placed("TL", "basins", "E", -2.5),
    Placed("TL", "bin", "W", -3.4),
    Placed("TL", "leaf", "N", 4.8, turn=-0.55),
    Placed("ST", "rack", "W", -2.4),
    Placed("ST", "rack", "W", -3.7),
    Placed("ST", "rack", "E", -3.2),
    Placed("ST", "cupboard-grey", "E", -4.5),
    Placed("ST", "boxes", "S", 7.6),
    Placed("ST", "leaf", "N", 8.4, turn=0.45),
    Placed("LO", "sofa-green", "S", 12.6),
    Placed("LO", "sofa-red", "E", -3.4),
    Placed("LO", "coffee-table", "S", 12.6, 1.15),
    Placed("LO", "books-wide", "N", 12.9),
    Placed("LO", "plant", "S", 10.9),
    Placed("LO", "plant-low", "E", -5.1),
    Placed("LO", "table", "W", -4.6),
    Placed("LO", "poster-3", "W", -2.9),
    Placed("LO", "poster-4", "E", -1.9),
    Placed("LAB", "desk", "S", 15.9),
    Placed("LAB", "desk", "S", 17.6),
    Placed("LAB", "cupboard-grey", "S", 19.3),
    Placed("LAB", "bench", "N", 17.95, 1.45),
    Placed("LAB", "rack", "W", -3.6),
    Placed("LAB", "books", "E", -3.7),
    Placed("LAB", "whiteboard", "N", 18.2),
    Placed("LAB", "poster-2", "E", -2.2),
    Placed("LAB", "leaf", "N", 15.5, turn=-0.1),
    Placed("1PO", "radiator", "N", 2.85),
    Placed("CNR", "radiator", "N", 13.0),
    Placed("CNR", "radiator", "N", 14.4),
    Placed("LO", "radiator", "S", 11.2),
    Placed("LAB", "radiator", "S", 18.6),
)

_MOVED: dict[str, dict[tuple[str, str], tuple[float, float]]] = {
    "cloudy": {},
    "night": {
        ("CR", "plant"): (-0.5, 0.0),
        ("LO", "sofa-red"): (0.4, 0.0),
        ("KT", "stool"): (-0.35, 0.0),
        ("PA", "boxes"): (-0.5, 0.0),
        ("CR", "cooler"): (0.6, 0.0),
    },
    "sunny": {
        ("CR", "sideboard"): (0.8, 0.0),
        ("LO", "coffee-table"): (0.25, 0.1),
        ("ST", "boxes"): (0.5, 0.0),
        ("1PO", "plant"): (0.3, 0.0),
        ("CR", "plant-low"): (-0.6, 0.0),
    },
}
"""Pieces that stand elsewhere in a light: (room, kind) -> shift of (along, gap), metres."""


def furniture(light: str) -> list[Solid]:
    """Return everything that stands in the building on the day of `light`."""
    moved = _MOVED[light]
    solids: list[Solid] = []
    for piece in FURNITURE:
        along, gap = moved.get((piece.room, piece.kind), (0.0, 0.0))
        solids += _solids(replace(piece, along=piece.along + along, gap=piece.gap + gap))
    return solids


def _solids(piece: Placed) -> list[Solid]:
    """Return the solids of one piece, where it stands."""
    room = next(r for r in ROOMS if r.code == piece.room)
    x, y = _back(room, piece)
    turn = _TURN[piece.wall] + piece.turn
    return [solid.moved(x, y, turn) for solid in PIECES[piece.kind]()]


def _back(room: Room, piece: Placed) -> tuple[float, float]:
    """Return where the middle of a piece's back is."""
    return {
        "S": (piece.along, room.y0 + piece.gap),
        "N": (piece.along, room.y1 - piece.gap),
        "W": (room.x0 + piece.gap, piece.along),
        "E": (room.x1 - piece.gap, piece.along),
    }[piece.wall]
