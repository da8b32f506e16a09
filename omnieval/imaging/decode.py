"""Decodes image files to pixels."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from omnieval.datasets.images import BadImageError, decoded
from omnieval.errors import DatasetError


def decode_grey(data: bytes, where: str, bits: int | None = None) -> NDArray[np.uint8]:
    """Decode an image file to grey levels, shape (height, width).

    Parameters
    ----------
    data
        Bytes of the file.
    where
        What to call it in an error.
    bits
        Of an image of 16 bits a channel, how many are used; see `omnieval.datasets.images.decoded`.

    Raises
    ------
    DatasetError
        If it is empty, truncated, damaged or not an image.
    """
    return _decode(data, where, bits, colour=False)


def decode_colour(data: bytes, where: str, bits: int | None = None) -> NDArray[np.uint8]:
    """Decode an image file to colours, shape (height, width, 3), BGR; see `decode_grey`."""
    return _decode(data, where, bits, colour=True)


def _decode(data: bytes, where: str, bits: int | None, *, colour: bool) -> NDArray[np.uint8]:
    try:
        return decoded(data, colour=colour, bits=bits)
    except BadImageError as bad:
        raise DatasetError(f"image {where} {bad}") from bad
