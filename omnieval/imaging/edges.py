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
        return EdgePoints(self.places.T[:, which].T, self.normals.T[:, which].T)


class LastingEdges:
    """The gradients of several images, of which the lasting ones are asked for.

    Parameters
    ----------
    images
        Grey images of equal shape (height, width).
    """

    def __init__(self, images: Sequence[NDArray[np.uint8]]) -> None:
        shape = images[0].shape
        self._strengths = np.empty((len(images), *shape), np.float32)
        along, across = np.zeros(shape, np.float32), np.zeros(shape, np.float32)
        for strength, image in zip(self._strengths, images, strict=True):
            level = cv2.GaussianBlur(cv2.LUT(image, _LOGARITHM), (0, 0), _SMOOTH_PX)
            dx = cv2.Sobel(level, cv2.CV_32F, 1, 0, scale=1 / 8)
            dy = cv2.Sobel(level, cv2.CV_32F, 0, 1, scale=1 / 8)
            strength[...] = cv2.magnitude(dx, dy)
            # The double angle, so that a rim that is now brighter and now darker than the scene keeps its direction.
            some = strength + np.float32(1e-6)
            along += (dx * dx - dy * dy) / some
            across += 2 * dx * dy / some
        angle = np.arctan2(across, along) / 2
        self._normals = np.cos(angle), np.sin(angle)
        self._lasting: dict[tuple[int | None, int | None], NDArray[np.float32]] = {}

    def points(self, first: int | None = None, every: int | None = None, *, contrast: float = 4.0) -> EdgePoints:
        """Return the points on edges that are in the same place in most of the images.

        Parameters
        ----------
        first, every
            Of the images that begin with number `first`, each `every`-th; all of them by default.
        contrast
            An edge is so many times stronger than the median of the whole image, which is noise and blurred scene.
        """
        if (first, every) not in self._lasting:
            self._lasting[first, every] = _upper_median(self._strengths[first::every])
        return _ridges(self._lasting[first, every], *self._normals, contrast)


def _upper_median(layers: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the median over the first axis, of an even number of values the larger of the middle two.

    The smallest is taken out again and again, which is quicker than to sort each pixel for itself.
    """
    rest: list[NDArray[np.float32]] = list(layers)
    smallest = rest[0]
    for _ in range(len(layers) // 2 + 1):
        smallest, larger = rest[0], []
        for other in rest[1:]:
            larger.append(np.maximum(smallest, other))
            smallest = np.minimum(smallest, other)
        rest = larger
    return smallest


def _ridges(
    strength: NDArray[np.float32], u: NDArray[np.float32], v: NDArray[np.float32], contrast: float
) -> EdgePoints:
    """Return where the strength is greatest across the edge, whose normal is (u, v), by the parabola through three."""
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
    normals = np.stack([u[found], v[found]]).astype(np.float64)
    places = np.stack([u_at, v_at]) + np.clip(offset, -0.5, 0.5) * normals
    return EdgePoints(places.T, normals.T)
