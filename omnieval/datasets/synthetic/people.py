"""Passers-by: who walks or stands where when a capture is taken."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from omnieval.datasets.synthetic.solids import Solid, pillar
from omnieval.datasets.synthetic.tour import PERIOD, Tour
from omnieval.seeding import named_generator

_WALKERS = 6
_WALK_FRAMES = 60
_STEP = 1.1 * PERIOD
"""Metres a walker makes from one capture to the next."""
_KEPT_CLEAR = 0.6
"""How far people stay away from the robot's centre, metres."""
_SPOTS = ((15.4, 4.9), (13.3, -1.9), (18.5, 5.0), (16.9, -4.1), (1.0, -3.0), (6.0, 4.6), (19.3, -0.4))
"""Where people stand, each for a while."""
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

    `step` is what they walk from one capture to the next, metres, 0 for those
    who stand.
    """

    start: int
    end: int
    x: float
    y: float
    step: float
    clothes: tuple[str, str]


def passers_by(light: str, seed: int, tour: Tour) -> tuple[Person, ...]:
    """Return who is about during a whole tour: some stand in rooms, some walk along the corridor past the robot."""
    rng = named_generator(seed, f"people-{light}")
    count = len(tour.times)
    people = []
    for spot in rng.permutation(len(_SPOTS))[:4]:
        start = int(rng.integers(0, max(1, count - _STAND_FRAMES)))
        clothes = _CLOTHES[int(rng.integers(len(_CLOTHES)))]
        people.append(Person(start, start + _STAND_FRAMES, *_SPOTS[spot], 0.0, clothes))
    in_corridor = np.flatnonzero(np.abs(tour.poses[:, 1]) < 0.5)
    for start in np.sort(rng.choice(in_corridor, _WALKERS, replace=False)):
        way = 1.0 if rng.random() < 0.5 else -1.0
        x = float(tour.poses[start, 0]) + way * rng.uniform(4.0, 7.0)
        y = float(rng.choice([-0.62, 0.62]))
        clothes = _CLOTHES[int(rng.integers(len(_CLOTHES)))]
        people.append(Person(int(start), int(start) + _WALK_FRAMES, x, y, -way * _STEP, clothes))
    return tuple(people)


def bodies(people: tuple[Person, ...], capture: int, robot: tuple[float, float]) -> tuple[Solid, ...]:
    """Return the solids of everybody who is about at a capture of the tour and not outside the corridor's ends."""
    solids: list[Solid] = []
    for person in people:
        if not person.start <= capture < person.end:
            continue
        since = capture - person.start
        x, y = person.x + person.step * since, person.y
        if person.step and not 0.4 < x < 19.6:
            continue
        x, y = _kept_clear(x, y + 0.03 * math.sin(0.3 * since), robot)
        stride = 0.22 * math.sin(1.9 * since) if person.step else 0.03
        solids += _body(x, y, stride, person.clothes)
    return tuple(solids)


def _kept_clear(x: float, y: float, robot: tuple[float, float]) -> tuple[float, float]:
    """Return the place moved away from the robot, if it is too close."""
    dx, dy = x - robot[0], y - robot[1]
    distance = math.hypot(dx, dy)
    if distance >= _KEPT_CLEAR or distance == 0.0:
        return x, y
    return robot[0] + dx * _KEPT_CLEAR / distance, robot[1] + dy * _KEPT_CLEAR / distance


def _body(x: float, y: float, stride: float, clothes: tuple[str, str]) -> list[Solid]:
    """Return a walking figure."""
    legs, torso = clothes
    return [
        pillar(x + stride / 2, y + 0.09, 0.15, 0.0, 0.84, legs),
        pillar(x - stride / 2, y - 0.09, 0.15, 0.0, 0.84, legs),
        pillar(x, y, 0.38, 0.84, 1.32, torso),
        pillar(x, y, 0.44, 1.32, 1.45, torso),
        pillar(x - stride / 2, y + 0.23, 0.1, 0.8, 1.4, torso),
        pillar(x + stride / 2, y - 0.23, 0.1, 0.8, 1.4, torso),
        pillar(x, y, 0.11, 1.45, 1.52, "skin"),
        pillar(x, y, 0.2, 1.52, 1.68, "skin"),
        pillar(x, y, 0.21, 1.68, 1.76, "hair"),
    ]
