"""From a polar image to the camera's picture: warping, bloom, vignetting, noise."""

from __future__ import annotations

from functools import cache

import cv2
import numpy as np
from numpy.typing import NDArray

from omnieval.datasets.synthetic import camera
from omnieval.datasets.synthetic.lighting import Light
from omnieval.seeding import named_generator

_GRAIN_SIDE = 1024
"""Side of the plate that the noise of every frame is cut from, pixels."""


def photograph(polar: NDArray[np.float32], light: Light, rng: np.random.Generator | None) -> NDArray[np.uint8]:
    """Return the camera's picture of a polar image, shape (480, 640, 3), uint8 BGR; noise-free without `rng`."""
    padded = np.concatenate([polar, polar[:1]])
    row, azimuth = camera.polar_map()
    warped = cv2.remap(padded, row, azimuth, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    view = np.asarray(warped, np.float32)
    _bloom(view, light.bloom)
    image = camera.surroundings().copy()
    disc = image[camera.DISC]
    np.minimum(view, np.float32(255.0), out=view)
    view *= camera.rim()
    disc += view
    if rng is not None:
        image += (np.float32(light.noise) * _grain(rng))[..., None]
    return np.asarray(cv2.convertScaleAbs(np.maximum(image, 0.0, out=image)), np.uint8)


def _bloom(view: NDArray[np.float32], share: float) -> None:
    """Spread a share of what is near saturation over its neighbourhood."""
    height, width = view.shape[:2]
    small = cv2.resize(view, (width // 8, height // 8), interpolation=cv2.INTER_AREA)
    glow = cv2.GaussianBlur(np.clip(small, 215.0, 420.0) - np.float32(215.0), (0, 0), 1.6)
    view += cv2.resize(np.float32(share) * glow, (width, height))


def _grain(rng: np.random.Generator) -> NDArray[np.float32]:
    """Return noise of zero mean and unit deviation, a little smooth as after demosaicing, shape (480, 640).

    A cut of one plate at a place and in a direction that `rng` draws: new noise for every pixel of every frame
    would take as long as the rest of the picture.
    """
    top = int(rng.integers(_GRAIN_SIDE - camera.HEIGHT))
    left = int(rng.integers(_GRAIN_SIDE - camera.WIDTH))
    down, right, sign = (1 if draw else -1 for draw in rng.integers(0, 2, 3))
    cut = _grain_plate()[top : top + camera.HEIGHT, left : left + camera.WIDTH][::down, ::right]
    return np.asarray(cut * np.float32(sign))


@cache
def _grain_plate() -> NDArray[np.float32]:
    white = named_generator(0, "grain").standard_normal((_GRAIN_SIDE, _GRAIN_SIDE), dtype=np.float32)
    smooth = cv2.GaussianBlur(white, (3, 3), 0.6)
    return np.asarray(smooth / smooth.std(), dtype=np.float32)
