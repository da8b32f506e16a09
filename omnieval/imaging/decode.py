"""Image files to pixels."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from omnieval.datasets.images import damage, is_truncated
from omnieval.errors import DatasetError


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
        If it is empty, truncated, damaged or not an image.
    """
    return _decode(data, where, cv2.IMREAD_GRAYSCALE | cv2.IMREAD_IGNORE_ORIENTATION)


def decode_colour(data: bytes, where: str) -> NDArray[np.uint8]:
    """Decode an image file to colours, shape (height, width, 3), BGR; see `decode_grey`."""
    return _decode(data, where, cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION)


def _decode(data: bytes, where: str, flags: int) -> NDArray[np.uint8]:
    if not data:
        raise DatasetError(f"image {where} is empty (0 bytes); remove or replace it")
    # A file cut short may still decode, its missing part grey, which would silently change every descriptor.
    if is_truncated(data):
        raise DatasetError(f"image {where} is truncated; remove or replace it")
    # Said here because the decoder would print its own complaint, or none at all.
    if wrong := damage(data):
        raise DatasetError(f"image {where} is damaged ({wrong}); remove or replace it")
    try:
        image = cv2.imdecode(np.frombuffer(data, np.uint8), flags)
    except cv2.error:  # what one release of OpenCV answers with None, another raises
        image = None
    if image is None:
        raise DatasetError(f"{where} is not an image that can be decoded; remove or replace it")
    return image.astype(np.uint8, copy=False)
