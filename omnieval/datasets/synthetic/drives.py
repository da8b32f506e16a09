"""The drive of a day through a building: lateral offsets, speed, pauses, clock."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import minimum_filter1d, uniform_filter1d

from omnieval.datasets.synthetic.day import Day, clearances
from omnieval.datasets.synthetic.way import STEP, Floats
from omnieval.seeding import named_generator

PERIOD = 0.204
"""Seconds between captures, on average."""
START = 1_152_904_768.0
"""Time of the first capture, seconds since the epoch, a day of COLD's summer."""
SPACING = 0.185
"""Metres between captures on a straight way; a published map of COLD has its images 0.17 m apart."""
_SPEED = {"cloudy": 1.0, "night": 0.86, "sunny": 1.18}
"""How fast each light is driven, relative to `SPACING` in a `PERIOD`."""
_OFFSET = 0.4
"""How far to the side of the way's middle a drive may be, metres."""
_SWAY = 0.06
"""How far apart two drives of one light are at most, metres."""
_KEPT = 0.28
"""How near the robot's centre comes to anything, metres."""
_LOOK = 0.34
"""The heading is the chord from so far behind to so far ahead on the way, metres."""
_WIDE, _SLOWEST = 0.8, 0.45
"""In bends narrower than this radius, metres, the robot is slower, at most by this factor."""
_PAUSES = 3
_HOURS = {"cloudy": 0.0, "night": 10.5 * 3600.0, "sunny": 86400.0}
"""When each light is driven, seconds after `START`."""


@dataclass(frozen=True)
class Tour:
    """The captures of a drive: times in seconds, shape (n,), and poses (x, y, yaw), shape (n, 3)."""

    times: NDArray[np.float64]
    poses: NDArray[np.float64]


def drive(day: Day, seed: int, frames: int | None = None) -> Tour:
    """Return the drive of a day: the first `frames` captures, or one whole tour.

    The day decides order, offsets and speed, `seed` how two drives of that day differ: a little. The loop is closed,
    so that a longer drive goes round again; a shorter one is a prefix of it.
    """
    loop = _beside(day, seed)
    at = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(loop, axis=0, append=loop[:1]).T))])
    lap = _lap(day, seed, loop, at)
    count = len(lap) if frames is None else frames
    index = np.arange(count)
    travelled = lap[index % len(lap)] + at[-1] * (index // len(lap))
    ahead = _places(loop, at, travelled + _LOOK) - _places(loop, at, travelled - _LOOK)
    yaw = np.arctan2(ahead[:, 1], ahead[:, 0])
    jitter = named_generator(seed, f"clock-{day.name}").uniform(-0.01, 0.01, count)
    times = START + _HOURS[day.name] + PERIOD * np.arange(count) + jitter
    return Tour(np.round(times, 6), np.round(np.column_stack([_places(loop, at, travelled), yaw]), 6))


def _beside(day: Day, seed: int) -> Floats:
    """Return the way with its offsets: wide where there is room, none in doorways."""
    way = day.way
    length = len(way) * STEP
    tangent, radius = _bends(way)
    solids = [solid for solid in day.solids() if solid.z0 < 1.5 and solid.z1 > 0.05 and solid.glass == 0.0]
    free = clearances(way, solids) - _KEPT
    limit = np.clip(np.minimum(free, 0.4 * radius), 0.0, _OFFSET)
    limit = uniform_filter1d(minimum_filter1d(limit, 41, mode="wrap"), 41, mode="wrap")
    s = np.asarray(np.arange(len(way)) * STEP, np.float64)
    mean = named_generator(day.building.number, f"offset-{day.name}")
    wander = _waves(mean, s, length, (6.0, 16.0), 4) * _OFFSET
    sway = _waves(named_generator(seed, f"sway-{day.name}"), s, length, (2.5, 9.0), 3) * _SWAY
    offset = np.clip(wander + sway, -limit, limit)
    return np.asarray(way + offset[:, None] * np.column_stack([-tangent[:, 1], tangent[:, 0]]))


def _bends(way: Floats) -> tuple[Floats, Floats]:
    """Return the direction of a closed way and the radius of its bends, metres, shapes (m, 2) and (m,)."""
    tangent = np.roll(way, -5, axis=0) - np.roll(way, 5, axis=0)
    tangent /= np.maximum(np.hypot(*tangent.T), 1e-9)[:, None]
    turned = np.roll(tangent, -10, axis=0) - np.roll(tangent, 10, axis=0)
    return tangent, 20 * STEP / np.maximum(np.hypot(*turned.T), 1e-6)


def _waves(rng: np.random.Generator, s: Floats, length: float, between: tuple[float, float], count: int) -> Floats:
    """Return a sum of waves that close over the loop, about 1 at most."""
    numbers = np.maximum(1, np.rint(length / rng.uniform(*between, count)))
    phases = rng.uniform(0.0, 2.0 * math.pi, count)
    waves = np.sin(2.0 * math.pi * np.outer(s / length, numbers) + phases).sum(axis=1)
    return np.asarray(np.clip(1.6 * waves / count, -1.0, 1.0))


def _lap(day: Day, seed: int, loop: Floats, at: Floats) -> Floats:
    """Return how far the robot has come at each capture of one tour, metres; it is slow in bends and pauses."""
    length = float(at[-1])
    slow = minimum_filter1d(np.clip(_bends(loop)[1] / _WIDE, _SLOWEST, 1.0), 15, mode="wrap")
    rng = named_generator(day.building.number, f"speed-{day.name}")
    phase, wave = rng.uniform(0.0, 6.28), 2.0 * math.pi / rng.uniform(15.0, 30.0)
    halts = np.sort(rng.uniform(0.05, 0.95, _PAUSES)) * length
    stays = rng.integers(10, 26, _PAUSES) + named_generator(seed, f"pause-{day.name}").integers(0, 6, _PAUSES)
    places, s = [], 0.0
    pauses = [*zip(halts.tolist(), stays.tolist(), strict=True)]
    while s < length - 0.5 * SPACING:
        places.append(s)
        if pauses and s >= pauses[0][0]:
            places += [s] * int(pauses.pop(0)[1])
        bend = float(slow[min(int(np.searchsorted(at, s)), len(slow) - 1)])
        s += SPACING * _SPEED[day.name] * bend * (1.0 + 0.25 * math.sin(wave * s + phase))
    return np.array(places)


def _places(loop: Floats, at: Floats, travelled: Floats) -> Floats:
    """Return the places after this many metres of the closed loop, shape (n, 2)."""
    where = np.mod(travelled, at[-1])
    closed = np.vstack([loop, loop[:1]])
    return np.column_stack([np.interp(where, at, closed[:, i]) for i in range(2)])
