"""Colour pictures of a sequence for people to look at; nothing is decided from them."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from omnieval.datasets.sequence import Frame
from omnieval.errors import DatasetError
from omnieval.imaging.camera import CameraModel
from omnieval.imaging.decode import decode_colour

_KEPT_PANORAMAS = 256
"""Best matches are often recent images; this many panoramas (0.2 MB each) are not unwrapped again."""


class Pictures(ABC):
    """The images of frames, by their number."""

    @abstractmethod
    def omnidirectional(self, frame: int) -> NDArray[np.uint8] | None:
        """Return the image as it was taken, shape (height, width, 3), BGR; None if that is a panorama already.

        Raises
        ------
        DatasetError
            If it cannot be read.
        """

    @abstractmethod
    def panorama(self, frame: int) -> NDArray[np.uint8]:
        """Return the panorama, shape (rows, columns, 3), BGR.

        Raises
        ------
        DatasetError
            If it cannot be read.
        """


class SequencePictures(Pictures):
    """Reads, decodes and unwraps the images of a sequence."""

    def __init__(self, frames: Sequence[Frame], camera: CameraModel) -> None:
        self._frames = frames
        self._camera = camera
        self._decode = lru_cache(1)(self._read)  # the two pictures of a frame share it
        self._panoramas = lru_cache(_KEPT_PANORAMAS)(self._unwrap)

    def omnidirectional(self, frame: int) -> NDArray[np.uint8] | None:
        """See `Pictures.omnidirectional`."""
        return self._decode(frame) if self._camera.kind == "omnidirectional" else None

    def panorama(self, frame: int) -> NDArray[np.uint8]:
        """See `Pictures.panorama`."""
        return self._panoramas(frame)

    def _unwrap(self, frame: int) -> NDArray[np.uint8]:
        return self._camera.panorama(self._decode(frame), where=str(self._frames[frame].path))

    def _read(self, frame: int) -> NDArray[np.uint8]:
        taken = self._frames[frame]
        return decode_colour(taken.read(), str(taken.path), taken.bits)


class JoinedPictures(Pictures):
    """The images of one sequence after those of an earlier one, which are opened when the first of them is asked for.

    Parameters
    ----------
    earlier
        Opens the pictures of the earlier sequence.
    count
        How many those are.
    later
        The pictures of the sequence that follows.
    """

    def __init__(self, earlier: Callable[[], Pictures], count: int, later: Pictures) -> None:
        self._open, self._count, self._later = earlier, count, later
        self._opened: Pictures | DatasetError | None = None

    def omnidirectional(self, frame: int) -> NDArray[np.uint8] | None:
        """See `Pictures.omnidirectional`."""
        pictures, number = self._place(frame)
        return pictures.omnidirectional(number)

    def panorama(self, frame: int) -> NDArray[np.uint8]:
        """See `Pictures.panorama`."""
        pictures, number = self._place(frame)
        return pictures.panorama(number)

    def _place(self, frame: int) -> tuple[Pictures, int]:
        return (self._later, frame - self._count) if frame >= self._count else (self._earlier(), frame)

    def _earlier(self) -> Pictures:
        if self._opened is None:
            try:
                self._opened = self._open()
            except DatasetError as error:
                self._opened = error  # not tried again for every frame
        if isinstance(self._opened, DatasetError):
            raise self._opened
        return self._opened
