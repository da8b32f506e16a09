"""Edges that stay where they are while the robot moves: the mirror's rim, the camera's own reflection, posts.

What the mirror shows changes from frame to frame; its rim does not, whatever is seen on either side of it. So each
pixel keeps the median of its gradient over the frames. Grey levels are taken logarithmically, so that a rim counts as
much in a dark corner as before a window.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

_SMOOTH_PX = 1.2
_DARK = 16.0
"""Grey levels added before the logarithm is taken, about the noise of a dark image."""
_WEAKEST = 0.01
"""Gradient of the logarithm, a pixel, below which there is no edge."""
_BORDER_PX = 3
_MOST = 20_000
_LOGARITHM = np.log(np.arange(256, dtype=np.float32) + np.float32(_DARK))


@dataclass(frozen=True)
class EdgePoints:
    """Points on edges, and the direction across each.

    Attributes
    ----------
    places
        Shape (n, 2), pixels (x, y), finer than a pixel.
    normals
        Unit vectors across the edge, shape (n, 2); their sign means nothing.
    """

    places: NDArray[np.float64]
    normals: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.places)

    def taken(self, which: NDArray[Any]) -> EdgePoints:
        """Return some of the points, by their numbers or a mask."""
        return EdgePoints(self.places[which], self.normals[which])


class LastingEdges:
    """The gradients of several images, of which the lasting ones are asked for.

    Parameters
    ----------
    images
        Grey images of equal shape (height, width).
    """

    def __init__(self, images: Sequence[NDArray[np.uint8]]) -> None:
        self._strengths = np.empty((len(images), *images[0].shape), np.float32)
        along = np.zeros(images[0].shape, np.float32)
        across = np.zeros(images[0].shape, np.float32)
        for strength, image in zip(self._strengths, images, strict=True):
            level = cv2.GaussianBlur(_LOGARITHM[image], (0, 0), _SMOOTH_PX)
            dx = cv2.Sobel(level, cv2.CV_32F, 1, 0, scale=1 / 8)
            dy = cv2.Sobel(level, cv2.CV_32F, 0, 1, scale=1 / 8)
            np.hypot(dx, dy, out=strength)
            # The double angle, so that a rim that is now brighter and now darker than the scene keeps its direction.
            along += (dx * dx - dy * dy) / (strength + 1e-6)
            across += 2 * dx * dy / (strength + 1e-6)
        self._angle = (np.arctan2(across, along) / 2).astype(np.float32)

    def points(self, every: slice = slice(None), *, contrast: float = 4.0) -> EdgePoints:
        """Return the points on edges that are in the same place in most of the images, or of every so many.

        An edge is `contrast` times stronger than the median of the whole image, which is noise and blurred scene.
        """
        strengths = self._strengths[every]
        middle = np.partition(strengths, len(strengths) // 2, axis=0)[len(strengths) // 2]
        return _ridges(middle, self._angle, contrast)


def _ridges(strength: NDArray[np.float32], angle: NDArray[np.float32], contrast: float) -> EdgePoints:
    """Return where the strength is greatest across the edge, by the parabola through three values."""
    u, v = np.cos(angle), np.sin(angle)
    rows, columns = np.mgrid[0 : strength.shape[0], 0 : strength.shape[1]].astype(np.float32)
    before = cv2.remap(strength, columns - u, rows - v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    after = cv2.remap(strength, columns + u, rows + v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    least = max(contrast * float(np.median(strength)), _WEAKEST)
    found = (strength > before) & (strength >= after) & (strength > least)
    found[:_BORDER_PX] = found[-_BORDER_PX:] = False
    found[:, :_BORDER_PX] = found[:, -_BORDER_PX:] = False
    if found.sum() > _MOST:
        found &= strength >= np.partition(strength[found], -_MOST)[-_MOST]
    v_at, u_at = np.nonzero(found)
    low, mid, high = before[found], strength[found], after[found]
    offset = 0.5 * (low - high) / np.minimum(low - 2 * mid + high, -1e-9)
    normals = np.column_stack([u[found], v[found]]).astype(np.float64)
    places = np.column_stack([u_at, v_at]) + np.clip(offset, -0.5, 0.5)[:, np.newaxis] * normals
    return EdgePoints(places, normals)
