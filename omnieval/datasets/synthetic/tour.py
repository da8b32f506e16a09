"""The tour the robot drives: every room entered, the corridor both ways, several rooms twice."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from omnieval.seeding import named_generator

SPACING = 0.115
"""Metres between captures."""
_LOOK = 0.34
"""The heading is the chord from so far behind to so far ahead on the way, metres: wheels do not jerk."""
PERIOD = 0.204
"""Seconds between captures, on average."""
START = 1_152_904_768.0
"""Time of the first capture, seconds since the epoch, a day of COLD's summer."""

_VISITS: dict[str, tuple[float, float, float, float]] = {
    "1PO": (2.6, 1.0, 1.4, -0.7),
    "2PO1": (4.5, 1.0, 1.6, 0.9),
    "2PO2": (8.3, 1.0, 1.6, 0.9),
    "CNR": (12.0, 1.0, 2.2, 0.0),
    "KT": (17.3, 1.0, 1.8, 0.4),
    "PA": (2.0, -1.0, 1.3, 0.0),
    "TL": (5.3, -1.0, 1.4, -0.1),
    "ST": (7.9, -1.0, 1.3, 0.0),
    "LO": (10.5, -1.0, 1.2, 0.7),
    "LAB": (16.0, -1.0, 1.5, 0.1),
}
"""Where each room is entered (x), on which side of the corridor, how deep, and how far the turn leans to +x, metres."""

_ROUTE: tuple[str, ...] = (
    "1PO",
    "2PO1",
    "ST",
    "2PO2",
    "CNR",
    "KT",
    "east",
    "LAB",
    "CNR",
    "LO",
    "TL",
    "2PO1",
    "PA",
    "west",
)
"""Rooms in the order of the tour; `east` and `west` are the ends of the corridor, where the robot turns."""
_ENDS: dict[str, tuple[tuple[float, float], ...]] = {
    "east": ((18.3, -0.2), (18.9, -0.35), (19.3, 0.0), (18.9, 0.35), (18.3, 0.2)),
    "west": ((1.6, 0.2), (0.95, 0.35), (0.55, 0.0), (0.95, -0.35), (1.6, -0.2)),
}
_TURN = 0.45
"""Radius of the turn inside a room, metres."""


@dataclass(frozen=True)
class Tour:
    """The captures of a drive: times in seconds, shape (n,), and poses (x, y, yaw), shape (n, 3)."""

    times: NDArray[np.float64]
    poses: NDArray[np.float64]


def drive(light: str, seed: int, frames: int | None = None) -> Tour:
    """Return the drive of a day: the first `frames` captures, or one whole tour.

    The loop is closed, so that a longer drive goes round again. The robot sways a little about the planned way, in
    a manner that `light` and `seed` decide; a shorter drive is a prefix of a longer one.
    """
    loop = _loop()
    steps = np.hypot(*np.diff(loop, axis=0, append=loop[:1]).T)
    length = float(steps.sum())
    count = round(length / SPACING) if frames is None else frames
    travelled = np.asarray(SPACING * np.arange(count), np.float64)
    sway = _sway(light, seed)
    way = _positions(loop, steps, travelled, sway)
    ahead = _positions(loop, steps, travelled + _LOOK, sway) - _positions(loop, steps, travelled - _LOOK, sway)
    yaw = np.arctan2(ahead[:, 1], ahead[:, 0])
    jitter = named_generator(seed, f"clock-{light}").uniform(-0.01, 0.01, count)
    times = START + PERIOD * np.arange(count) + jitter
    poses = np.round(np.column_stack([way, yaw]), 6)
    return Tour(np.round(times, 6), poses)


def _loop() -> NDArray[np.float64]:
    """Return the planned way as a closed polyline of about 2 cm steps, shape (m, 2), corners rounded."""
    corners: list[tuple[float, float]] = []
    for stop in _ROUTE:
        corners += _ENDS[stop] if stop in _ENDS else _through(stop)
    points = _resampled(np.array(corners))
    # A moving average of 0.5 m, twice, rounds corners into curves that a robot can drive.
    for _ in range(2):
        kernel = np.ones(25) / 25
        padded = np.concatenate([points[-12:], points, points[:12]])
        points = np.column_stack([np.convolve(padded[:, i], kernel, mode="valid") for i in range(2)])
    return points


def _through(room: str) -> list[tuple[float, float]]:
    """Return the way from the corridor through a room and back to the corridor."""
    x, side, reach, lean = _VISITS[room]
    cx, cy = x + lean, 1.2 + reach - _TURN
    way = [
        (x, 0.1),
        (x, 1.3),
        (cx - _TURN * side, cy),
        (cx - 0.7 * _TURN * side, cy + 0.8 * _TURN),
        (cx, cy + 1.2 * _TURN),
        (cx + 0.7 * _TURN * side, cy + 0.8 * _TURN),
        (cx + _TURN * side, cy),
        (x, 1.3),
        (x, 0.1),
    ]
    return [(px, side * py) for px, py in way]


def _resampled(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a closed polyline resampled at 2 cm."""
    closed = np.vstack([corners, corners[:1]])
    at = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(closed, axis=0).T))])
    grid = np.arange(0.0, at[-1], 0.02)
    return np.column_stack([np.interp(grid, at, closed[:, i]) for i in range(2)])


def _sway(light: str, seed: int) -> NDArray[np.float64]:
    """Return three waves of lateral sway: amplitude (m), wave number (rad/m) and phase (rad), shape (3, 3)."""
    rng = named_generator(seed, f"sway-{light}")
    return np.column_stack(
        [rng.uniform(0.01, 0.02, 3), 2 * math.pi / rng.uniform(2.5, 9.0, 3), rng.uniform(0, 6.28, 3)]
    )


def _positions(
    loop: NDArray[np.float64], steps: NDArray[np.float64], travelled: NDArray[np.float64], sway: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the positions after `travelled` metres of the closed loop, swaying, shape (n, 2)."""
    at = np.concatenate([[0.0], np.cumsum(steps)])
    closed = np.vstack([loop, loop[:1]])
    where = np.mod(travelled, at[-1])
    point = np.column_stack([np.interp(where, at, closed[:, i]) for i in range(2)])
    tangent = np.column_stack([np.interp(where, at, np.gradient(closed[:, i])) for i in range(2)])
    tangent /= np.maximum(np.hypot(*tangent.T), 1e-9)[:, None]
    lateral = np.sum(sway[:, 0] * np.sin(np.outer(travelled, sway[:, 1]) + sway[:, 2]), axis=1)
    return np.asarray(point + lateral[:, None] * np.column_stack([-tangent[:, 1], tangent[:, 0]]))
