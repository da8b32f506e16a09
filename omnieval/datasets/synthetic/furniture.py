"""What stands in a building on a day, as solids."""

from __future__ import annotations

import math

from omnieval.datasets.synthetic.building import Building, Placed, Room
from omnieval.datasets.synthetic.pieces import PIECES
from omnieval.datasets.synthetic.solids import Solid

_TURN = {"S": 0.0, "W": -math.pi / 2, "N": math.pi, "E": math.pi / 2}
"""How a piece is turned so that its back is against that wall."""


def standing(building: Building, pieces: tuple[Placed, ...]) -> list[Solid]:
    """Return the solids of pieces of furniture, where they stand."""
    return [solid for piece in pieces for solid in solids_of(building.room(piece.room), piece)]


def solids_of(room: Room, piece: Placed) -> list[Solid]:
    """Return the solids of one piece in its room."""
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
