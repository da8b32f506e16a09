"""All textures in one picture, with coarser copies for what is far away, so that one look-up paints a frame."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from omnieval.datasets.synthetic.textures import PIXELS, draw, names, size_of

LEVELS = 6
"""Copies of each texture, every one half as wide as the one before."""
_PAD = 2
_STRIDE = PIXELS + 2 * _PAD


@dataclass(frozen=True)
class Atlas:
    """The textures and where they lie.

    Attributes
    ----------
    picture
        Every texture's levels side by side, one texture below the other, uint8 BGR.
    index
        Number of each texture by name.
    sizes
        Metres that one repetition of each covers, shape (textures,).
    """

    picture: NDArray[np.uint8]
    index: dict[str, int]
    sizes: NDArray[np.float32]

    def look_up(
        self, texture: NDArray[np.intp], u: NDArray[np.float32], v: NDArray[np.float32], covered: NDArray[np.float32]
    ) -> NDArray[np.uint8]:
        """Return the colours of points on textures, shape (..., 3); of no meaning where `texture` is negative.

        `u`, `v` count repetitions, to the right and upwards; `covered` is how many of the finest level's pixels a
        pixel of the view covers.
        """
        level = np.zeros(covered.shape, np.uint8)
        for bound in _LEVEL_FROM:
            level += covered >= bound
        level = level.astype(np.intp)
        pixels = _LEVEL_PIXELS.take(level)
        column = u - np.floor(u)
        column *= pixels
        column += _LEVEL_START.take(level)
        row = np.ceil(v) - v
        row *= pixels
        row += (np.arange(len(self.index)) * _STRIDE + (_PAD - 0.5)).astype(np.float32).take(texture)
        return np.asarray(cv2.remap(self.picture, column, row, cv2.INTER_LINEAR), dtype=np.uint8)


@lru_cache(maxsize=1)
def build_atlas(seed: int) -> Atlas:
    """Draw all textures and their coarser copies; the last atlas is kept, since all lights share it."""
    strips = [_strip(draw(name, seed)) for name in names()]
    index = {name: i for i, name in enumerate(names())}
    return Atlas(np.vstack(strips), index, np.array([size_of(name) for name in names()], np.float32))


def _strip(texture: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return a texture's levels side by side, each with a margin that wraps around."""
    parts = []
    for level in range(LEVELS):
        side = PIXELS >> level
        small = cv2.resize(texture, (side, side), interpolation=cv2.INTER_AREA)
        padded = cv2.copyMakeBorder(small, _PAD, _PAD, _PAD, _PAD, cv2.BORDER_WRAP)
        parts.append(cv2.copyMakeBorder(padded, 0, _STRIDE - padded.shape[0], 0, 0, cv2.BORDER_CONSTANT))
    return np.hstack(parts)


def _first_of(level: int) -> np.float32:
    """Return from how many covered pixels on a level is the best: the least number whose log2 rounds to it."""
    covered = np.float32(2.0 ** (level - 0.5) * (1.0 - 1e-6))
    while np.rint(np.log2(covered)) < level:
        covered = np.nextafter(covered, np.float32(np.inf))
    return covered


_LEVEL_FROM = tuple(_first_of(level) for level in range(1, LEVELS))
_LEVEL_PIXELS = np.array([PIXELS >> level for level in range(LEVELS)], np.float32)
_LEVEL_START = np.array(
    [sum((PIXELS >> k) + 2 * _PAD for k in range(level)) + _PAD - 0.5 for level in range(LEVELS)], np.float32
)
