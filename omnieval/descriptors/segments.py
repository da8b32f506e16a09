"""Segments of the array store: descriptions of images in arrays on disk, each filled by one process alone.

A segment is three files of one name, which only ever grow:

NAME.position     a row of float32 an image, its position descriptor
NAME.orientation  the same of its orientation descriptor
NAME.index        64 bytes that say the shape, then 48 bytes an entry: what tells the image's file and its state (16),
                  digest of the image's bytes (16), row (8; -1: that of another entry of the same image), checksum (8)

An entry is written after its row. So whatever kills a process, what is whole can be read, and what is torn has no
entry, or one that its checksum denies. No reader needs a lock, and no two processes write one file.
"""

from __future__ import annotations

import hashlib
import mmap
import os
import struct
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass
from io import FileIO
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from omnieval.datasets.cachedir import hold
from omnieval.descriptors.description import Description, Place

POSITION, ORIENTATION, INDEX = ENDINGS = (".position", ".orientation", ".index")
"""Endings of the files of a segment, in the order in which they are made. The first is the one that is held."""
LINK = -1
"""The row of an entry that says of a file only which image it is."""
_HEADER = 64
_MAGIC = "omnieval descriptions 1"
_ENTRY = struct.Struct("<16s16sq8s")
_ENTRIES = np.dtype([("file", "V16"), ("head", "<u8"), ("rest", "<u8"), ("row", "<i8"), ("check", "V8")])
"""The same; `head` and `rest` are the digest of the image."""


class Entry(NamedTuple):
    """One entry of the index, as described above."""

    file: bytes
    image: bytes
    row: int
    check: bytes


@dataclass(frozen=True)
class Shape:
    """Of the descriptions of a segment: values of the position, cells and bins of the orientation descriptor."""

    position: int
    cells: int
    bins: int

    @classmethod
    def of(cls, description: Description) -> Shape | None:
        """Return the shape of a description; None if it has no values, or too many axes, and cannot be kept."""
        axes = description.position.shape + description.orientation.shape
        return cls(*axes) if len(axes) == 3 and description.position.ndim == 1 and 0 not in axes else None

    @property
    def header(self) -> bytes:
        """The first bytes of an index."""
        text = f"{_MAGIC} {self.position} {self.cells} {self.bins}"
        return text.encode().ljust(_HEADER - 1) + b"\n"

    @classmethod
    def read(cls, header: bytes) -> Shape | None:
        """Return the shape that an index begins with; None if it does not."""
        text = header.decode("ascii", "replace")
        numbers = text.removeprefix(_MAGIC).split()
        if not text.startswith(f"{_MAGIC} ") or len(numbers) != 3 or not all(map(str.isdigit, numbers)):
            return None
        shape = cls(*map(int, numbers))
        return shape if shape.header == header else None

    @property
    def row_bytes(self) -> tuple[int, int]:
        """Bytes of a row of position and orientation."""
        return 4 * self.position, 4 * self.cells * self.bins


def checksum(key: str, shape: Shape, file: bytes, image: bytes, row: int, *rows: bytes) -> bytes:
    """Return the checksum of an entry and of its row, for the segments of a key."""
    content = hashlib.blake2b(shape.header, digest_size=8, key=key.encode()[:64])
    content.update(_ENTRY.pack(file, image, row, b""))
    for values in rows:
        content.update(values)
    return content.digest()


