"""What the header of an image file says besides the size: its kind, bits a channel, and how it is to be turned.

The orientation of a camera that was held or mounted otherwise is tag 0x112 of an EXIF block (CIPA DC-008), which is a
small TIFF file of its own within a JPEG, PNG or WebP.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass

import numpy as np
from cv2.typing import MatLike

from omnieval.datasets import jpeg, png
from omnieval.wording import counted

BMP_START = b"BM"
_BMP_HEADER = 40
"""Bytes of the header from which on sizes take four bytes each."""
TIFF_STARTS = (b"II*\0", b"MM\0*")
_PNG_COLOURS = {0: "grey", 2: "colour", 3: "palette", 4: "grey with transparency", 6: "colour with transparency"}
_JPEG_COLOURS = {"Gray": "grey", "YCbCr": "colour", "RGB": "colour"}
_ORIENTATION, _BITS, _CHANNELS = 0x112, 0x102, 0x115
_MOST_TAGS = 512
_EXIF_MARK = b"Exif\0\0"
_HEADER_BYTES = 1 << 16
"""What the directory of an EXIF block lies within."""

TURNS = {
    2: "mirrored",
    3: "turned by 180 degrees",
    4: "mirrored upside down",
    5: "mirrored and turned by 90 degrees",
    6: "turned by 90 degrees",
    7: "mirrored and turned by 270 degrees",
    8: "turned by 270 degrees",
}
"""What an orientation does to the pixels as they are stored, clockwise."""


@dataclass(frozen=True, slots=True)
class Header:
    """What a file is (``PNG, grey, 16 bits``), its bits a channel, and its EXIF orientation, 1 where it has none.

    `size` is (width, height) in pixels as they are stored, None where the header of a JPEG, PNG or BMP does not say it,
    and for all other formats.
    """

    kind: str = ""
    bits: int = 8
    orientation: int = 1
    size: tuple[int, int] | None = None


UNKNOWN = Header()
"""Of a format that is not known here."""


def read_header(data: bytes) -> Header:
    """Return what the header of an image file says; `UNKNOWN` if it is of another format."""
    if data.startswith(jpeg.START):
        width, height, colour = jpeg.about(data)
        return Header(f"JPEG, {_JPEG_COLOURS.get(colour, colour)}", 8, orientation_of(data), _size(width, height))
    if data.startswith(png.START) and len(data) > 25:
        bits, colour = data[24], _PNG_COLOURS.get(data[25], "")
        deep = f", {counted(bits, 'bit')}" if bits != 8 and data[25] != 3 else ""
        width, height = (int.from_bytes(data[at : at + 4], "big") for at in (16, 20))
        return Header(f"PNG, {colour}{deep}", bits, orientation_of(data), _size(width, height))
    if data.startswith(TIFF_STARTS):
        tags = _tags(data)
        bits, colour = tags.get(_BITS, 8), "grey" if tags.get(_CHANNELS, 1) == 1 else "colour"
        deep = f", {counted(bits, 'bit')}" if bits != 8 else ""
        return Header(f"TIFF, {colour}{deep}", bits, orientation_of(data))
    if data[8:12] == b"WEBP":
        return Header("WebP", 8, orientation_of(data))
    if data[:2] in (b"P5", b"P6"):
        return Header("PGM, grey" if data[:2] == b"P5" else "PPM, colour", 16 if _pnm_is_deep(data) else 8)
    return Header("BMP", size=_bmp_size(data)) if data.startswith(BMP_START) else UNKNOWN


def orientation_of(data: bytes) -> int:
    """Return the EXIF orientation of an image file, 1 (as it is) to 8; 1 where it has none or an impossible one."""
    tiff = b""
    if data.startswith(jpeg.START):
        at = data.find(_EXIF_MARK, 0, data.find(jpeg.START_OF_SCAN))
        tiff = data[at + len(_EXIF_MARK) :][:_HEADER_BYTES] if at >= 0 else b""
    elif data.startswith(png.START):
        tiff = png.exif(data)
    elif data[8:12] == b"WEBP":
        at = data.rfind(b"EXIF")
        tiff = data[at + 8 :].removeprefix(_EXIF_MARK) if at >= 0 else b""
    elif data.startswith(TIFF_STARTS):
        tiff = data
    value = _tags(tiff).get(_ORIENTATION, 1) if tiff else 1
    return value if value in TURNS else 1


def turned(image: MatLike, orientation: int) -> MatLike:
    """Return an image, shape (height, width[, channels]), as its orientation says it is to be seen."""
    if orientation not in TURNS:
        return image
    if orientation >= 5:
        image = image.swapaxes(0, 1)
    if orientation in (3, 4, 7, 8):
        image = image[::-1]
    if orientation in (2, 3, 6, 7):
        image = image[:, ::-1]
    return np.ascontiguousarray(image)


def _tags(tiff: bytes) -> dict[int, int]:
    """Return the first value of the short and long tags of the first directory of a TIFF; none if it is damaged."""
    order = {b"II": "<", b"MM": ">"}.get(tiff[:2])
    if order is None:
        return {}
    try:
        (at,) = struct.unpack_from(f"{order}I", tiff, 4)
        (count,) = struct.unpack_from(f"{order}H", tiff, at)
        tags = {}
        for number in range(min(count, _MOST_TAGS)):
            tag, kind, length = struct.unpack_from(f"{order}HHI", tiff, at + 2 + 12 * number)
            form = {3: "H", 4: "I"}.get(kind)
            if form is None:
                continue
            where = at + 10 + 12 * number
            if length * struct.calcsize(form) > 4:
                (where,) = struct.unpack_from(f"{order}I", tiff, where)
            (tags[tag],) = struct.unpack_from(f"{order}{form}", tiff, where)
    except struct.error:
        return {}
    return tags


def _bmp_size(data: bytes) -> tuple[int, int] | None:
    if int.from_bytes(data[14:18], "little") < _BMP_HEADER:
        return None
    width, height = (int.from_bytes(data[at : at + 4], "little", signed=True) for at in (18, 22))
    return _size(width, abs(height))  # negative where the rows go from top to bottom


def _size(width: int, height: int) -> tuple[int, int] | None:
    return (width, height) if width > 0 and height > 0 else None


def _pnm_is_deep(data: bytes) -> bool:
    words = [word for line in data[:512].split(b"\n") for word in line.partition(b"#")[0].split()]
    return len(words) > 3 and words[3].isdigit() and int(words[3]) > 255
