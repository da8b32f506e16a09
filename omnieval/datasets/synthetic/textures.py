"""Procedural surfaces: walls, floors, fronts and fabrics, drawn once, deterministic in the seed.

Every texture is a uint8 BGR image that tiles; row 0 is its upper edge. `SIZES` says how many metres a repeating one
covers; walls cover a whole storey, so that skirting boards and dado rails come out at their height.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy import fft

from omnieval.seeding import named_generator

Texture = NDArray[np.uint8]
Colour = tuple[float, float, float]

PIXELS = 256
"""Width and height of every texture."""

_WALL_SIZE = 2.6


def draw(name: str, seed: int) -> Texture:
    """Return the texture of that name, shape (PIXELS, PIXELS, 3), uint8 BGR."""
    rng = named_generator(seed, f"texture-{name}")
    image = _DRAWN[name](rng) if name in _DRAWN else _plain(_COLOURS[name], rng)
    np.rint(image, out=image)
    return np.clip(image, 0, 255, out=image).astype(np.uint8)


def names() -> tuple[str, ...]:
    """Return the names of all textures."""
    return (*_DRAWN, *_COLOURS)


def size_of(name: str) -> float:
    """Return how many metres one repetition of a texture covers."""
    return _WALL_SIZE if name in _WALLS else _SIZES.get(name, 1.0)


def smooth_noise(
    rng: np.random.Generator, scale: float, shape: tuple[int, int] = (PIXELS, PIXELS)
) -> NDArray[np.float64]:
    """Return band-limited noise that tiles: zero mean, unit variance, features of about `scale` pixels."""
    spectrum = fft.rfft2(rng.standard_normal(shape)) * _band(scale, shape)
    noise = fft.irfft2(spectrum, shape)
    return np.asarray((noise - noise.mean()) / noise.std())


@cache
def _band(scale: float, shape: tuple[int, int]) -> NDArray[np.float64]:
    """Return how much of each frequency `smooth_noise` keeps, shape (rows, columns // 2 + 1)."""
    fy, fx = np.fft.fftfreq(shape[0])[:, None], np.fft.rfftfreq(shape[1])[None, :]
    return np.asarray(np.exp(-((fx**2 + fy**2) * scale**2) * 2.0))


def _plain(colour: Colour, rng: np.random.Generator, grain: float = 5.0) -> NDArray[np.float64]:
    """Return a colour with blotches and fine grain."""
    base = np.full((PIXELS, PIXELS, 3), colour, np.float64)
    return base + (grain * smooth_noise(rng, 40) + 0.5 * grain * smooth_noise(rng, 3))[..., None]


def _wood(colour: Colour, rng: np.random.Generator, boards: int = 1) -> NDArray[np.float64]:
    """Return wood grain along the columns, in boards with joints between."""
    image = _plain(colour, rng, 4.0)
    grain = np.repeat(smooth_noise(rng, 3, (PIXELS, 8)), PIXELS // 8, axis=1)
    image += 9.0 * cv2.GaussianBlur(grain, (31, 1), 8)[..., None]
    height = PIXELS // boards
    for i in range(boards) if boards > 1 else ():
        image[i * height : (i + 1) * height] *= rng.uniform(0.82, 1.1)
        image[i * height : i * height + 2] *= 0.6
        joint = int(rng.integers(0, PIXELS - 2))
        image[i * height : (i + 1) * height, joint : joint + 2] *= 0.65
    return image


def _tiles(colours: tuple[Colour, Colour], joint: Colour, count: int, rng: np.random.Generator) -> NDArray[np.float64]:
    """Return square tiles in a chequerboard of two colours, with joints."""
    index = np.arange(PIXELS) * count // PIXELS
    parity = (index[:, None] + index[None, :]) % 2
    shade = rng.normal(0.0, 5.0, (count, count))[index[:, None], index[None, :]]
    image = np.where(parity[..., None] == 0, np.array(colours[0]), np.array(colours[1])) + shade[..., None]
    edge = (np.arange(PIXELS) * count % PIXELS) < 3 * count
    image[edge[:, None] | edge[None, :]] = joint
    return image + 3.0 * smooth_noise(rng, 4)[..., None]


def _bricks(rng: np.random.Generator) -> NDArray[np.float64]:
    """Return brickwork in running bond."""
    rows, columns = 24, 8
    image = np.full((PIXELS, PIXELS, 3), (150.0, 160.0, 165.0))
    for i in range(rows):
        top, bottom = i * PIXELS // rows, (i + 1) * PIXELS // rows - 2
        for j in range(columns):
            left = j * PIXELS // columns + (i % 2) * PIXELS // (2 * columns)
            across = np.arange(left, left + PIXELS // columns - 2) % PIXELS
            image[top:bottom, across] = np.array((62.0, 80.0, 150.0)) * rng.uniform(0.75, 1.2)
    return image + 5.0 * smooth_noise(rng, 3)[..., None]


def _with_skirting(image: NDArray[np.float64], colour: Colour, height: float = 0.1) -> NDArray[np.float64]:
    """Put a skirting board, `height` metres high, at the foot of a wall."""
    rows = round(height / _WALL_SIZE * PIXELS)
    image[-rows:] = colour
    image[-rows - 1] *= 0.55
    return image


def _dado(upper: Colour, lower: Colour, rng: np.random.Generator) -> NDArray[np.float64]:
    """Return a wall painted in two colours with a rail between, 0.95 m high."""
    image = _plain(upper, rng)
    rail = PIXELS - round(0.95 / _WALL_SIZE * PIXELS)
    image[rail:] = _plain(lower, rng)[rail:]
    image[rail - 6 : rail] = np.array(lower) * 0.6
    return _with_skirting(image, (70, 80, 90))


def _stripes(rng: np.random.Generator) -> NDArray[np.float64]:
    """Return a striped wallpaper with a border."""
    image = _plain((165, 200, 215), rng, 3.0)
    stripe = (np.arange(PIXELS) // 16) % 2 == 0
    image[:, stripe] *= np.array((0.72, 0.8, 0.92))
    image[20:34] = (60, 90, 140)
    return _with_skirting(image, (60, 75, 110))


def _flowers(rng: np.random.Generator) -> NDArray[np.float64]:
    """Return a wallpaper with a lattice of flowers."""
    image = _plain((190, 215, 205), rng, 3.0)
    for i in range(6):
        for j in range(6):
            x, y = int((j + 0.5 * (i % 2) + 0.25) * PIXELS / 6), int((i + 0.5) * PIXELS / 6)
            for k in range(5):
                petal = (x + round(8 * np.cos(k * 1.257)), y + round(8 * np.sin(k * 1.257)))
                cv2.circle(image, petal, 6, (105, 110, 185), -1)
            cv2.circle(image, (x, y), 4, (70, 180, 210), -1)
    return _with_skirting(image, (225, 230, 232))


def _panelling(rng: np.random.Generator) -> NDArray[np.float64]:
    """Return a wall with wooden panels below and paint above."""
    image = _plain((205, 200, 190), rng)
    rail = PIXELS - round(1.15 / _WALL_SIZE * PIXELS)
    image[rail:] = _wood((55, 95, 150), rng)[rail:]
    image[rail : rail + 5] *= 0.5
    for left in range(0, PIXELS, PIXELS // 4):
        cv2.rectangle(image, (left + 8, rail + 14), (left + PIXELS // 4 - 8, PIXELS - 18), (30, 55, 95), 2)
    return _with_skirting(image, (35, 60, 95))


def _concrete_wall(rng: np.random.Generator) -> NDArray[np.float64]:
    """Return cast concrete with panel joints and anchor holes."""
    image = _plain((160, 165, 165), rng, 8.0)
    image[:, :: PIXELS // 2] *= 0.6
    image[PIXELS // 2] *= 0.6
    for y in (40, 100, 160, 220):
        for x in (30, 98, 158, 226):
            cv2.circle(image, (x, y), 3, (90, 92, 92), -1)
    return _with_skirting(image, (90, 90, 90), 0.06)


def _wall_tiles(upper: Colour, lower: Colour, rng: np.random.Generator) -> NDArray[np.float64]:
    """Return paint above a wall tiled up to 1.7 m with a dark border."""
    image = _plain((225, 228, 228), rng, 3.0)
    rail = PIXELS - round(1.7 / _WALL_SIZE * PIXELS)
    image[rail:] = _tiles((upper, lower), (150, 155, 155), 16, rng)[rail:]
    image[rail : rail + 8] = np.array(lower) * 0.45
    return image


def _front(colour: Colour, rng: np.random.Generator, columns: int, rows: int, handle: Colour) -> NDArray[np.float64]:
    """Return a furniture front of doors or drawers with handles."""
    image = _wood(colour, rng)
    w, h = PIXELS // columns, PIXELS // rows
    for i in range(rows):
        for j in range(columns):
            left, top = j * w, i * h
            shade = tuple(0.5 * c for c in colour)
            cv2.rectangle(image, (left + 3, top + 3), (left + w - 4, top + h - 4), shade, 3)
            x = left + (w - 24 if j % 2 == 0 else 14) if rows == 1 else left + w // 2 - 20
            y = top + h // 2
            size = (8, 40) if rows == 1 else (40, 8)
            cv2.rectangle(image, (x, y), (x + size[0], y + size[1]), handle, -1)
    return image


def _books(rng: np.random.Generator) -> NDArray[np.float64]:
    """Return five shelves of books."""
    image = np.full((PIXELS, PIXELS, 3), (45.0, 75.0, 110.0))
    shelf = PIXELS // 5
    for i in range(5):
        x, floor = 6, (i + 1) * shelf - 6
        image[floor - shelf + 10 : floor] = (28, 40, 55)
        while x < PIXELS - 16:
            width, height = int(rng.integers(7, 18)), int(rng.integers(shelf // 2, shelf - 14))
            colour = rng.uniform(30, 215, 3)
            image[floor - height : floor, x : x + width - 1] = colour
            image[floor - height + 6 : floor - height + 10, x : x + width - 1] = colour * 0.5
            x += width + (int(rng.integers(8, 22)) if rng.random() < 0.12 else 0)
    return image


def _pigeonholes(rng: np.random.Generator) -> NDArray[np.float64]:
    """Return a grid of pigeonholes, some with papers."""
    image = np.full((PIXELS, PIXELS, 3), (140.0, 175.0, 195.0))
    for i in range(6):
        for j in range(5):
            x, y = 8 + j * 49, 8 + i * 41
            image[y : y + 34, x : x + 42] = (35, 45, 50)
            if rng.random() < 0.6:
                image[y + int(rng.integers(10, 24)) : y + 34, x + 4 : x + 38] = rng.uniform(150, 240, 3)
    return image


def _art(style: int, rng: np.random.Generator) -> NDArray[np.float64]:
    """Return a poster: bands, discs and lines of text in strong colours."""
    image = np.full((PIXELS, PIXELS, 3), rng.uniform(150, 245, 3))
    for _ in range(4 + style):
        colour = tuple(float(c) for c in rng.uniform(10, 240, 3))
        x, y, r = (int(v) for v in rng.integers(30, 226, 3))
        if (style + r) % 2:
            cv2.circle(image, (x, y), 15 + r // 4, colour, -1)
        else:
            cv2.rectangle(image, (x - r // 3, y - 18), (x + r // 3, y + 18), colour, -1)
    for row in range(190, 240, 12):
        cv2.line(image, (24, row), (int(rng.integers(120, 235)), row), (40, 40, 40), 3)
    return image


def _noticeboard(rng: np.random.Generator) -> NDArray[np.float64]:
    """Return cork with pinned papers."""
    image = _plain((75, 125, 175), rng, 10.0)
    for _ in range(11):
        x, y = (int(v) for v in rng.integers(8, 200, 2))
        w, h = (int(v) for v in rng.integers(24, 50, 2))
        cv2.rectangle(image, (x, y), (x + w, y + h), tuple(float(c) for c in rng.uniform(150, 250, 3)), -1)
        cv2.line(image, (x + 5, y + 10), (x + w - 6, y + 10), (60, 60, 60), 2)
        cv2.circle(image, (x + w // 2, y + 3), 3, (30, 30, 200), -1)
    return image


def _whiteboard(rng: np.random.Generator) -> NDArray[np.float64]:
    """Return a whiteboard with a diagram."""
    image = _plain((238, 240, 240), rng, 1.5)
    cv2.rectangle(image, (0, 0), (PIXELS - 1, PIXELS - 1), (130, 130, 130), 6)
    for colour in ((160, 60, 20), (30, 30, 170), (40, 120, 40), (50, 50, 50)):
        points = rng.integers(25, 230, (6, 2)).astype(np.int32)
        cv2.polylines(image, [points.reshape(-1, 1, 2)], isClosed=False, color=colour, thickness=3)
    return image


def _screen(rng: np.random.Generator) -> NDArray[np.float64]:
    """Return a monitor with windows on it."""
    image = np.full((PIXELS, PIXELS, 3), (120.0, 80.0, 40.0))
    cv2.rectangle(image, (30, 30), (150, 190), (235, 235, 235), -1)
    cv2.rectangle(image, (110, 70), (235, 225), (215, 205, 190), -1)
    for row in range(84, 215, 14):
        cv2.line(image, (120, row), (int(rng.integers(160, 228)), row), (70, 60, 60), 4)
    cv2.rectangle(image, (0, 0), (PIXELS - 1, PIXELS - 1), (20, 20, 20), 16)
    return image


def _leaves(rng: np.random.Generator) -> NDArray[np.float64]:
    """Return foliage."""
    image = np.full((PIXELS, PIXELS, 3), (25.0, 50.0, 25.0))
    for _ in range(160):
        x, y = (int(v) for v in rng.integers(0, PIXELS, 2))
        green = rng.uniform(70, 170)
        axes = (int(rng.integers(8, 22)), int(rng.integers(4, 9)))
        cv2.ellipse(image, (x, y), axes, float(rng.uniform(0, 180)), 0, 360, (green * 0.4, green, green * 0.55), -1)
    return image


def _lines(colour: Colour, step: int, depth: float, rng: np.random.Generator, axis: int = 1) -> NDArray[np.float64]:
    """Return a surface with dark lines every `step` pixels: ribs, slats, corrugation."""
    image = _plain(colour, rng, 3.0)
    wave = 1.0 - depth * (np.arange(PIXELS) % step < step // 3)
    return np.asarray(image * (wave[None, :, None] if axis == 1 else wave[:, None, None]))


def _coats(rng: np.random.Generator) -> NDArray[np.float64]:
    """Return a rail of coats."""
    image = np.full((PIXELS, PIXELS, 3), (180.0, 190.0, 195.0))
    cv2.rectangle(image, (0, 10), (PIXELS, 22), (40, 60, 90), -1)
    for left in (8, 66, 128, 190):
        colour = tuple(float(c) for c in rng.uniform(25, 150, 3))
        cv2.fillPoly(
            image, [np.array([(left + 25, 22), (left + 55, 70), (left + 58, 250), (left - 4, 250), (left, 70)])], colour
        )
    return image


Painter = Callable[[np.random.Generator], NDArray[np.float64]]

_WALLS: dict[str, Painter] = {
    "plaster-dado": lambda r: _dado((215, 225, 228), (150, 175, 165), r),
    "paper-stripes": _stripes,
    "plaster-cream": lambda r: _with_skirting(_plain((195, 222, 232), r), (120, 100, 80)),
    "panelling": _panelling,
    "tiles-green": lambda r: _wall_tiles((180, 205, 180), (150, 190, 150), r),
    "tiles-white": lambda r: _wall_tiles((228, 226, 222), (216, 208, 190), r),
    "bricks": _bricks,
    "paper-flowers": _flowers,
    "concrete-wall": _concrete_wall,
}
_SURFACES: dict[str, Painter] = {
    "ceiling": lambda r: _tiles(((225, 228, 228), (219, 223, 223)), (165, 168, 168), 4, r),
    "linoleum": lambda r: _plain((118, 140, 138), r, 9.0),
    "parquet": lambda r: _wood((70, 120, 175), r, 16),
    "carpet-blue": lambda r: _plain((120, 85, 62), r, 10.0),
    "carpet-grey": lambda r: _lines((105, 100, 100), 64, 0.18, r),
    "checker": lambda r: _tiles(((205, 215, 215), (70, 65, 85)), (120, 120, 120), 4, r),
    "tiles-small": lambda r: _tiles(((190, 180, 160), (165, 150, 130)), (225, 225, 225), 8, r),
    "concrete": lambda r: _plain((125, 128, 128), r, 14.0),
    "planks": lambda r: _wood((60, 95, 135), r, 10),
    "tiles-large": lambda r: _tiles(((170, 178, 180), (160, 168, 170)), (95, 95, 95), 3, r),
    "books": _books,
    "doors-wood": lambda r: _front((70, 120, 170), r, 2, 1, (60, 60, 60)),
    "doors-grey": lambda r: _front((150, 148, 145), r, 2, 1, (40, 40, 40)),
    "doors-white": lambda r: _front((220, 224, 225), r, 2, 1, (90, 90, 90)),
    "drawers": lambda r: _front((150, 160, 165), r, 1, 3, (50, 50, 50)),
    "cabinet-row": lambda r: _front((165, 185, 190), r, 4, 1, (60, 60, 60)),
    "cabin-doors": lambda r: _front((185, 150, 110), r, 2, 1, (60, 60, 60)),
    "lockers": lambda r: _front((150, 120, 75), r, 4, 1, (30, 30, 30)),
    "door-leaf": lambda r: _front((85, 130, 175), r, 1, 1, (90, 90, 90)),
    "fridge": lambda r: _front((205, 205, 200), r, 1, 2, (80, 80, 80)),
    "pigeonholes": _pigeonholes,
    "poster-1": lambda r: _art(1, r),
    "poster-2": lambda r: _art(2, r),
    "poster-3": lambda r: _art(4, r),
    "poster-4": lambda r: _art(7, r),
    "noticeboard": _noticeboard,
    "whiteboard": _whiteboard,
    "screen": _screen,
    "leaves": _leaves,
    "coats": _coats,
    "radiator": lambda r: _lines((225, 228, 230), 24, 0.45, r),
    "cardboard": lambda r: _lines((95, 145, 185), 128, 0.25, r, axis=0),
    "wood-light": lambda r: _wood((125, 170, 205), r),
    "wood-dark": lambda r: _wood((40, 60, 90), r),
    "wood-red": lambda r: _wood((55, 75, 140), r),
    "mirror": lambda r: _plain((190, 185, 175), r, 14.0),
}
_COLOURS: dict[str, Colour] = {
    "lamp": (250, 252, 254),
    "sill": (222, 225, 225),
    "frame-dark": (58, 62, 70),
    "frame-white": (228, 230, 230),
    "pane": (200, 195, 180),
    "metal": (135, 135, 135),
    "steel": (185, 185, 180),
    "stone": (105, 110, 115),
    "ceramic": (240, 240, 238),
    "paper": (240, 242, 242),
    "soil": (35, 45, 60),
    "terracotta": (70, 100, 175),
    "glass-table": (120, 135, 130),
    "plastic-black": (38, 36, 36),
    "plastic-grey": (195, 198, 198),
    "plastic-red": (45, 45, 175),
    "plastic-blue": (170, 110, 50),
    "fabric-blue": (125, 65, 40),
    "fabric-red": (50, 45, 135),
    "fabric-green": (75, 115, 70),
    "skin": (140, 170, 215),
    "hair": (30, 40, 55),
    "jeans": (105, 70, 50),
    "shirt-white": (225, 225, 225),
    "shirt-red": (50, 50, 190),
    "coat-dark": (50, 45, 45),
}
_DRAWN: dict[str, Painter] = _WALLS | _SURFACES
_SIZES: dict[str, float] = {
    "ceiling": 2.4,
    "linoleum": 3.0,
    "parquet": 1.6,
    "carpet-blue": 2.0,
    "carpet-grey": 2.0,
    "checker": 1.6,
    "tiles-small": 0.9,
    "concrete": 4.0,
    "planks": 1.7,
    "tiles-large": 1.8,
    "leaves": 0.8,
    "cardboard": 0.6,
}