class Segment:
    """A segment that is read, while it may still grow.

    Parameters
    ----------
    path
        Of its files, without ending.
    key
        Of the folder it is in; see `checksum`.

    Attributes
    ----------
    shape
        Of the descriptions; None before `news`, and if the index does not tell.
    """

    def __init__(self, path: Path, key: str) -> None:
        self.path = path
        self._key = key
        self.shape: Shape | None = None
        self._read = 0
        self._streams: tuple[FileIO, FileIO] | None = None

    @property
    def is_open(self) -> bool:
        """Whether it keeps files open."""
        return self._streams is not None

    @property
    def exists(self) -> bool:
        """Whether its files are there."""
        return file_of(self.path, INDEX).exists()

    def news(self) -> list[Entry]:
        """Return the entries that were added since this was last asked; none if it cannot be read."""
        index = file_of(self.path, INDEX)
        try:
            if index.stat().st_size < self._read + _ENTRY.size:
                return []
            with index.open("rb", buffering=0) as stream:
                stream.seek(self._read)
                data = stream.readall()
        except OSError:  # removed since it was listed
            return []
        if self._read == 0:
            self.shape = Shape.read(data[:_HEADER])
            if self.shape is None:
                return []
            data, self._read = data[_HEADER:], _HEADER
        whole = len(data) - len(data) % _ENTRY.size
        self._read += whole
        return [Entry(*fields) for fields in _ENTRY.iter_unpack(data[:whole])]

    def description(self, entry: Entry) -> Description | None:
        """Return the description of an entry; None if it cannot be read, or is not what was written."""
        assert self.shape is not None
        try:
            values = [
                _read_at(stream, entry.row * size, size)
                for stream, size in zip(self._open(), self.shape.row_bytes, strict=True)
            ]
        except (OSError, OverflowError):
            return None
        if not self.vouches(entry, *values):
            return None
        position, orientation = (np.frombuffer(one, "<f4").astype(np.float32) for one in values)
        return Description(position, orientation.reshape(self.shape.cells, self.shape.bins))

    def vouches(self, entry: Entry, *values: bytes) -> bool:
        """Whether an entry, and the values of its row, are what was written."""
        shape = self.shape
        return shape is not None and checksum(self._key, shape, *entry[:3], *values) == entry.check

    def close(self) -> None:
        """Close its files; they are opened again when they are needed."""
        for stream in self._streams or ():
            stream.close()
        self._streams = None

    def _open(self) -> tuple[FileIO, FileIO]:
        if self._streams is None:
            position = file_of(self.path, POSITION).open("rb", buffering=0)
            hold(position.fileno())
            try:
                self._streams = position, file_of(self.path, ORIENTATION).open("rb", buffering=0)
            except OSError:
                position.close()
                raise
        return self._streams


class SegmentsOfImages:
    """Which of many segments may have the description of an image: a few bytes an image, read once.

    Parameters
    ----------
    segments
        Their paths, without ending; what is written to them later is not seen.
    """

    def __init__(self, segments: Iterable[Path]) -> None:
        self._names: list[str] = []
        heads, numbers = [np.zeros(0, np.uint64)], [np.zeros(0, np.int32)]
        for segment in segments:
            try:
                data = file_of(segment, INDEX).read_bytes()[_HEADER:]
            except OSError:  # removed since it was listed
                continue
            entries = np.frombuffer(data[: len(data) - len(data) % _ENTRY.size], _ENTRIES)
            heads.append(entries["head"][entries["row"] != LINK])
            numbers.append(np.full(len(heads[-1]), len(self._names), np.int32))
            self._names.append(segment.name)
        every = np.concatenate(heads)
        order = np.argsort(every, kind="stable")
        self._heads, self._numbers = every[order], np.concatenate(numbers)[order]

    def of(self, image: bytes) -> list[str]:
        """Return the names of the segments."""
        head = np.frombuffer(image, "<u8", 1)
        first, last = (int(np.searchsorted(self._heads, head, side)[0]) for side in ("left", "right"))
        return [self._names[number] for number in self._numbers[first:last]]


