"""Colour pictures of a sequence for people to look at; nothing is decided from them."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from omnieval.datasets.sequence import Frame
from omnieval.imaging.camera import CameraModel
from omnieval.imaging.decode import decode_colour

_KEPT_PANORAMAS = 256
"""Best matches are often recent images; this many panoramas (0.2 MB each) are not unwrapped again."""


class Pictures:
    """Reads, decodes and unwraps the images of a sequence, by frame number."""

    def __init__(self, frames: Sequence[Frame], camera: CameraModel) -> None:
        self._frames = frames
        self._camera = camera
        self._decode = lru_cache(1)(self._read)  # the two pictures of a frame share it
        self._panoramas = lru_cache(_KEPT_PANORAMAS)(self._unwrap)

    def omnidirectional(self, frame: int) -> NDArray[np.uint8] | None:
        """Return the image as it was taken, shape (height, width, 3), BGR; None if that is a panorama already."""
        return self._decode(frame) if self._camera.kind == "omnidirectional" else None

    def panorama(self, frame: int) -> NDArray[np.uint8]:
        """Return the panorama, shape (rows, columns, 3), BGR."""
        return self._panoramas(frame)

    def _unwrap(self, frame: int) -> NDArray[np.uint8]:
        return self._camera.panorama(self._decode(frame), where=str(self._frames[frame].path))

    def _read(self, frame: int) -> NDArray[np.uint8]:
        taken = self._frames[frame]
        return decode_colour(taken.read(), str(taken.path), taken.bits)
