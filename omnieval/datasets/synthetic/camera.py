"""The catadioptric camera: a hyperbolic mirror above a camera that looks up, in image and polar coordinates."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from omnieval.datasets.synthetic.facts import MIRROR

WIDTH, HEIGHT = 640, 480
"""Size of the images, pixels."""
FOCAL = 400.0
"""Focal length of the camera below the mirror, pixels."""
HORIZON = 150.0
"""Radius at which the horizon appears, pixels."""
EYE = 1.0
"""Height of the mirror above the floor, metres."""
AZIMUTHS = 768
"""Columns of a polar image; column j looks 2 pi j / AZIMUTHS to the robot's left of straight ahead."""
DISC = (
    slice(int(MIRROR.cy - MIRROR.r_out) - 1, int(MIRROR.cy + MIRROR.r_out) + 3),
    slice(int(MIRROR.cx - MIRROR.r_out) - 1, int(MIRROR.cx + MIRROR.r_out) + 3),
)
"""The rows and columns of the image that hold the mirror."""
MARGIN = 2
"""Polar rows beyond either edge of the mirror, so that interpolation at the edges has neighbours."""


def elevation_slope(radius: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return tan(elevation) of what appears at `radius` pixels from the mirror's centre, any shape.

    tan e = (sin g0 - sin g) / (cos g0 cos g) with g = atan2(FOCAL, r), g0 = atan2(FOCAL, HORIZON): the centre looks
    down, the rim above the horizon.
    """
    g, g0 = np.arctan2(FOCAL, radius), np.arctan2(FOCAL, HORIZON)
    return np.asarray((np.sin(g0) - np.sin(g)) / (np.cos(g0) * np.cos(g)))


@cache
def radii() -> NDArray[np.float64]:
    """Return the radii of the polar rows, one pixel apart, ascending, pixels."""
    return np.arange(MIRROR.r_in - MARGIN, MIRROR.r_out + MARGIN + 1.0)


@cache
def slopes() -> NDArray[np.float32]:
    """Return tan(elevation) of the polar rows, ascending."""
    slope = elevation_slope(radii()).astype(np.float32)
    slope[slope == 0.0] = 1e-6  # the horizon itself: floor and ceiling are far away, not infinitely far
    return slope


@cache
def below_horizon() -> int:
    """Return how many of the polar rows look downwards; they are the first."""
    return int(np.searchsorted(slopes(), 0.0))


@cache
def polar_map() -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return where the pixels of `DISC` lie in a polar image padded by one wrapped azimuth: row, column.

    Straight ahead is up in the image; phi to the robot's left is at u = cx - r sin phi, v = cy - r cos phi.
    """
    dx, dy = _from_centre()
    azimuth = np.mod(np.arctan2(-dx, -dy) / (2.0 * np.pi) * AZIMUTHS, AZIMUTHS)
    row = np.hypot(dx, dy) - radii()[0]
    return np.asarray(row[DISC], np.float32), np.asarray(azimuth[DISC], np.float32)


@cache
def rim() -> NDArray[np.float32]:
    """Return the share of the mirror's picture in the pixels of `DISC`, vignetted; shape (rows, columns, 3)."""
    r = np.hypot(*_from_centre())
    vignette = 1.0 - 0.06 * (r / MIRROR.r_out) ** 3
    return np.repeat((_annulus(r) * vignette)[DISC][..., None], 3, axis=2).astype(np.float32)


@cache
def surroundings() -> NDArray[np.float32]:
    """Return what is not the mirror's picture, shape (HEIGHT, WIDTH, 3).

    Black outside, the camera's own dark reflection inside.
    """
    dx, dy = _from_centre()
    r = np.hypot(dx, dy)
    grey = np.full(r.shape, 3.0)
    for radius, level in ((MIRROR.r_in + 0.5, 34.0), (36.0, 22.0), (24.0, 40.0), (19.0, 12.0), (9.0, 55.0), (6.0, 6.0)):
        grey = grey + (level - grey) * np.clip(radius - r + 0.5, 0.0, 1.0)
    grey += np.where(r < MIRROR.r_in, 5.0 * np.sin(3.0 * np.arctan2(dy, dx)), 0.0) * (r > 20.0)
    grey = np.maximum(grey, 0.0) * (1.0 - _annulus(r))
    return np.repeat(grey[..., None], 3, axis=2).astype(np.float32)


@dataclass(frozen=True)
class Mount:
    """What the mirror shows of the robot and the camera's post.

    Attributes
    ----------
    where
        The rows and columns of `DISC` around it.
    uncovered
        The share of each pixel there that it leaves free, shape (rows, columns, 3).
    colour
        Its reflectance times the share that it covers: blue, green, red; shape (3, rows, columns).
    """

    where: tuple[slice, slice]
    uncovered: NDArray[np.float32]
    colour: NDArray[np.float32]


@cache
def mount() -> Mount:
    """Return the camera's post and the robot's body as the mirror shows them: they stay put whatever the robot does.

    Measured on panoramas of COLD, 512 columns wide and 128 rows high: the post stands
    to the robot's right, a clamp with two knobs at its foot on a white plate, the red chassis behind.
    """
    dx, dy = _from_centre()
    column = (0.5 - np.arctan2(-dx, -dy) / (2.0 * np.pi)) % 1.0 * 512.0
    row = (MIRROR.r_out - np.hypot(dx, dy)) / (MIRROR.r_out - MIRROR.r_in) * 128.0
    cover = np.zeros((HEIGHT, WIDTH, 1))
    colour = np.zeros((HEIGHT, WIDTH, 3))
    from_post = column - 384.5

    def put(where: NDArray[np.float64], bgr: tuple[float, float, float]) -> None:
        share = np.clip(where, 0.0, 1.0)[..., None]
        colour[:] = colour * (1.0 - share) + share * np.array(bgr)
        cover[:] = np.maximum(cover, share)

    chassis = np.minimum(np.abs((column + 256.0) % 512.0 - 256.0), np.abs(from_post))
    put(np.minimum(row - 125.0 + 0.03 * np.abs(from_post + 90.0), 60.0 - np.abs(from_post + 70.0)), (0.10, 0.12, 0.13))
    put(np.minimum(row - 122.0, 60.0 - np.abs(from_post - 120.0)), (0.12, 0.16, 0.55))
    put(np.minimum(row - 124.0, 40.0 - chassis), (0.12, 0.16, 0.50))
    put(np.minimum(row - 113.5 - 0.0011 * (from_post - 25.0) ** 2, 65.0 - np.abs(from_post - 12.0)), (0.72, 0.90, 0.88))
    put(6.0 * (1.0 - np.hypot((from_post - 2.0) / 37.0, (row - 103.0) / 8.0)), (0.06, 0.07, 0.08))
    put(5.0 * (1.0 - np.hypot((from_post - 31.0) / 10.0, (row - 99.0) / 8.0)), (0.09, 0.10, 0.10))
    put(5.0 * (1.0 - np.hypot((from_post + 22.0) / 11.0, (row - 100.0) / 6.0)), (0.07, 0.08, 0.09))
    put(np.minimum(9.0 - np.abs(from_post - 0.5), 4.5 - np.abs(row - 112.5)), (0.45, 0.58, 0.55))
    put(np.minimum(0.6 * (10.0 - np.abs(from_post)), 0.5 * (109.0 - row)), (0.045, 0.055, 0.055))
    shares, reflectances = cover[DISC].astype(np.float32), (colour * cover)[DISC].astype(np.float32)
    rows, columns = (np.flatnonzero(shares[..., 0].any(axis=axis)) for axis in (1, 0))
    where = slice(int(rows[0]), int(rows[-1]) + 1), slice(int(columns[0]), int(columns[-1]) + 1)
    uncovered = np.repeat(np.float32(1.0) - shares[where], 3, axis=2)
    return Mount(where, uncovered, np.moveaxis(reflectances[where], 2, 0).copy())


def _from_centre() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return how far each pixel lies to the right of and below the mirror's centre, (HEIGHT, WIDTH) each."""
    v, u = np.mgrid[0:HEIGHT, 0:WIDTH].astype(np.float64)
    return u - MIRROR.cx, v - MIRROR.cy


def _annulus(r: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return 1 where the mirror shows the scene, 0 elsewhere, softened over a pixel at both edges."""
    return np.asarray(np.clip(MIRROR.r_out - r + 0.5, 0.0, 1.0) * np.clip(r - MIRROR.r_in + 0.5, 0.0, 1.0))
