"""Is an image file whole? Decoders pad a truncated image silently, so the end is looked for in the bytes."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from cv2.typing import MatLike

_JPEG_START = b"\xff\xd8"
_JPEG_END = b"\xff\xd9"
_PNG_START = b"\x89PNG\r\n\x1a\n"
_PNG_END = b"IEND\xaeB`\x82"
_BMP_START = b"BM"
_START_OF_SCAN = 0xDA
_STANDALONE = frozenset({0x01, *range(0xD0, 0xD8)})
"""JPEG markers without a length: TEM and the restart markers."""


@dataclass(frozen=True, slots=True)
class ImageReport:
    """Size (width, height) in pixels of a sound image, or the code and message of what is wrong with it."""

    size: tuple[int, int] | None = None
    code: str = ""
    message: str = ""


def inspect_image(path: Path) -> ImageReport:
    """Read and decode the image at `path`, and report its size or its fault."""
    try:
        data = path.read_bytes()
    except OSError as error:
        return ImageReport(code="unreadable-image", message=f"cannot be read: {error.strerror or error}")
    if not data:
        return ImageReport(code="empty-image", message="has no bytes; copy it again")
    if is_truncated(data):
        return ImageReport(code="truncated-image", message=f"ends early, after {len(data)} bytes; copy it again")
    pixels = _decoded(data)
    if pixels is None:
        return ImageReport(code="not-an-image", message="is not an image; copy it again or remove it")
    return ImageReport(size=(int(pixels.shape[1]), int(pixels.shape[0])))


def _decoded(data: bytes) -> MatLike | None:
    try:
        return cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    except cv2.error:  # what one release of OpenCV answers with None, another raises
        return None


def is_truncated(data: bytes) -> bool:
    """Tell whether the JPEG, PNG or BMP in `data` lacks its end; False for other formats."""
    if data.startswith(_JPEG_START):
        scan = _jpeg_scan_start(data)
        return scan is None or data.find(_JPEG_END, scan) < 0
    if data.startswith(_PNG_START):
        return _PNG_END not in data
    if data.startswith(_BMP_START):
        return len(data) < int.from_bytes(data[2:6], "little")
    return False


def _jpeg_scan_start(data: bytes) -> int | None:
    """Return where the coded pixels begin, None if the segments before them end early.

    An end-of-image marker counts only behind that place: the thumbnail in a header has one of its own.
    """
    position = len(_JPEG_START)
    while position + 4 <= len(data) and data[position] == 0xFF:
        marker = data[position + 1]
        if marker == 0xFF:
            position += 1
        elif marker in _STANDALONE:
            position += 2
        else:
            position += 2 + int.from_bytes(data[position + 2 : position + 4], "big")
            if marker == _START_OF_SCAN:
                return position
    return None
