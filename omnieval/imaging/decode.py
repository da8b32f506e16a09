"""Image files to pixels."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from omnieval.errors import DatasetError

# A broken image is reported once, by us, and not by OpenCV as well. OpenCV 5 has moved the function.
_set_log_level = getattr(cv2, "setLogLevel", None) or cv2.utils.logging.setLogLevel
_set_log_level(0)

_JPEG_START, _JPEG_END = b"\xff\xd8", b"\xff\xd9"


def decode_grey(data: bytes, where: str) -> NDArray[np.uint8]:
    """Decode an image file to grey levels, shape (height, width).

    Parameters
    ----------
    data
        Bytes of the file.
    where
        What to call it in an error.

    Raises
    ------
    DatasetError
        If it is empty, truncated or not an image.
    """
    return _decode(data, where, cv2.IMREAD_GRAYSCALE | cv2.IMREAD_IGNORE_ORIENTATION)


def decode_colour(data: bytes, where: str) -> NDArray[np.uint8]:
    """Decode an image file to colours, shape (height, width, 3), BGR; see `decode_grey`."""
    return _decode(data, where, cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION)


def _decode(data: bytes, where: str, flags: int) -> NDArray[np.uint8]:
    if not data:
        raise DatasetError(f"image {where} is empty (0 bytes); remove or replace it")
    # A JPEG cut short still decodes, its missing part grey, which would silently change every descriptor.
    if data.startswith(_JPEG_START) and _JPEG_END not in data[-1024:]:
        raise DatasetError(f"image {where} is truncated; remove or replace it")
    image = cv2.imdecode(np.frombuffer(data, np.uint8), flags)
    if image is None:
        raise DatasetError(f"{where} is not an image that can be decoded; remove or replace it")
    return image.astype(np.uint8, copy=False)
