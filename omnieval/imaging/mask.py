"""What stays put in the robot's frame, posts, struts and the robot's own body, and must not be described.

A mask is an image of the size of the camera's: white where the scene is seen, black elsewhere. It is brought to the
panorama as the images are, and made a pixel smaller on all sides, so that no gradient reaches into what is masked.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from omnieval.errors import DatasetError
from omnieval.imaging.decode import decode_grey
from omnieval.wording import shown

_WHITE = 128


@dataclass(frozen=True)
class MaskFile:
    """A mask as it lies on disk, in the images' own pixels.

    Attributes
    ----------
    file
        Where it was read.
    digest
        Of its bytes.
    image
        255 where the scene is seen, 0 elsewhere, shape (height, width).
    """

    file: Path
    digest: str
    image: NDArray[np.uint8]


@dataclass(frozen=True)
class PanoramaMask:
    """Which pixels of a panorama show the scene, shape (rows, columns)."""

    seen: NDArray[np.bool_]

    def filled(self, panorama: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Return a panorama in which masked pixels are blended from the seen ones beside them in their row.

        For filters that reach further than a pixel, and descriptors that know nothing of masks: no edge of a post is
        left. A row without a seen pixel is the nearest row that has one.
        """
        if panorama.ndim == 3:
            return np.stack([self.filled(panorama[:, :, channel]) for channel in range(panorama.shape[2])], axis=2)
        rows, left, right, share = self._neighbours
        blended = (1 - share) * panorama[rows, left] + share * panorama[rows, right]
        filled: NDArray[np.uint8] = np.where(self.seen, panorama, np.rint(blended).astype(np.uint8))
        return filled

    @cached_property
    def _neighbours(self) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.intp], NDArray[np.float64]]:
        """Return, for every pixel, its row, the seen columns left and right, and the share of the right one."""
        height, width = self.seen.shape
        useful = np.flatnonzero(self.seen.any(axis=1))
        nearest = useful[np.abs(np.arange(height)[:, np.newaxis] - useful).argmin(axis=1)]
        seen = self.seen[nearest]
        # Three times around, so that the nearest on either side is never beyond the end.
        around = np.arange(3 * width)
        thrice = np.tile(seen, 3)
        left = np.maximum.accumulate(np.where(thrice, around, -1), axis=1)[:, width : 2 * width]
        backwards = np.where(thrice, around, 3 * width)[:, ::-1]
        right = np.minimum.accumulate(backwards, axis=1)[:, ::-1][:, width : 2 * width]
        here = np.arange(width, 2 * width)
        share = (here - left) / np.maximum(right - left, 1)
        rows: NDArray[np.intp] = np.broadcast_to(nearest[:, np.newaxis], seen.shape)
        return rows, left % width, right % width, share


def load_mask(file: Path, size: tuple[int, int]) -> MaskFile:
    """Read a mask for images of this (width, height).

    Raises
    ------
    DatasetError
        If it cannot be read, or has another size.
    """
    where = shown(str(file))
    try:
        data = file.expanduser().read_bytes()
    except OSError as error:
        raise DatasetError(f"cannot read mask {where}: {error.strerror or error}; correct imaging.mask") from error
    image = decode_grey(data, where)
    height, width = image.shape
    if (width, height) != size:
        raise DatasetError(
            f"mask {where} is {width} x {height} pixels, the images are {size[0]} x {size[1]}; draw it over one of them"
        )
    seen: NDArray[np.uint8] = np.where(image >= _WHITE, 255, 0).astype(np.uint8)
    return MaskFile(file, hashlib.blake2b(data, digest_size=16).hexdigest(), seen)


def panorama_mask(mask: MaskFile, panorama: Callable[[NDArray[np.uint8]], NDArray[np.uint8]]) -> PanoramaMask:
    """Return which pixels of the panorama show the scene and nothing else.

    Raises
    ------
    DatasetError
        If none is left.
    """
    whole = panorama(mask.image) == 255
    wide = cv2.copyMakeBorder(whole.astype(np.uint8), 1, 1, 0, 0, cv2.BORDER_REPLICATE)
    wide = cv2.copyMakeBorder(wide, 0, 0, 1, 1, cv2.BORDER_WRAP)
    seen: NDArray[np.bool_] = cv2.erode(wide, np.ones((3, 3), np.uint8))[1:-1, 1:-1] > 0
    if not seen.any():
        raise DatasetError(f"mask {shown(str(mask.file))} leaves nothing of the panorama; white is what is seen")
    return PanoramaMask(seen)
