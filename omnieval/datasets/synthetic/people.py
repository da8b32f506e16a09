"""Passers-by: who walks or stands where when a capture is taken."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from omnieval.datasets.synthetic.building import Room
from omnieval.datasets.synthetic.day import Day, clearances
from omnieval.datasets.synthetic.drives import PERIOD, Tour
from omnieval.datasets.synthetic.solids import Solid, pillar
from omnieval.seeding import named_generator

_WALKERS = {"cloudy": 8, "night": 3, "sunny": 8}
"""How many walk past in each light."""
_EVERYWHERE = (-math.inf, math.inf, -math.inf, math.inf)
_WALK_FRAMES = 60
_STEP = 1.1 * PERIOD
"""Metres a walker makes from one capture to the next."""
_KEPT_CLEAR = 0.6
"""How far people stay away from the robot's centre, metres."""
_STAND_FRAMES = 260
_CLOTHES = (
    ("jeans", "shirt-white"),
    ("coat-dark", "shirt-red"),
    ("jeans", "fabric-green"),
    ("coat-dark", "fabric-blue"),
)


@dataclass(frozen=True, slots=True)
class Person:
    """Somebody who is about from capture `start` to `end` (exclusive) of a tour.

    `step_x` and `step_y` are what they walk from one capture to the next, metres, 0 for those who stand; `within` is
    where walkers are seen, x0, x1, y0, y1.
    """

    start: int
    end: int
    x: float
    y: float
    step_x: float
    step_y: float
    clothes: tuple[str, str]
    within: tuple[float, float, float, float]


def passers_by(day: Day, seed: int, tour: Tour) -> tuple[Person, ...]:
    """Return who is about during a whole tour: some stand in rooms, some walk along a corridor past the robot."""
    rng = named_generator(seed, f"people-{day.name}")
    count = len(tour.times)
    people = []
    spots = _spots(day, rng)
    for spot in rng.permutation(len(spots))[:4]:
        x, y = spots[spot]
        start = int(rng.integers(0, max(1, count - _STAND_FRAMES)))
        clothes = _CLOTHES[int(rng.integers(len(_CLOTHES)))]
        people.append(Person(start, start + _STAND_FRAMES, x, y, 0.0, 0.0, clothes, _EVERYWHERE))
    corridors = [room for room in day.building.rooms if room.corridor]
    along = {room.code: room.x1 - room.x0 >= room.y1 - room.y0 for room in corridors}
    inside = np.array([[_amidst(room, along[room.code], x, y) for room in corridors] for x, y, _ in tour.poses])
    in_corridor = np.flatnonzero(inside.any(axis=1))
    walkers = _WALKERS[day.name]
    for start in np.sort(rng.choice(in_corridor, min(walkers, len(in_corridor)), replace=False)):
        room = corridors[int(np.argmax(inside[start]))]
        way = 1.0 if rng.random() < 0.5 else -1.0
        ahead = way * rng.uniform(4.0, 7.0)
        side = float(rng.choice([-0.62, 0.62]))
        clothes = _CLOTHES[int(rng.integers(len(_CLOTHES)))]
        if along[room.code]:
            x, y = float(tour.poses[start, 0]) + ahead, (room.y0 + room.y1) / 2 + side
            step = (-way * _STEP, 0.0)
            within = (room.x0 + 0.4, room.x1 - 0.4, -math.inf, math.inf)
        else:
            x, y = (room.x0 + room.x1) / 2 + side, float(tour.poses[start, 1]) + ahead
            step = (0.0, -way * _STEP)
            within = (-math.inf, math.inf, room.y0 + 0.4, room.y1 - 0.4)
        people.append(Person(int(start), int(start) + _WALK_FRAMES, x, y, *step, clothes, within))
    return tuple(people)


def _amidst(room: Room, along: bool, x: float, y: float) -> bool:
    """Tell whether a place is on the middle of a corridor, 1 m wide."""
    return (
        room.distance(x, y) == 0.0
        and abs((y - (room.y0 + room.y1) / 2) if along else (x - (room.x0 + room.x1) / 2)) < 0.5
    )


def _spots(day: Day, rng: np.random.Generator) -> list[tuple[float, float]]:
    """Return places in rooms where somebody can stand without being in the way."""
    rooms = [room for room in day.building.rooms if not room.corridor]
    tried = [
        (float(rng.uniform(room.x0 + 0.4, room.x1 - 0.4)), float(rng.uniform(room.y0 + 0.4, room.y1 - 0.4)))
        for room in rooms
        for _ in range(4)
    ]
    places = np.array(tried)
    solids = [solid for solid in day.solids() if solid.z0 < 1.5]
    from_way = np.min(np.hypot(*(places[:, None] - day.way[None, ::10]).transpose(2, 0, 1)), axis=1)
    free = (clearances(places, solids) > 0.3) & (from_way > 0.8)
    return [place for place, is_free in zip(tried, free.tolist(), strict=True) if is_free]


def bodies(people: tuple[Person, ...], capture: int, robot: tuple[float, float]) -> tuple[Solid, ...]:
    """Return the solids of everybody who is about at a capture of the tour and not outside their corridor's ends."""
    solids: list[Solid] = []
    for person in people:
        if not person.start <= capture < person.end:
            continue
        since = capture - person.start
        x, y = person.x + person.step_x * since, person.y + person.step_y * since
        x0, x1, y0, y1 = person.within
        if not (x0 < x < x1 and y0 < y < y1):
            continue
        swing, walks = 0.03 * math.sin(0.3 * since), bool(person.step_x or person.step_y)
        upright = person.step_y != 0.0
        x, y = _kept_clear(*((x + swing, y) if upright else (x, y + swing)), robot)
        stride = 0.22 * math.sin(1.9 * since) if walks else 0.03
        solids += _body(x, y, stride, upright, person.clothes)
    return tuple(solids)


def _kept_clear(x: float, y: float, robot: tuple[float, float]) -> tuple[float, float]:
    """Return the place moved away from the robot, if it is too close."""
    dx, dy = x - robot[0], y - robot[1]
    distance = math.hypot(dx, dy)
    if distance >= _KEPT_CLEAR or distance == 0.0:
        return x, y
    return robot[0] + dx * _KEPT_CLEAR / distance, robot[1] + dy * _KEPT_CLEAR / distance


def _body(x: float, y: float, stride: float, upright: bool, clothes: tuple[str, str]) -> list[Solid]:
    """Return a walking figure that strides along x, or along y if `upright`."""
    legs, torso = clothes

    def limb(ahead: float, aside: float, thick: float, z0: float, z1: float, dressed: str) -> Solid:
        px, py = (x + aside, y + ahead) if upright else (x + ahead, y + aside)
        return pillar(px, py, thick, z0, z1, dressed)

    return [
        limb(stride / 2, 0.09, 0.15, 0.0, 0.84, legs),
        limb(-stride / 2, -0.09, 0.15, 0.0, 0.84, legs),
        pillar(x, y, 0.38, 0.84, 1.32, torso),
        pillar(x, y, 0.44, 1.32, 1.45, torso),
        limb(-stride / 2, 0.23, 0.1, 0.8, 1.4, torso),
        limb(stride / 2, -0.23, 0.1, 0.8, 1.4, torso),
        pillar(x, y, 0.11, 1.45, 1.52, "skin"),
        pillar(x, y, 0.2, 1.52, 1.68, "skin"),
        pillar(x, y, 0.21, 1.68, 1.76, "hair"),
    ]
