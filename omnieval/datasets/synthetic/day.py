"""What a light's day changes in a building: doors, chairs and boxes, lamps, and which way is driven."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from omnieval.datasets.synthetic.building import Building, Placed, walls
from omnieval.datasets.synthetic.facts import LIGHTS
from omnieval.datasets.synthetic.furnish import WALLS, Wall, size_of
from omnieval.datasets.synthetic.furniture import solids_of, standing
from omnieval.datasets.synthetic.lighting import LIGHTS as LIGHT_OF
from omnieval.datasets.synthetic.lighting import Light
from omnieval.datasets.synthetic.solids import Shape, Solid
from omnieval.datasets.synthetic.way import Floats, nominal, planned
from omnieval.seeding import named_generator

_MOVABLE = frozenset({"stool", "boxes", "bin", "plant", "plant-low", "cooler", "coats"})
_CLUTTER = ("boxes", "bin", "stool", "plant-low")
_CLEAR = 0.34
"""How far from the middle of the way everything stands, metres."""
_SIDES: dict[str, tuple[tuple[Wall, float], ...]] = {
    "x": (("S", 0.1), ("N", -0.1)),
    "y": (("W", 0.1), ("E", -0.1)),
}
"""Which wall of the room on either side of a wall along an axis that wall is, and where that room lies."""
_DARK_SHARE = {"cloudy": 0.0, "night": 0.1, "sunny": 1.0}
"""How many of the rooms with windows have their lamps off."""


@dataclass(frozen=True)
class Day:
    """A building on the day of a light.

    Attributes
    ----------
    building
        The building.
    name
        The day's name.
    light
        How bright it is.
    furniture
        What stands where, door leaves included.
    dark
        Codes of the rooms whose lamps are off.
    way
        The middle of the way that is driven, closed, shape (m, 2), metres.
    """

    building: Building
    name: str
    light: Light
    furniture: tuple[Placed, ...]
    dark: frozenset[str]
    way: Floats

    def solids(self) -> list[Solid]:
        """Return walls and furniture."""
        return walls(self.building) + standing(self.building, self.furniture)


@lru_cache(maxsize=4)
def day_of(building: Building, light: str) -> Day:
    """Return the day of a light in a building."""
    rng = named_generator(building.number, f"day-{light}")
    plan = planned(building, light, LIGHTS)
    way = nominal(building, plan)
    wanted = [
        *_leaves(building, frozenset(plan.stops), rng),
        *_moved(building, rng),
        *_chairs(building, rng),
        *_clutter(building, rng),
    ]
    pieces = tuple(piece for piece in wanted if _clear_of(way, solids_of(building.room(piece.room), piece)))
    return Day(building, light, LIGHT_OF[light], pieces, _dark(building, light, rng), way)


def _leaves(building: Building, entered: frozenset[str], rng: np.random.Generator) -> list[Placed]:
    """Return the door leaves: wide open where the robot goes in, closed or ajar elsewhere."""
    leaves = []
    for opening in building.openings:
        if opening.kind != "door":
            continue
        middle = (opening.start + opening.end) / 2
        for wall, step in _SIDES[opening.axis]:
            place = (middle, opening.at + step) if opening.axis == "x" else (opening.at + step, middle)
            room = next((r for r in building.rooms if r.distance(*place) == 0.0 and not r.corridor), None)
            if room is None:
                continue
            angle = rng.uniform(90.0, 165.0) if room.code in entered else rng.choice([0.0, 0.0, 25.0])
            hinge = opening.start + 0.06 if wall in "SE" else opening.end - 0.06
            turn = float(math.radians(angle) - math.pi / 2)
            leaves.append(Placed(room.code, "leaf", wall, hinge, 0.0, turn))
    return leaves


def _moved(building: Building, rng: np.random.Generator) -> list[Placed]:
    """Return the furniture with what can be carried elsewhere, or not there at all."""
    pieces = []
    for piece in building.furniture:
        shift, gap, turn, gone = rng.uniform((-0.6, 0.0, -0.5, 0.0), (0.6, 0.4, 0.5, 1.0))
        if piece.kind not in _MOVABLE:
            pieces.append(piece)
        elif gone > 0.2:
            flat = piece.kind == "coats"
            moved = replace(piece, gap=0.0 if flat else float(gap), turn=0.0 if flat else float(turn))
            pieces.append(_within(building, moved, piece.along + float(shift)))
    return pieces


def _chairs(building: Building, rng: np.random.Generator) -> list[Placed]:
    """Return a chair for every desk, somewhere before it."""
    return [
        Placed(p.room, "chair", p.wall, p.along + float(along), float(gap), float(turn))
        for p in building.furniture
        if p.kind == "workplace"
        for along, gap, turn in [rng.uniform((-0.35, 0.5, -0.9), (0.35, 0.9, 0.9))]
    ]


def _clutter(building: Building, rng: np.random.Generator) -> list[Placed]:
    """Return things that somebody has left at the walls."""
    pieces = []
    for room in building.rooms:
        for wall in WALLS:
            kind, place = _CLUTTER[int(rng.integers(len(_CLUTTER)))], float(rng.uniform())
            low, high = (room.x0, room.x1) if wall in "NS" else (room.y0, room.y1)
            if rng.random() < 0.3:
                pieces.append(_within(building, Placed(room.code, kind, wall, 0.0), low + place * (high - low)))
    return pieces


def _within(building: Building, piece: Placed, along: float) -> Placed:
    """Return the piece at a place along its wall, pulled back into its room."""
    room, size = building.room(piece.room), size_of(piece.kind)
    low, high = (room.x0, room.x1) if piece.wall in "NS" else (room.y0, room.y1)
    reach = max(size.left, size.right)
    return replace(piece, along=float(np.clip(along, low + reach, high - reach)))


def _dark(building: Building, light: str, rng: np.random.Generator) -> frozenset[str]:
    """Return which rooms have their lamps off; those without a window have them on, and corridors at night."""
    lit_by_day = {
        room.code
        for room in building.rooms
        for o in building.openings
        if o.kind == "window"
        and room.distance(*((((o.start + o.end) / 2), o.at) if o.axis == "x" else (o.at, (o.start + o.end) / 2))) < 0.2
    }
    off = set()
    for room in building.rooms:
        draw = rng.random()
        dark = draw < _DARK_SHARE[light] and not room.corridor
        if dark and (light == "night" or room.code in lit_by_day):
            off.add(room.code)
    return frozenset(off)


def _clear_of(way: Floats, solids: Iterable[Solid]) -> bool:
    """Tell whether solids leave the way free."""
    low = [solid for solid in solids if solid.z0 < 1.5]
    return not low or float(clearances(way[::3], low).min()) >= _CLEAR


def clearances(places: NDArray[np.float64], solids: list[Solid]) -> Floats:
    """Return how far places, shape (n, 2), are from the nearest solid's plan, metres, shape (n,)."""
    nearest = np.full(len(places), np.inf)
    for solid in solids:
        dx, dy = places[:, 0] - solid.x, places[:, 1] - solid.y
        if solid.shape is Shape.CYLINDER:
            distance = np.maximum(np.hypot(dx, dy) - solid.width / 2, 0.0)
        else:
            c, s = math.cos(solid.yaw), math.sin(solid.yaw)
            beside = np.maximum(np.abs(c * dx + s * dy) - solid.width / 2, 0.0)
            before = np.maximum(np.abs(c * dy - s * dx) - solid.depth / 2, 0.0)
            distance = np.hypot(beside, before)
        np.minimum(nearest, distance, out=nearest)
    return nearest
