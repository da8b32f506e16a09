"""From images to panoramas.

The top row of a panorama is the mirror's rim, its centre column what lies straight ahead (up in the image); columns to
the left of it show what lies to the left.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from omnieval.datasets.belt import Belt
from omnieval.datasets.sequence import Mirror


class Unwrapper:
    """Unwraps omnidirectional images by one precomputed map: polar, linear in the radius, bilinear.

    Parameters
    ----------
    mirror
        Where the mirror lies in the image.
    rows, columns
        Size of the panorama.
    """

    def __init__(self, mirror: Mirror, rows: int, columns: int) -> None:
        radius = mirror.r_out - (np.arange(rows) + 0.5) * (mirror.r_out - mirror.r_in) / rows
        azimuth = np.pi - 2.0 * np.pi * (np.arange(columns) + 0.5) / columns
        self._u = (mirror.cx - np.outer(radius, np.sin(azimuth))).astype(np.float32)
        self._v = (mirror.cy - np.outer(radius, np.cos(azimuth))).astype(np.float32)

    def panorama(self, image: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Unwrap an image, shape (height, width) or (height, width, 3); returns (rows, columns[, 3])."""
        # Where the image cuts the mirror's rim off, black would add edges that do not turn when the robot turns.
        unwrapped = cv2.remap(image, self._u, self._v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        return unwrapped.astype(np.uint8, copy=False)


class Resizer:
    """Brings panoramas, or a belt of them, to the size that descriptors expect, by area interpolation."""

    def __init__(self, rows: int, columns: int, belt: Belt | None = None) -> None:
        self._size = (columns, rows)
        self._belt = belt

    def panorama(self, image: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Resize a panorama, shape (height, width) or (height, width, 3); returns (rows, columns[, 3])."""
        if self._belt is not None:
            image = image[self._belt.rows(len(image))]
        return cv2.resize(image, self._size, interpolation=cv2.INTER_AREA).astype(np.uint8, copy=False)
