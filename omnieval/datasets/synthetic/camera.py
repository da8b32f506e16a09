"""The catadioptric camera of the synthetic building: where an elevation falls in the image, and back.

A ray that meets the image at radius r comes from elevation e, with the focal length F and the horizon's radius
R_h in pixels, g = atan2(F, r), g0 = atan2(F, R_h) and tan e = (sin g0 - sin g) / (cos g0 cos g): a hyperbolic
mirror, its outer part looking up, its inner part down. Straight ahead is up in the image; a direction phi to the
robot's left lies at u = cx - r sin phi, v = cy - r cos phi.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from omnieval.datasets.sequence import Mirror

MIRROR = Mirror(cx=322.0, cy=239.0, r_in=46.0, r_out=228.0)
"""Where the mirror lies in every synthetic image."""

IMAGE_WIDTH, IMAGE_HEIGHT = 640, 480
FOCAL = 400.0
HORIZON_RADIUS = 150.0
HEIGHT = 1.0
"""Height of the mirror above the floor, metres."""

COLUMNS = 1440
"""Azimuths of the polar image; about one a pixel at the rim."""
ROWS = 224
_MARGIN = 2.0
_STEP = (MIRROR.r_out - MIRROR.r_in + 2 * _MARGIN) / (ROWS - 1)

COLUMN_ANGLE = 2 * np.pi / COLUMNS


def tan_elevation(radius: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the tangent of the elevation seen at `radius` pixels from the centre; it grows with the radius."""
    g, g0 = np.arctan2(FOCAL, radius), np.arctan2(FOCAL, HORIZON_RADIUS)
    result: NDArray[np.float64] = (np.sin(g0) - np.sin(g)) / (np.cos(g0) * np.cos(g))
    return result


def row_radii() -> NDArray[np.float64]:
    """Return the image radius of every row of the polar image, shape (ROWS,), pixels, ascending."""
    result: NDArray[np.float64] = MIRROR.r_in - _MARGIN + _STEP * np.arange(ROWS)
    return result


def polar_coordinates() -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return (row, column) of the polar image for every pixel of the camera's image.

    Both have shape (IMAGE_HEIGHT, IMAGE_WIDTH) and are fractional. Columns lie in [0, COLUMNS]: a polar image
    that is sampled with them repeats its first column at its end.
    """
    v, u = np.mgrid[:IMAGE_HEIGHT, :IMAGE_WIDTH].astype(np.float64)
    left, ahead = MIRROR.cx - u, MIRROR.cy - v
    row = (np.hypot(left, ahead) - (MIRROR.r_in - _MARGIN)) / _STEP
    column = np.mod(np.arctan2(left, ahead), 2 * np.pi) / COLUMN_ANGLE
    return row.astype(np.float32), column.astype(np.float32)
