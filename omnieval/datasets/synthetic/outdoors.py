"""What is seen through the windows: sky, a line of trees and houses, and the ground."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from omnieval.datasets.synthetic import camera
from omnieval.datasets.synthetic.lighting import Light
from omnieval.seeding import named_generator

_COLUMNS = 2880


def skyline(light: Light, seed: int) -> NDArray[np.float32]:
    """Return the outdoors by world azimuth and polar row, shape (_COLUMNS, rows, 3), float32 BGR, 255 saturates."""
    slope = camera.slopes()
    by_night = light.outdoors < 0.2
    azimuth = 2.0 * np.pi * np.arange(_COLUMNS) / _COLUMNS
    rng = named_generator(seed, "skyline")
    trees = sum(
        rng.uniform(0.3, 1.0) / k * np.sin(int(k) * azimuth + rng.uniform(0, 6.28)) for k in (3, 5, 9, 17, 31, 53)
    )
    tree_line = 0.07 + 0.04 * np.asarray(trees)
    houses = np.repeat(rng.uniform(-0.1, 0.22, 48), _COLUMNS // 48)
    windows = (np.sin(azimuth * 400) > 0.2)[:, None] & (np.sin(slope * 90) > 0.1)[None, :]
    scene = np.empty((_COLUMNS, slope.size, 3))
    scene[:] = np.array((205, 200, 190)) - np.array((60, 120, 170)) * np.clip(slope, 0, 0.5)[:, None]
    house = slope[None, :] < houses[:, None]
    scene[house] = (120, 140, 165)
    scene[house & windows] = (150, 220, 245) if by_night else (90, 80, 70)
    scene[slope[None, :] < tree_line[:, None]] = (60, 105, 80)
    scene[:, slope < -0.06] = (95, 130, 115)
    picture = scene * light.outdoors
    if by_night:
        picture[house & windows] *= 6.0
    return picture.astype(np.float32)
