"""Is an image file whole? Decoders pad a truncated image silently, so the end is looked for in the bytes.

A JPEG or BMP whose middle has been overwritten decodes, with a part of the picture wrong: nothing in these formats
guards the pixels, and what the JPEG decoder notices it prints and does not hand on. What the bytes of a JPEG tell is
looked for (`datasets.jpeg`). A PNG guards its pixels by checksums.
"""

from __future__ import annotations

import stat
import zlib
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from cv2.typing import MatLike

from omnieval.datasets import jpeg

_PNG_START = b"\x89PNG\r\n\x1a\n"
_PNG_END = b"IEND\xaeB`\x82"
_BMP_START = b"BM"
_BMP_HEADER = 40
"""Bytes of the header from which on sizes take four bytes each."""
_PNG_ANCILLARY = 0x20
"""Bit of the first letter of a PNG chunk that can be done without; decoders pass over a damaged one."""


@dataclass(frozen=True, slots=True)
class ImageReport:
    """Size (width, height) in pixels of a sound image, or the code and message of what is wrong with it."""

    size: tuple[int, int] | None = None
    code: str = ""
    message: str = ""


def inspect_image(path: Path) -> ImageReport:
    """Read and decode the image at `path`, and report its size or its fault."""
    data = _whole(path)
    return data if isinstance(data, ImageReport) else _decoded_report(data)


def examine_image(path: Path) -> ImageReport:
    """Read the image at `path` and report its size or its fault, without decoding it if its header is understood.

    Finds what `inspect_image` finds, except what only a decoder notices, in a tenth of the time.
    """
    data = _whole(path)
    if isinstance(data, ImageReport):
        return data
    size = header_size(data)
    return _decoded_report(data) if size is None else ImageReport(size=size)


def usual_size(reports: Iterable[ImageReport]) -> tuple[int, int] | None:
    """Return the size most images have, None if there is no sound one."""
    sizes = Counter(report.size for report in reports if report.size is not None)
    return min(sizes, key=lambda size: (-sizes[size], size)) if sizes else None


def wrong_size(size: tuple[int, int], usual: tuple[int, int]) -> str:
    """Return what to say of an image of another size than most."""
    return f"is {size[0]} x {size[1]} pixels, most are {usual[0]} x {usual[1]}; all must have one size"


def is_truncated(data: bytes) -> bool:
    """Tell whether the JPEG, PNG or BMP in `data` lacks its end; False for other formats."""
    if data.startswith(jpeg.START):
        return jpeg.is_cut_short(data)
    if data.startswith(_PNG_START):
        return _PNG_END not in data
    if data.startswith(_BMP_START):
        return len(data) < int.from_bytes(data[2:6], "little")
    return False


def damage(data: bytes) -> str | None:
    """Say what is wrong in the middle of the JPEG or PNG in `data`; None if nothing is seen, and for other formats."""
    if data.startswith(jpeg.START) and jpeg.is_overwritten(data):
        return "a part of it was overwritten"
    if data.startswith(_PNG_START) and _has_wrong_checksum(data):
        return "a checksum is wrong"
    return None


def _has_wrong_checksum(data: bytes) -> bool:
    view, position = memoryview(data), len(_PNG_START)
    while position + 12 <= len(data):
        end = position + 8 + int.from_bytes(data[position : position + 4], "big")
        needed = not data[position + 4] & _PNG_ANCILLARY
        if needed and zlib.crc32(view[position + 4 : end]) != int.from_bytes(data[end : end + 4], "big"):
            return True
        if data.startswith(b"IEND", position + 4):
            return False
        position = end + 4
    return True


def header_size(data: bytes) -> tuple[int, int] | None:
    """Return (width, height) in pixels as the header of a JPEG, PNG or BMP has it; None if it tells no such thing."""
    width = height = 0
    if data.startswith(jpeg.START):
        width, height = jpeg.size_of(data)
    elif data.startswith(_PNG_START):
        width, height = (int.from_bytes(data[at : at + 4], "big") for at in (16, 20))
    elif data.startswith(_BMP_START) and int.from_bytes(data[14:18], "little") >= _BMP_HEADER:
        width, height = (int.from_bytes(data[at : at + 4], "little", signed=True) for at in (18, 22))
    # The height of a BMP is negative where its rows go from top to bottom.
    return (width, abs(height)) if width > 0 and height else None


def _whole(path: Path) -> bytes | ImageReport:
    """Return the bytes at `path`, or what is wrong with them as bytes."""
    try:
        if not stat.S_ISREG(path.stat().st_mode) and not path.is_dir():  # a pipe would never end
            return ImageReport(code="unreadable-image", message="is not a file; remove it")
        data = path.read_bytes()
    except OSError as error:
        return ImageReport(code="unreadable-image", message=f"cannot be read: {error.strerror or error}")
    if not data:
        return ImageReport(code="empty-image", message="has no bytes; copy it again")
    if is_truncated(data):
        return ImageReport(code="truncated-image", message=f"ends early, after {len(data)} bytes; copy it again")
    if wrong := damage(data):
        return ImageReport(code="damaged-image", message=f"is damaged: {wrong}; copy it again")
    return data


def _decoded_report(data: bytes) -> ImageReport:
    try:
        pixels: MatLike | None = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    except cv2.error:  # what one release of OpenCV answers with None, another raises
        pixels = None
    if pixels is None:
        return ImageReport(code="not-an-image", message="is not an image; copy it again or remove it")
    return ImageReport(size=(int(pixels.shape[1]), int(pixels.shape[0])))
