"""Is a JPEG file whole, and its pixels (ITU-T T.81, Annex B).

Nothing in a JPEG guards the pixels, so that one with a single other bit cannot be told from a sound one. But what
overwrites coded pixels seldom leaves as many of them as the image has, and the decoder of libjpeg-turbo notices. A
look at the bytes tells, in a tenth of the time, which files the decoder has to be asked about.
"""

from __future__ import annotations

import re
from collections import defaultdict

import numpy as np
import simplejpeg
from numpy.typing import NDArray

START = b"\xff\xd8"
_END = b"\xff\xd9"
START_OF_SCAN = b"\xff\xda"
_RESTART_INTERVAL = 0xDD
_HUFFMAN_TABLES = 0xC4
_PROGRESSIVE = 0xC2
_SEGMENT = re.compile(rb"(?:\xff+[\x01\xd0-\xd7])*\xff+([^\x00\xff])(..)", re.DOTALL)
"""Marker and length; before them fill bytes, and markers that have no length."""
_FOREIGN = re.compile(rb"\xff[^\x00\xff\xc4\xd0-\xd7\xd9\xda]")
"""A marker that stands neither within coded pixels nor, as a rule, between two scans."""
_RESTART = re.compile(rb"\xff[\xd0-\xd7]")
_ZEROS = bytes(128)
_USUAL_LUMINANCE = bytes.fromhex("01020300041105122131410613516107227114328191a108")
"""Begin of Table K.5, in which zeros are no code for the end of a block, so that no picture is coded as zeros."""


def about(data: bytes) -> tuple[int, int, str]:
    """Return width and height in pixels and the colours as the header says, zeros and nothing if it does not."""
    try:
        height, width, colours, _ = simplejpeg.decode_jpeg_header(data)
    except ValueError:
        return 0, 0, ""
    return width, height, colours


def is_cut_short(data: bytes) -> bool:
    """Tell whether a file lacks its end.

    An end-of-image marker counts only behind the header: the thumbnail in it has one of its own.
    """
    _, scan = _header(data)
    return scan < 0 or data.rfind(_END, scan) < 0


def with_end(data: bytes) -> bytes | None:
    """Return a file that lacks its end with the end-of-image marker, None unless every block of its pixels is there.

    The decoder notices blocks that are missing, but not scans of a progressive file, of which each makes the picture
    finer.
    """
    mended = data.removesuffix(b"\xff") + _END
    try:
        decoded = pixels(mended, colour=False)
    except ValueError:
        return None
    return None if decoded is None or not _all_scans(mended) else mended


def is_overwritten(data: bytes) -> bool:
    """Tell whether the coded pixels of a whole file cannot be what an encoder wrote; most files are not decoded for it.

    Finds 512 bytes of foreign data or zeros nearly always, other pixels and single bytes seldom.
    """
    segments, scan = _header(data)
    end = data.rfind(_END, scan)
    zeros = data.find(_ZEROS, scan, end) >= 0
    if zeros and _USUAL_LUMINANCE in segments[_HUFFMAN_TABLES] and data.find(START_OF_SCAN, scan, end) < 0:
        return True
    restarts = _RESTART.findall(data, scan, end)
    counts_on = all(marker[1] == 0xD0 + number % 8 for number, marker in enumerate(restarts))
    announced = _RESTART_INTERVAL in segments or not restarts
    if not zeros and counts_on and announced and not _FOREIGN.search(data, scan, end):
        return False
    try:
        pixels(data, colour=False)
    except ValueError:
        return True
    return False


def pixels(data: bytes, *, colour: bool) -> NDArray[np.uint8] | None:
    """Decode to grey levels, shape (height, width), or colours, shape (height, width, 3), BGR.

    None if the file is of a kind that another decoder has to be asked for, such as one of printing inks.

    Raises
    ------
    ValueError
        If the decoder notices that something is wrong.
    """
    try:
        _, _, space, _ = simplejpeg.decode_jpeg_header(data)
    except ValueError:
        return None
    if space not in {"YCbCr", "Gray"}:
        return None
    image: NDArray[np.uint8] = simplejpeg.decode_jpeg(data, colorspace="BGR" if colour else "GRAY", strict=True)
    return image if colour else image[..., 0]


def _all_scans(data: bytes) -> bool:
    """Tell whether the scans of a file make up all bits of all coefficients, as those of a file of one scan do."""
    segments, first = _header(data)
    frame = segments[_PROGRESSIVE]
    if len(frame) < 6:
        return True
    wanted = {(component, k) for component in frame[6::3] for k in (0, 1, 63)}
    position = first - len(segments[START_OF_SCAN[1]]) - 4
    while position >= 0:
        count = data[position + 4]
        components = data[position + 5 : position + 5 + 2 * count : 2]
        start, end, bits = data[position + 5 + 2 * count : position + 8 + 2 * count]
        if bits & 15 == 0:
            wanted -= {(component, k) for component in components for k in range(start, end + 1)}
        position = data.find(START_OF_SCAN, position + 2)
    return not wanted


def _header(data: bytes) -> tuple[defaultdict[int, bytes], int]:
    """Return the segments up to the coded pixels, by their markers, and where the pixels begin: -1 if nowhere."""
    segments: defaultdict[int, bytes] = defaultdict(bytes)
    position = len(START)
    while segment := _SEGMENT.match(data, position):
        marker, position = segment[1][0], segment.start(2) + int.from_bytes(segment[2], "big")
        segments[marker] += data[segment.end() : position]
        if marker == START_OF_SCAN[1]:
            return segments, position
    return segments, -1
