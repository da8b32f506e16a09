"""Images of a stream as files: PNG, which loses nothing, or the bytes of a compressed image as they are."""

from __future__ import annotations

import cv2
import numpy as np
from cv2.typing import MatLike

_QUICK = [cv2.IMWRITE_PNG_COMPRESSION, 1]
_MAGIC = {b"\xff\xd8": ".jpg", b"\x89PNG\r\n\x1a\n": ".png", b"BM": ".bmp"}


def file_name(number: int, suffix: str) -> str:
    """Return the name of image `number` of a stream.

    Examples
    --------
    >>> file_name(12, ".png")
    'frame000012.png'
    """
    return f"frame{number:06d}{suffix}"


def png(image: MatLike) -> bytes:
    """Return an image, grey or BGR, of 8 or 16 bits, as a PNG file."""
    _, data = cv2.imencode(".png", image, _QUICK)
    return data.tobytes()


def as_file(data: bytes) -> tuple[bytes, str] | None:
    """Return a compressed image as it is read from a folder, and the ending of its name.

    JPEG, PNG and BMP stay as they are, sound or not; whatever else OpenCV decodes becomes a PNG. None if it is no
    image.
    """
    for magic, suffix in _MAGIC.items():
        if data.startswith(magic):
            return data, suffix
    try:
        image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED) if data else None
    except cv2.error:
        image = None
    return None if image is None else (png(image), ".png")
