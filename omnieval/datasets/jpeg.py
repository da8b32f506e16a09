"""Is a JPEG file whole? As far as its bytes tell without being decoded (ITU-T T.81, Annex B).

Nothing in a JPEG guards the pixels, so that one with a single other bit cannot be told from a sound one. But coded
pixels have a form that what overwrites them seldom has: a byte 0xFF is followed by 0x00 or a marker that makes sense,
restart markers count on, and there are no long runs of zeros.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

START = b"\xff\xd8"
_END = 0xD9
_START_OF_SCAN = 0xDA
_RESTART_INTERVAL = 0xDD
_HUFFMAN_TABLES = 0xC4
_STANDALONE = frozenset({0x01, *range(0xD0, 0xD8)})
"""Markers without a length: TEM and the restart markers."""
_START_OF_FRAME = frozenset({*range(0xC0, 0xD0)} - {0xC4, 0xC8, 0xCC})
_SEQUENTIAL_HUFFMAN = frozenset({0xC0, 0xC1})
_BETWEEN_SCANS = frozenset({0xC4, 0xCC, _START_OF_SCAN, 0xDB, 0xDC, _RESTART_INTERVAL, *range(0xE0, 0xF0), 0xFE})
"""Tables, comments and application data, any of which may stand between two scans."""
_MARKER = re.compile(rb"\xff[^\x00\xff\xd0-\xd7]")
"""One that does not stand within coded pixels."""
_RESTART = re.compile(rb"\xff[\xd0-\xd7]")
_ZEROS = bytes(128)
_END_OF_BLOCK = 0


def size_of(data: bytes) -> tuple[int, int]:
    """Return (width, height) in pixels as the header says, zeros if it does not."""
    frame = next((start for marker, start, _ in _header(data) if marker in _START_OF_FRAME), len(data))
    return int.from_bytes(data[frame + 5 : frame + 7], "big"), int.from_bytes(data[frame + 3 : frame + 5], "big")


def is_cut_short(data: bytes) -> bool:
    """Tell whether a file lacks its end.

    An end-of-image marker counts only behind the header: the thumbnail in it has one of its own.
    """
    scan = next((end for marker, _, end in _header(data) if marker == _START_OF_SCAN), None)
    return scan is None or data.rfind(bytes((0xFF, _END)), scan) < 0


def is_overwritten(data: bytes) -> bool:
    """Tell whether the coded pixels cannot be what an encoder wrote.

    Finds 512 bytes of foreign data nearly always, of zeros where the Huffman tables leave no doubt, and single bytes
    seldom. What is looked for is nothing that an encoder writes, so that a sound file is not taken for a damaged one.
    """
    position, behind_pixels = len(START), False
    restarting = sequential = False
    ends_by_zeros: dict[int, bool] = {}
    while segment := _segment_at(data, position):
        marker, start, end = segment
        if marker == _END:
            return False
        if behind_pixels and marker not in _BETWEEN_SCANS:
            return True
        if marker == _RESTART_INTERVAL:
            restarting = any(data[start + 2 : end])
        sequential = sequential or marker in _SEQUENTIAL_HUFFMAN
        if marker == _HUFFMAN_TABLES:
            ends_by_zeros |= _zeros_end_blocks(data[start + 2 : end])
        position = end
        if marker == _START_OF_SCAN:
            behind_pixels, position = True, _end_of_pixels(data, end)
            zeros_are_pixels = all(ends_by_zeros.get(table, True) for table in _ac_tables(data[start + 2 : end]))
            if sequential and not zeros_are_pixels and data.find(_ZEROS, end, position) >= 0:
                return True
            if not _counts_on(_RESTART.findall(data, end, position), restarting=restarting):
                return True
    return behind_pixels  # where no marker stands, nor the end of the image


def _end_of_pixels(data: bytes, start: int) -> int:
    """Return where the coded pixels end that begin at `start`: at the next marker that does not belong to them."""
    marker = _MARKER.search(data, start)
    return marker.start() if marker else len(data)


def _counts_on(restarts: list[bytes], *, restarting: bool) -> bool:
    """Whether restart markers are there only if they may be, and count from 0 to 7 again and again."""
    if not restarting:
        return not restarts
    return all(marker[1] == 0xD0 + number % 8 for number, marker in enumerate(restarts))


def _zeros_end_blocks(tables: bytes) -> dict[int, bool]:
    """Tell of each Huffman table for AC coefficients, by its number, whether zeros are its code for the end of a block.

    If they are, zeros may be what a flat part of the image is coded as. Codes are given out in order, the first is all
    zeros.
    """
    found, position = {}, 0
    while position + 17 < len(tables):
        symbols = position + 17
        if tables[position] >> 4:
            found[tables[position] & 15] = tables[symbols] == _END_OF_BLOCK
        position = symbols + sum(tables[position + 1 : symbols])
    return found


def _ac_tables(scan_header: bytes) -> set[int]:
    """Return the numbers of the tables for AC coefficients that the components of a scan use, one after another."""
    count = scan_header[0] if scan_header else 0
    return {selector & 15 for selector in scan_header[2 : 2 + 2 * count : 2]}


def _header(data: bytes) -> Iterator[tuple[int, int, int]]:
    """Yield marker, start and end of the segments up to the coded pixels, as far as they are there."""
    position = len(START)
    while segment := _segment_at(data, position):
        yield segment
        position = segment[2]
        if segment[0] == _START_OF_SCAN:
            return


def _segment_at(data: bytes, position: int) -> tuple[int, int, int] | None:
    """Return marker, start of what follows it (its length first) and end of the segment there; None if there is none.

    Markers may be preceded by any number of bytes 0xFF.
    """
    while data[position : position + 2] == b"\xff\xff":
        position += 1
    if position + 2 > len(data) or data[position] != 0xFF:
        return None
    marker, start = data[position + 1], position + 2
    if marker in _STANDALONE or marker == _END:
        return marker, start, start
    length = int.from_bytes(data[start : start + 2], "big")
    return (marker, start, start + length) if start + 2 <= len(data) else None
