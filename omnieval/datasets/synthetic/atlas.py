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
        self, texture: NDArray[np.int32], u: NDArray[np.float32], v: NDArray[np.float32], lod: NDArray[np.float32]
    ) -> NDArray[np.uint8]:
        """Return the colours of points on textures, shape (..., 3).

        `u`, `v` count repetitions, to the right and upwards; `lod` is the base-2 logarithm of how many of the finest
        level's pixels a pixel of the view covers.
        """
        level = np.clip(np.rint(lod), 0, LEVELS - 1).astype(np.int32)
        pixels = _LEVEL_PIXELS[level]
        column = (u - np.floor(u)) * pixels + _LEVEL_START[level]
        row = (np.ceil(v) - v) * pixels + (texture * _STRIDE + (_PAD - 0.5)).astype(np.float32)
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


_LEVEL_PIXELS = np.array([PIXELS >> level for level in range(LEVELS)], np.float32)
_LEVEL_START = np.array(
    [sum((PIXELS >> k) + 2 * _PAD for k in range(level)) + _PAD - 0.5 for level in range(LEVELS)], np.float32
)