class Filler:
    """A segment that only this process writes.

    What fails is done again from its beginning: rows and entries have their places in the files, whatever was written
    there before.

    Parameters
    ----------
    path
        Of its files, without ending; they appear with the first `flush`.
    key
        Of the folder it is in; see `checksum`.
    shape
        Of the descriptions.

    Attributes
    ----------
    kept
        How many rows are on disk, with their entries.
    """

    def __init__(self, path: Path, key: str, shape: Shape) -> None:
        self.path = path
        self.shape = shape
        self.kept = 0
        self._key = key
        self._entries = 0
        self._rows: list[tuple[bytes, bytes]] = []
        self._pending: list[bytes] = []
        self._streams: list[FileIO] = []

    def add(self, file: bytes, image: bytes, description: Description) -> Place:
        """Have a description kept with the next `flush`, and return where."""
        values = (description.position.astype("<f4").tobytes(), description.orientation.astype("<f4").tobytes())
        row = self.kept + len(self._rows)
        self._rows.append(values)
        self._enter(file, image, row, *values)
        return Place(str(self.path), row)

    def link(self, file: bytes, image: bytes) -> None:
        """Have it noted with the next `flush` that a file is an image whose description is kept already."""
        self._enter(file, image, LINK)

    def flush(self) -> bool:
        """Write what is pending; say whether anything was.

        Raises
        ------
        OSError
            If it cannot be written.
        """
        if not self._pending:
            return False
        if len(self._streams) < len(ENDINGS):
            self._create()
        for part, size in enumerate(self.shape.row_bytes):
            _write_at(self._streams[part], self.kept * size, b"".join(row[part] for row in self._rows))
        _write_at(self._streams[-1], _HEADER + self._entries * _ENTRY.size, b"".join(self._pending))
        self.kept += len(self._rows)
        self._entries += len(self._pending)
        self._rows, self._pending = [], []
        return True

    def close(self) -> None:
        """Close the files; what is pending is not written."""
        for stream in self._streams:
            with suppress(OSError):
                stream.close()
        self._streams = []

    def _enter(self, file: bytes, image: bytes, row: int, *values: bytes) -> None:
        self._pending.append(_ENTRY.pack(file, image, row, checksum(self._key, self.shape, file, image, row, *values)))

    def _create(self) -> None:
        self.path.parent.mkdir(parents=True, exist_ok=True)
        for ending in ENDINGS[len(self._streams) :]:
            self._streams.append(file_of(self.path, ending).open("xb", buffering=0))
            if ending == POSITION:
                hold(self._streams[-1].fileno())
        _write_at(self._streams[-1], 0, self.shape.header)


def file_of(segment: Path, ending: str) -> Path:
    """Return a file of a segment."""
    return segment.with_name(segment.name + ending)


def mapped(segment: Path, shape: Shape) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return all rows of a segment, memory-mapped: shapes (rows, d) and (rows, cells, bins), float32, read-only.

    The segment is held as long as they are.

    Raises
    ------
    OSError
        If it cannot be mapped.
    """
    arrays = []
    for ending, size in zip((POSITION, ORIENTATION), shape.row_bytes, strict=True):
        with file_of(segment, ending).open("rb", buffering=0) as stream:
            if ending == POSITION:
                hold(stream.fileno())
            rows = os.fstat(stream.fileno()).st_size // size
            # The map has the file open for itself, and with it what holds the file.
            whole = mmap.mmap(stream.fileno(), rows * size, access=mmap.ACCESS_READ) if rows else b""
        arrays.append(np.frombuffer(whole, "<f4").reshape(rows, size // 4))
    position, orientation = arrays
    return position, orientation.reshape(len(orientation), shape.cells, shape.bins)


def rows_of(segment: Path) -> int | None:
    """Return how many descriptions a segment has; None if it is damaged.

    Only what can be told without reading the descriptions is looked at.
    """
    try:
        with open(file_of(segment, INDEX), "rb", opener=_unnoticed) as stream:
            shape = Shape.read(stream.read(_HEADER))
            entries = stream.read()
        rows = {row for *_, row, _ in _ENTRY.iter_unpack(entries[: len(entries) - len(entries) % _ENTRY.size])}
        sizes = [file_of(segment, ending).stat().st_size for ending in (POSITION, ORIENTATION)]
    except OSError:
        return None
    rows.discard(LINK)
    if shape is None or any(
        (max(rows, default=-1) + 1) * row > size for row, size in zip(shape.row_bytes, sizes, strict=True)
    ):
        return None
    return len(rows)


def _unnoticed(path: str, flags: int) -> int:
    """Open a file without noting when it was last read, where that may be left out."""
    with suppress(OSError):
        return os.open(path, flags | getattr(os, "O_NOATIME", 0))
    return os.open(path, flags)


def _read_at(stream: FileIO, offset: int, size: int) -> bytes:
    stream.seek(offset)
    return stream.read(size) or b""


def _write_at(stream: FileIO, offset: int, data: bytes) -> None:
    stream.seek(offset)
    left = memoryview(data)
    while left:
        left = left[stream.write(left) or 0 :]
