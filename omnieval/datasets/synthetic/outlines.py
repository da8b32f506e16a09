"""The ground truth of a building as a file: outlines of the rooms and where one opens to another."""

from __future__ import annotations

import json
from typing import Any

from omnieval.datasets.synthetic.building import Building, Opening

_REACH = 0.2
"""How far beyond the middle of a wall the rooms on either side are looked for, metres."""


def outlines(building: Building) -> str:
    """Return the contents of ``building.json``.

    ``rooms`` has every room with its outline, counter-clockwise, as [x, y] in metres in the frame of the poses; it
    ends at the inside of its walls. ``doors`` has every door and passage between two rooms, as the two ends of a line
    in the middle of the wall. ``twins`` are two rooms alike on purpose.
    """
    rooms = [
        {
            "room": room.code,
            "corridor": room.corridor,
            "outline": [
                [_metres(x), _metres(y)]
                for x, y in ((room.x0, room.y0), (room.x1, room.y0), (room.x1, room.y1), (room.x0, room.y1))
            ],
        }
        for room in building.rooms
    ]
    doors = [_door(building, opening) for opening in building.openings if opening.kind in ("door", "passage")]
    return json.dumps({"building": building.number, "twins": building.twins, "rooms": rooms, "doors": doors}, indent=1)


def _door(building: Building, opening: Opening) -> dict[str, Any]:
    middle = (opening.start + opening.end) / 2
    sides = [
        building.room_at(*((middle, opening.at + step) if opening.axis == "x" else (opening.at + step, middle))).code
        for step in (-_REACH, _REACH)
    ]
    ends = [
        [_metres(v) for v in ((along, opening.at) if opening.axis == "x" else (opening.at, along))]
        for along in (opening.start, opening.end)
    ]
    return {"rooms": sides, "kind": opening.kind, "ends": ends}


def _metres(value: float) -> float:
    return round(value, 3)
