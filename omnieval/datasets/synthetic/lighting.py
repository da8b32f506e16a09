"""Light of a day: what lamps, windows and the sun add where, as maps of the building from above."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from omnieval.datasets.synthetic.building import Building, Opening, Room
from omnieval.datasets.synthetic.solids import Solid

CELL = 0.05
"""Side of a light map's cell, metres."""
_SPILL = 0.35
"""How far light blurs through doorways, metres."""


@dataclass(frozen=True, slots=True)
class Look:
    """What a real camera does with the light of a real building.

    Attributes
    ----------
    directed
        How much brighter a face is that looks towards the light than one that looks along it.
    gloss
        How much of the light that falls on a shiny floor at a grazing angle it mirrors.
    exposed
        Mean grey level that the camera's automatic exposure aims at.
    shutter
        Share of the time between two captures during which the shutter is open: a turn smears the image.
    curve
        Exponent of the contrast curve.
    cast
        Gain of blue, green and red.
    """

    directed: float
    gloss: float
    exposed: float
    shutter: float
    curve: float
    cast: tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Light:
    """How bright a day is, relative to a white surface that just saturates; colours are BGR.

    Attributes
    ----------
    ambient, lamp, window
        Light that is everywhere, below a lamp, and at a window.
    outdoors
        Brightness of what is seen through windows.
    sun
        Brightness of what the sun shines on, 0 without sun.
    bloom
        Share of the saturated light that spreads over its neighbourhood.
    noise
        Standard deviation of the image noise, grey levels.
    look
        How light falls and how the camera takes it in.
    """

    ambient: tuple[float, float, float]
    lamp: tuple[float, float, float]
    window: tuple[float, float, float]
    outdoors: float
    sun: float
    bloom: float
    noise: float
    look: Look


LIGHTS: dict[str, Light] = {
    "cloudy": Light(
        (0.34, 0.35, 0.35),
        (0.32, 0.38, 0.40),
        (0.40, 0.38, 0.35),
        1.8,
        0.0,
        0.35,
        0.8,
        Look(0.25, 0.8, 112.0, 0.12, 1.12, (0.66, 1.0, 1.05)),
    ),
    "night": Light(
        (0.20, 0.24, 0.24),
        (0.34, 0.42, 0.43),
        (0.0, 0.0, 0.0),
        0.03,
        0.0,
        0.35,
        0.6,
        Look(0.3, 0.8, 112.0, 0.15, 1.12, (0.64, 1.02, 1.05)),
    ),
    "sunny": Light(
        (0.22, 0.24, 0.25),
        (0.20, 0.22, 0.24),
        (0.75, 0.85, 0.90),
        4.5,
        3.0,
        0.6,
        0.8,
        Look(0.8, 0.9, 112.0, 0.1, 1.12, (0.66, 1.0, 1.06)),
    ),
}
"""The days by name, set side by side with panoramas of COLD."""
SUN = (0.45, -1.0, 0.75)
"""Towards the sun: x, y, and height over a horizontal distance of hypot(x, y)."""


def grid_shape(building: Building) -> tuple[int, int]:
    """Return rows (along y) and columns (along x) of a light map."""
    x0, x1, y0, y1 = building.footprint
    return round((y1 - y0) / CELL), round((x1 - x0) / CELL)


def light_maps(building: Building, light: Light, solids: list[Solid], dark: frozenset[str]) -> NDArray[np.float32]:
    """Return the light on upright surfaces and on the floor, shape (2, rows, columns, 3); row 0 is the smallest y.

    In the rooms called `dark` no lamp is on.
    """
    rows, columns = grid_shape(building)
    left, _, bottom, _ = building.footprint
    x = np.asarray(left + (np.arange(columns) + 0.5) * CELL, np.float64)
    y = np.asarray(bottom + (np.arange(rows) + 0.5) * CELL, np.float64)
    upright: NDArray[np.float64] = np.tile(np.array(light.ambient), (rows, columns, 1))
    for room in building.rooms:
        cells = np.ix_(_within(y, room.y0, room.y1), _within(x, room.x0, room.x1))
        upright[cells] += _room_light(
            building, light, room, x[cells[1][0]][None, :], y[cells[0][:, 0]][:, None], room.code not in dark
        )
    upright = np.asarray(cv2.GaussianBlur(upright, (0, 0), _SPILL / CELL), np.float64)
    floor: NDArray[np.float64] = upright * _contact_shadow(building, solids)[..., None]
    return np.stack([upright, floor]).astype(np.float32)


def _within(values: NDArray[np.float64], low: float, high: float) -> NDArray[np.intp]:
    """Return the indices of the cells of a room, walls' halves included."""
    return np.flatnonzero((values > low - 0.08) & (values < high + 0.08))


def _room_light(
    building: Building, light: Light, room: Room, x: NDArray[np.float64], y: NDArray[np.float64], lit: bool
) -> NDArray[np.float64]:
    """Return what the lamps and windows of a room add in it, shape (rows, columns, 3)."""
    total = np.zeros((y.size, x.size, 3))
    for lamp_x, lamp_y in room.lamps if lit else ():
        fall = 1.0 / (1.0 + ((x - lamp_x) ** 2 + (y - lamp_y) ** 2) / 1.6**2)
        total += fall[..., None] * np.array(light.lamp) * np.array(room.tint)
    for opening in building.openings:
        if opening.kind == "window" and _belongs(opening, room):
            total += _window_fall(opening, x, y)[..., None] * np.array(light.window)
    return total


