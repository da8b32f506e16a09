"""The floor plan of the synthetic building: its rooms, and the openings in their walls.

Metres; x runs along the corridor, y to its left, z up from the floor::

      y
     5.45  +-----+-------+-------+---------+
           | 1PO | 2PO1  | 2PO2  |   CNR   +----+
     1.25  +--d--+---d---+---d---+glass--d-+-ST-+--------+
           |  CR                                d   TR   |
    -1.25  +--d----+arch+---d--------+-d--+--d--+        |
           |  KT   | PA |     LO     | TL |  RL |--------+
    -6.05  +-------+----+------------+----+-----+

2PO1 and 2PO2 are alike on purpose.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

CEILING = 2.7
"""Height of every room, metres."""

Side = Literal["north", "south", "east", "west"]
OPPOSITE: dict[Side, Side] = {"north": "south", "south": "north", "east": "west", "west": "east"}


@dataclass(frozen=True, slots=True)
class Room:
    """A rectangular room: its code, inner extent, and the finishes of its surfaces."""

    code: str
    name: str
    x0: float
    y0: float
    x1: float
    y1: float
    wall: str
    floor: str
    lamps: tuple[int, int]
    """Ceiling lamps along x and along y."""
    accent: str | None = None
    """Finish of the wall at the side `accent_side`, where it differs."""
    accent_side: Side | None = None

    @property
    def width(self) -> float:
        """Extent along x, metres."""
        return self.x1 - self.x0

    @property
    def depth(self) -> float:
        """Extent along y, metres."""
        return self.y1 - self.y0

    def contains(self, x: float, y: float) -> bool:
        """Tell whether the point lies between the room's walls."""
        return self.x0 <= x <= self.x1 and self.y0 <= y <= self.y1

    def wall_coordinate(self, side: Side) -> float:
        """Return the y of a north or south wall, the x of an east or west one."""
        return {"north": self.y1, "south": self.y0, "east": self.x1, "west": self.x0}[side]


@dataclass(frozen=True, slots=True)
class Opening:
    """A hole in the wall at `side` of `room`, to another room or to the outside (`other` None).

    `centre` is the world coordinate along the wall; `sill` and `head` are heights.
    """

    kind: Literal["door", "arch", "window", "glass"]
    room: str
    side: Side
    other: str | None
    centre: float
    width: float
    sill: float = 0.0
    head: float = 2.1

    @property
    def start(self) -> float:
        """Lower end along the wall."""
        return self.centre - self.width / 2

    @property
    def end(self) -> float:
        """Upper end along the wall."""
        return self.centre + self.width / 2

    @property
    def panes(self) -> int:
        """Number of panes side by side in a window or glass wall."""
        return max(1, round(self.width / 1.1))


ROOMS: tuple[Room, ...] = (
    Room("CR", "corridor", 0.0, -1.1, 19.0, 1.1, "corridor", "linoleum", (6, 1)),
    Room("1PO", "one-person office", 0.0, 1.25, 3.0, 5.45, "cream", "oak", (1, 2)),
    Room("2PO1", "two-persons office", 3.15, 1.25, 7.15, 5.45, "white", "grey carpet", (2, 2)),
    Room("2PO2", "two-persons office", 7.3, 1.25, 11.3, 5.45, "white", "grey carpet", (2, 2)),
    Room("CNR", "conference room", 11.45, 1.25, 16.45, 5.45, "white", "blue carpet", (2, 2), "bricks", "east"),
    Room("ST", "stairs area", 16.6, 1.25, 19.0, 4.4, "concrete", "slate", (1, 1)),
    Room("KT", "kitchen", 0.0, -6.05, 4.0, -1.25, "yellow", "checker", (2, 2), "kitchen tiles", "west"),
    Room("PA", "printer area", 4.15, -3.75, 6.65, -1.25, "stripes", "linoleum", (1, 1)),
    Room("LO", "large office", 6.8, -6.05, 12.6, -1.25, "pale green", "parquet", (3, 2), "green", "west"),
    Room("TL", "toilet", 12.75, -4.6, 14.95, -1.25, "wall tiles", "mosaic", (1, 1)),
    Room("RL", "robotics lab", 15.1, -6.05, 19.0, -1.25, "blue", "epoxy", (2, 2), "lab panels", "east"),
    Room("TR", "terminal room", 19.15, -2.4, 23.35, 2.4, "wallpaper", "red carpet", (2, 2)),
)

OPENINGS: tuple[Opening, ...] = (
    Opening("door", "CR", "north", "1PO", 1.5, 1.0),
    Opening("door", "CR", "north", "2PO1", 5.15, 1.0),
    Opening("door", "CR", "north", "2PO2", 9.3, 1.0),
    Opening("glass", "CR", "north", "CNR", 13.1, 2.9, 0.08, 2.4),
    Opening("door", "CR", "north", "CNR", 15.6, 1.1),
    Opening("arch", "CR", "north", "ST", 17.8, 1.6, 0.0, 2.4),
    Opening("door", "CR", "south", "KT", 2.1, 1.1),
    Opening("arch", "CR", "south", "PA", 5.4, 2.0, 0.0, 2.4),
    Opening("door", "CR", "south", "LO", 9.5, 1.1),
    Opening("door", "CR", "south", "TL", 13.7, 1.0),
    Opening("door", "CR", "south", "RL", 16.9, 1.1),
    Opening("door", "CR", "east", "TR", 0.0, 1.1),
    Opening("window", "CR", "west", None, 0.0, 1.5, 0.4, 2.3),
    Opening("window", "1PO", "north", None, 1.5, 1.8, 0.9, 2.2),
    Opening("window", "2PO1", "north", None, 5.15, 2.8, 0.9, 2.2),
    Opening("window", "2PO2", "north", None, 9.3, 2.8, 0.9, 2.2),
    Opening("window", "CNR", "north", None, 13.95, 4.0, 0.6, 2.4),
    Opening("window", "KT", "south", None, 2.2, 2.2, 1.0, 2.2),
    Opening("window", "LO", "south", None, 8.3, 2.2, 0.9, 2.3),
    Opening("window", "LO", "south", None, 11.1, 2.2, 0.9, 2.3),
    Opening("window", "RL", "south", None, 17.0, 2.6, 0.9, 2.3),
    Opening("window", "TR", "east", None, 0.3, 3.0, 0.9, 2.2),
)


def room_at(x: float, y: float) -> str | None:
    """Return the code of the room that contains the point, a doorway counting to its nearer room; else None."""
    margin = 0.08
    for room in ROOMS:
        if room.x0 - margin <= x < room.x1 + margin and room.y0 - margin <= y < room.y1 + margin:
            return room.code
    return None


ROOM: dict[str, Room] = {room.code: room for room in ROOMS}
