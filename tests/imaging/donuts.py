"""Images of a robot under a mirror, drawn for tests: a scene about it that turns, and what stays put."""

import cv2
import numpy as np
from scipy.ndimage import gaussian_filter

from omnieval.datasets.sequence import Mirror

BACKGROUNDS = {"dark": 5, "bright": 230, "grey": 128}


def donuts(
    mirror: Mirror,
    *,
    size=(240, 320),
    count=8,
    background="dark",
    light=1.0,
    noise=1.0,
    strut=False,
    aside=(0, 0),
    still=False,
    seed=0,
):
    """Grey images of a scene under a mirror: blocks and texture, turned and tilted again in every image unless `still`.

    `aside` moves the blind spot away from the mirror's centre; `strut` draws a post from it downwards to the rim.
    """
    rng = np.random.default_rng(seed)
    height, width = size
    v, u = np.mgrid[:height, :width].astype(np.float64)
    radius = np.hypot(u - mirror.cx, v - mirror.cy)
    from_spot = np.hypot(u - mirror.cx - aside[0], v - mirror.cy - aside[1])
    seen = np.clip(mirror.r_out - radius + 0.5, 0, 1) * np.clip(from_spot - mirror.r_in + 0.5, 0, 1)
    world = gaussian_filter(rng.normal(size=(256, 1024)), 4) * 700 + 128
    for _ in range(60):
        row, column = rng.integers(0, 230), rng.integers(0, 980)
        world[row : row + rng.integers(5, 60), column : column + rng.integers(5, 60)] = rng.integers(0, 256)
    beyond = BACKGROUNDS[background] + (0 if background == "dark" else gaussian_filter(rng.normal(size=size), 10) * 300)
    stays = np.where(from_spot < mirror.r_in + 1, 30 + 15 * np.cos(from_spot / 4), beyond)
    azimuth = (np.arctan2(v - mirror.cy, u - mirror.cx) / (2 * np.pi) + 1) * 1024
    down = np.clip(radius / mirror.r_out, 0, 1) * 255
    post = strut & (np.abs(u - mirror.cx) < 3 + 0.06 * radius) & (v > mirror.cy)
    images = []
    for _ in range(count):
        turned, tilted = (0, 0) if still else (rng.integers(0, 1024), rng.integers(-20, 20))
        scene = cv2.remap(
            np.roll(world, tilted, axis=0).astype(np.float32),
            ((azimuth + turned) % 1024).astype(np.float32),
            down.astype(np.float32),
            cv2.INTER_LINEAR,
        )
        image = np.where(post, 10, seen * scene + (1 - seen) * stays)
        images.append(np.clip(light * image + noise * rng.normal(size=size), 0, 255).astype(np.uint8))
    return images


def panoramas(*, size=(240, 426), count=8, seed=0):
    """Grey panoramas of a robot that moves, of any shape: blocks and discs on texture, no mirror anywhere."""
    rng = np.random.default_rng(seed)
    height, width = size
    world = gaussian_filter(rng.normal(size=(height + 40, 2 * width)), 3) * 500 + 128
    for _ in range(60):
        row, column = rng.integers(0, height), rng.integers(0, 2 * width - 40)
        world[row : row + rng.integers(5, 60), column : column + rng.integers(5, 60)] = rng.integers(0, 256)
    for _ in range(10):
        place = int(rng.integers(0, 2 * width)), int(rng.integers(0, height))
        cv2.circle(world, place, int(rng.integers(8, 40)), float(rng.integers(0, 256)), -1)
    images = []
    for _ in range(count):
        left, top = rng.integers(0, width), rng.integers(0, 40)
        image = world[top : top + height, left : left + width] + 2 * rng.normal(size=size)
        images.append(np.clip(image, 0, 255).astype(np.uint8))
    return images