def _belongs(opening: Opening, room: Room) -> bool:
    """Tell whether an opening is in one of the room's walls."""
    low, high = (room.x0, room.x1) if opening.axis == "x" else (room.y0, room.y1)
    edges = (room.y0, room.y1) if opening.axis == "x" else (room.x0, room.x1)
    return low <= opening.start < high and min(abs(opening.at - edge) for edge in edges) < 0.1


def _window_fall(opening: Opening, x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return how the light of a window falls off into the room, 1 at most."""
    along, across = (x, y - opening.at) if opening.axis == "x" else (y, x - opening.at)
    beside = along - np.clip(along, opening.start, opening.end)
    size = np.sqrt((opening.end - opening.start) * (opening.z1 - opening.z0))
    return np.asarray(1.0 / (1.0 + (across**2 + 1.5 * beside**2) / (1.1 * size) ** 2))


def _contact_shadow(building: Building, solids: list[Solid]) -> NDArray[np.float64]:
    """Return how much of the light reaches the floor around and below what stands on it, shape (rows, columns)."""
    mask = np.zeros(grid_shape(building), np.float32)
    for solid in solids:
        if solid.z0 < 0.8 and not solid.glass:
            cover = 0.35 if solid.z0 > 0.3 else 1.0
            corners = cv2.boxPoints(
                (_cell(building, solid.x, solid.y), (solid.width / CELL, solid.depth / CELL), np.degrees(solid.yaw))
            )
            layer = np.zeros_like(mask)
            cv2.fillConvexPoly(layer, np.rint(corners).astype(np.int32), cover)
            np.maximum(mask, layer, out=mask)
    return np.asarray(1.0 - 0.6 * cv2.GaussianBlur(mask, (0, 0), 0.12 / CELL))


def _cell(building: Building, x: float, y: float) -> tuple[float, float]:
    """Return the column and row, fractional, of a place in the light maps."""
    return (x - building.footprint[0]) / CELL - 0.5, (y - building.footprint[2]) / CELL - 0.5


def flow(upright: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return from where the light comes, shape (rows, columns, 2): x and y of a vector, 1 long where it is one-sided.

    It is the direction in which the light map, shape (rows, columns, 3), grows.
    """
    grey = cv2.GaussianBlur(np.log(np.maximum(upright.mean(axis=2), 1e-3)), (0, 0), 0.25 / CELL)
    dy, dx = np.gradient(grey.astype(np.float64), CELL)
    steep = np.maximum(np.hypot(dx, dy), 1e-6)
    return np.asarray(np.stack([dx, dy], axis=2) * np.minimum(3.0, 1.0 / steep)[..., None], np.float32)


@dataclass(frozen=True)
class Sunshine:
    """Through which windows the sun shines into which rooms.

    Attributes
    ----------
    facade
        Number of the windows through which the sun reaches a cell of the light maps, -1 for none, (rows, columns).
    at
        y of each facade's windows, shape (facades,).
    low, high
        Heights between which a facade lets the sun through, by column of the light maps, (facades, columns).
    """

    facade: NDArray[np.int32]
    at: NDArray[np.float32]
    low: NDArray[np.float32]
    high: NDArray[np.float32]


def sunshine(building: Building) -> Sunshine:
    """Return where the sun may shine: in rooms with windows in their southern wall."""
    rows, columns = grid_shape(building)
    left, _, bottom, _ = building.footprint
    x = np.asarray(left + (np.arange(columns) + 0.5) * CELL, np.float64)
    y = np.asarray(bottom + (np.arange(rows) + 0.5) * CELL, np.float64)
    facade = np.full((rows, columns), -1, np.int32)
    at: list[float] = []
    spans: list[tuple[NDArray[np.float64], NDArray[np.float64]]] = []
    for room in building.rooms:
        windows = [
            o
            for o in building.openings
            if o.kind == "window" and o.axis == "x" and _belongs(o, room) and o.at < room.y0
        ]
        if not windows:
            continue
        low, high = np.zeros(columns), np.zeros(columns)
        for o in windows:
            panes = max(1, round(o.end - o.start))
            along = (x - o.start) / (o.end - o.start) * panes
            glass = (along > 0.0) & (along < panes) & (np.abs(along - np.rint(along)) > 0.05)
            low[glass], high[glass] = o.z0 + 0.05, o.z1
        facade[np.ix_(_within(y, room.y0, room.y1), _within(x, room.x0, room.x1))] = len(at)
        at.append(windows[0].at)
        spans.append((low, high))
    if not at:
        spans.append((np.zeros(columns), np.zeros(columns)))
    return Sunshine(
        facade,
        np.array(at or [0.0], np.float32),
        np.array([low for low, _ in spans], np.float32),
        np.array([high for _, high in spans], np.float32),
    )
