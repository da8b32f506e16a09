"""Is a PNG file whole: its chunks, each of which a checksum guards (ISO/IEC 15948, clause 5)."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator

START = b"\x89PNG\r\n\x1a\n"
_END = b"IEND\xaeB`\x82"
_HEAD = struct.Struct(">I4s")
"""Length of a chunk's content, and its kind; the content follows, and then four bytes of checksum."""
_ANCILLARY = 0x20
"""Bit of the first letter of a chunk that can be done without; decoders pass over a damaged one."""


def is_cut_short(data: bytes) -> bool:
    """Tell whether a file lacks its end."""
    return data.rfind(_END) < 0  # from behind, where it is if the file is whole


def has_wrong_checksum(data: bytes) -> bool:
    """Tell whether a chunk that the pixels need is not what its checksum says, or the last one is not reached."""
    view = memoryview(data)
    for kind, start, end in _chunks(data):
        if not kind[0] & _ANCILLARY and zlib.crc32(view[start - 4 : end]) != int.from_bytes(data[end : end + 4], "big"):
            return True
        if kind == b"IEND":
            return False
    return True


def exif(data: bytes) -> bytes:
    """Return the EXIF block, which may stand behind the pixels; empty if there is none."""
    return next((data[start:end] for kind, start, end in _chunks(data) if kind == b"eXIf"), b"")


def _chunks(data: bytes) -> Iterator[tuple[bytes, int, int]]:
    """Yield the kind of every chunk, and where its content starts and ends."""
    start = len(START) + _HEAD.size
    while start + 4 <= len(data):
        length, kind = _HEAD.unpack_from(data, start - _HEAD.size)
        yield kind, start, start + length
        start += length + 4 + _HEAD.size
