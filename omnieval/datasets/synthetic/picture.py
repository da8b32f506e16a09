"""From a polar image to the camera's picture: exposure, warping, bloom, post and body, noise, development."""

from __future__ import annotations

from functools import cache

import cv2
import numpy as np
from numpy.typing import NDArray

from omnieval.datasets.synthetic import camera
from omnieval.datasets.synthetic.lighting import Light, Look
from omnieval.seeding import named_generator

_FOCUS = 0.9
"""Blur of the optics, pixels."""
_BLACK = 5.0
"""Grey level of what sends no light."""
_GRAIN_SIDE = 1024
"""Side of the plate that the noise of every frame is cut from, pixels."""


def photograph(
    polar: NDArray[np.float32], light: Light, rng: np.random.Generator | None, turned: float = 0.0
) -> NDArray[np.uint8]:
    """Return the camera's picture of a polar image, shape (480, 640, 3), uint8 BGR; noise-free without `rng`.

    Exposed, smeared while the robot turns by `turned` radians, with post and body, and developed.
    """
    look = light.look
    gain = _exposure(polar, look)
    polar = _smeared(polar * gain, look.shutter * abs(turned))
    row, azimuth = camera.polar_map()
    wrapped = np.concatenate([polar, polar[:1]])
    view = np.asarray(cv2.remap(wrapped, row, azimuth, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE), np.float32)
    _bloom(view, light.bloom)
    np.minimum(view, np.float32(255.0), out=view)
    _show_mount(view, polar)
    view = np.asarray(cv2.GaussianBlur(view, (5, 5), _FOCUS), np.float32)
    view *= camera.rim()
    image = camera.surroundings().copy()
    image[camera.DISC] += view
    grain = _grain(rng, np.float32(light.noise) * np.sqrt(gain)) if rng else np.zeros(image.shape[:2], np.float32)
    taken = cv2.add(image, cv2.merge([grain, grain, grain]), dtype=cv2.CV_8U)
    return _developed(np.asarray(taken, np.uint8), look)


def _exposure(polar: NDArray[np.float32], look: Look) -> np.float32:
    """Return the gain of the automatic exposure: it brings the mean most of the way to where it should be."""
    seen = np.minimum(polar[::8, ::6], np.float32(400.0))
    return np.float32(np.clip((look.exposed / max(float(seen.mean()), 1.0)) ** 0.9, 0.4, 4.0))


def _smeared(polar: NDArray[np.float32], angle: float) -> NDArray[np.float32]:
    """Return a polar image averaged over what the shutter saw of a turn, angle in radians."""
    width = round(angle / (2.0 * np.pi) * camera.AZIMUTHS) | 1
    if width < 3:
        return polar
    half = width // 2
    wrapped = np.concatenate([polar[-half:], polar, polar[:half]])
    return np.asarray(cv2.blur(wrapped, (1, width))[half:-half], np.float32)


def _show_mount(view: NDArray[np.float32], polar: NDArray[np.float32]) -> None:
    """Put post and body in, as bright as the floor around the robot lets them be."""
    mount = camera.mount()
    around = np.minimum(polar[::8, : polar.shape[1] // 3].mean(axis=(0, 1)), np.float32(255.0))
    shown = view[mount.where]
    shown *= mount.uncovered
    light = np.float32(0.5) * around + np.float32(0.5) * around.mean() + np.float32(90.0)
    shown += cv2.merge([channel * level for channel, level in zip(mount.colour, light, strict=True)])


def _developed(taken: NDArray[np.uint8], look: Look) -> NDArray[np.uint8]:
    """Return what is stored of what the sensor saw, a channel at a time: so the tables are looked up fastest."""
    channels = zip(cv2.split(taken), _development(look), strict=True)
    return np.asarray(cv2.merge([cv2.LUT(channel, table) for channel, table in channels]), np.uint8)


@cache
def _development(look: Look) -> NDArray[np.uint8]:
    """Return the tables from what the sensor saw to what is stored: blue, green, red; shape (3, 256)."""
    curve = _BLACK + 255.0 * (np.arange(256.0) / 255.0) ** look.curve * 1.12
    return np.asarray(np.clip(np.rint(curve * np.array(look.cast)[:, None]), 0, 255), np.uint8)


def _bloom(view: NDArray[np.float32], share: float) -> None:
    """Spread a share of what is near saturation over its neighbourhood."""
    height, width = view.shape[:2]
    small = cv2.resize(view, (width // 8, height // 8), interpolation=cv2.INTER_AREA)
    glow = cv2.GaussianBlur(np.clip(small, 215.0, 420.0) - np.float32(215.0), (0, 0), 1.6)
    view += cv2.resize(np.float32(share) * glow, (width, height))


def _grain(rng: np.random.Generator, deviation: np.float32) -> NDArray[np.float32]:
    """Return noise of zero mean and that deviation, a little smooth as after demosaicing, shape (480, 640).

    A cut of one plate at a place and in a direction that `rng` draws: new noise for every pixel of every frame
    would take as long as the rest of the picture.
    """
    top = int(rng.integers(_GRAIN_SIDE - camera.HEIGHT))
    left = int(rng.integers(_GRAIN_SIDE - camera.WIDTH))
    down, right, sign = (1 if draw else -1 for draw in rng.integers(0, 2, 3))
    cut = _grain_plate()[top : top + camera.HEIGHT, left : left + camera.WIDTH] * (deviation * np.float32(sign))
    turned = {(1, 1): None, (-1, 1): 0, (1, -1): 1, (-1, -1): -1}[down, right]
    return np.asarray(cut if turned is None else cv2.flip(cut, turned), np.float32)


@cache
def _grain_plate() -> NDArray[np.float32]:
    white = named_generator(0, "grain").standard_normal((_GRAIN_SIDE, _GRAIN_SIDE), dtype=np.float32)
    smooth = cv2.GaussianBlur(white, (3, 3), 0.6)
    return np.asarray(smooth / smooth.std(), dtype=np.float32)
