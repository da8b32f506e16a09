"""Descriptions as a NumPy archive (``.npz``), for use elsewhere and for descriptors computed elsewhere.

Arrays, n images: `position` (n, d) and `orientation` (n, cells, bins), floating point; `file` or `files` (n,) text;
optional `xy` (n, 2) metres and `yaw` (n,) radians (NaN where unknown), `room` or `rooms` (n,) text (empty where
unknown), `time_ns` (n,) int64. Nothing in an archive is ever executed: pickled objects are refused.

Of a long sequence that is mapped, orientation descriptors, nearly all of an archive, stay in the file where they are
stored as they are used (single precision, not compressed): the file is mapped into memory.
"""

from __future__ import annotations

import io
import lzma
import math
import mmap
import struct
import zipfile
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from omnieval.datasets.sequence import Frame, Pose
from omnieval.descriptors.description import Description
from omnieval.errors import DatasetError
from omnieval.wording import shown

_ARRAYS = {
    "position": ("position",),
    "orientation": ("orientation",),
    "file": ("file", "files"),
    "xy": ("xy",),
    "yaw": ("yaw",),
    "room": ("room", "rooms"),
    "time_ns": ("time_ns",),
}
"""The spellings of every array; `numpy.savez` takes no array called ``file``."""
_KINDS = {"f": "floating point", "i": "whole numbers with a sign", "U": "text"}
_MOST_NAMED = 8
_UNREADABLE = (
    OSError,
    ValueError,
    EOFError,
    LookupError,
    MemoryError,
    OverflowError,
    RuntimeError,
    SyntaxError,
    TypeError,
    zipfile.BadZipFile,
    zlib.error,
    lzma.LZMAError,
)
"""What `zipfile` and `numpy` raise, according to where a file is damaged."""
WORTH_MAPPING = 1 << 28
"""Bytes from which an array may stay in its file: who writes to a mapped file ends the process that reads it."""
_CHUNK = 1 << 22
"""Bytes to check at once."""
_LOCAL = struct.Struct("<26xHH")
"""What comes before the content of a file in an archive, with the lengths of its name and of what follows that."""


@dataclass(frozen=True)
class Archive:
    """The descriptions of a sequence and what is known of its frames.

    Attributes
    ----------
    frames
        The n frames; their images need not exist.
    position
        Shape (n, d), float32.
    orientation
        Shape (n, cells, bins), float32; of a file that is mapped it cannot be written to.
    mapped
        The file, if it is mapped.
    """

    frames: tuple[Frame, ...]
    position: NDArray[np.float32]
    orientation: NDArray[np.float32]
    mapped: mmap.mmap | None = None

    def release(self) -> None:
        """Let go of the memory that parts of a mapped file are in; they are read again when they are used."""
        if self.mapped is not None and hasattr(mmap, "MADV_DONTNEED"):
            self.mapped.madvise(mmap.MADV_DONTNEED)

    def description(self, index: int) -> Description:
        """Return the description of one frame."""
        return Description(self.position[index], self.orientation[index])


def save_archive(
    file: Path, frames: Sequence[Frame], position: NDArray[np.float32], orientation: NDArray[np.float32]
) -> None:
    """Write an archive to exactly `file`."""
    poses = [frame.pose or Pose(np.nan, np.nan, np.nan) for frame in frames]
    arrays: dict[str, NDArray[Any]] = {
        "position": position,
        "orientation": orientation,
        "file": np.array([frame.file for frame in frames], np.str_),
        "xy": np.array([[pose.x, pose.y] for pose in poses]),
        "yaw": np.array([pose.yaw for pose in poses]),
        "room": np.array([frame.room or "" for frame in frames], np.str_),
    }
    if all(frame.time_ns is not None for frame in frames):
        arrays["time_ns"] = np.array([frame.time_ns for frame in frames], np.int64)
    # np.savez cannot write an array called `file`: that is the name of its first parameter.
    with zipfile.ZipFile(file, "w", allowZip64=True) as archive:
        for name, array in arrays.items():
            with archive.open(f"{name}.npy", "w", force_zip64=True) as stream:
                np.lib.format.write_array(stream, np.ascontiguousarray(array), allow_pickle=False)


def load_archive(file: Path, *, may_map: bool = False) -> Archive:
    """Read an archive, checking every array's shape, type and values.

    Parameters
    ----------
    file
        The archive.
    may_map
        Whether orientation descriptors may stay in a large file, which must then not be written to.

    Raises
    ------
    DatasetError
        One line that says which array is wrong and how.
    """
    arrays, mapped = _read_arrays(file, may_map=may_map)
    position = _finite(file, arrays, "position", shape=(None, None))
    count = len(position)
    orientation = _finite(file, arrays, "orientation", shape=(count, None, None))
    names = _text(file, arrays, "file", count)
    rooms = _text(file, arrays, "room", count)
    xy = _optional(file, arrays, "xy", kind="f", shape=(count, 2))
    yaw = _optional(file, arrays, "yaw", kind="f", shape=(count,))
    times = _optional(file, arrays, "time_ns", kind="i", shape=(count,))
    frames = tuple(
        Frame(
            path=file,
            file=str(names[i]) if names is not None else f"{i:06d}",
            time_ns=int(times[i]) if times is not None else None,
            pose=_pose(xy, yaw, i),
            room=(str(rooms[i]) or None) if rooms is not None else None,
        )
        for i in range(count)
    )
    archive = Archive(frames, position, orientation, mapped)
    archive.release()
    return archive


def _read_arrays(file: Path, *, may_map: bool) -> tuple[dict[str, NDArray[Any]], mmap.mmap | None]:
    """Return the arrays that mean something to us, and the file if one of them is mapped.

    Whatever else is in the archive is not even read.
    """
    try:
        if file.is_dir():
            raise DatasetError(
                f"cannot read descriptors {file}: a folder; `omnieval replay {shown(str(file))}` maps images"
            )
        if file.exists() and not file.is_file():  # a device or a pipe would never end
            raise DatasetError(f"cannot read descriptors {file}: not a file; expected a .npz archive")
        with zipfile.ZipFile(file) as archive:
            listed = archive.namelist()
            spelt = {one: name for name, spellings in _ARRAYS.items() for one in spellings if f"{one}.npy" in listed}
            missing = [name for name in ("position", "orientation") if name not in spelt.values()]
            if missing:
                there = ", ".join(shown(one.removesuffix(".npy")) for one in sorted(listed)[:_MOST_NAMED]) or "nothing"
                raise DatasetError(
                    f"{file}: no array {missing[0]!r}, it has {there}; position and orientation are needed"
                )
            arrays = {name: _read_array(archive, one) for one, name in spelt.items() if name != "orientation"}
            (orientation,) = (one for one, name in spelt.items() if name == "orientation")
            found = _mapped(file, archive, f"{orientation}.npy") if may_map else None
            arrays["orientation"], mapped = found or (_read_array(archive, orientation), None)
            return arrays, mapped
    except _UNREADABLE as error:
        reason = getattr(error, "strerror", None) or str(error) or type(error).__name__
        raise DatasetError(f"cannot read descriptors {file}: {reason}; expected a .npz archive") from error


def _mapped(file: Path, archive: zipfile.ZipFile, name: str) -> tuple[NDArray[np.float32], mmap.mmap] | None:
    """Return an array that stays in its file, with that file; None if it is small or stored in another way."""
    told = archive.getinfo(name)
    if told.compress_type != zipfile.ZIP_STORED or told.file_size < WORTH_MAPPING:
        return None
    with archive.open(name) as stream:
        version = np.lib.format.read_magic(stream)
        if version not in {(1, 0), (2, 0)}:
            return None
        read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
        shape, fortran, kind = read(stream)
        begins, values = stream.tell(), math.prod(shape)
        if fortran or kind != np.dtype("<f4") or values == 0 or told.file_size != begins + 4 * values:
            return None
        while stream.read(_CHUNK):  # to its end, where its checksum is looked at
            pass
    with file.open("rb") as opened:
        mapped = mmap.mmap(opened.fileno(), 0, access=mmap.ACCESS_READ)
    begins += told.header_offset + _LOCAL.size + sum(_LOCAL.unpack_from(mapped, told.header_offset))
    return np.frombuffer(mapped, "<f4", values, begins).reshape(shape), mapped


def _read_array(archive: zipfile.ZipFile, name: str) -> NDArray[Any]:
    data = archive.read(f"{name}.npy")
    try:
        array: NDArray[Any] = np.lib.format.read_array(io.BytesIO(data), allow_pickle=False)
    except ValueError as error:
        if "allow_pickle" not in str(error):
            raise ValueError(f"array {name!r}: {error}") from error
        raise ValueError(
            f"array {name!r} holds Python objects, which are never read; make it an array of text or of numbers of one "
            "length a row"
        ) from error
    if array.dtype.kind != "S":
        return array
    try:  # text of other programs
        return np.char.decode(array, "utf-8")
    except UnicodeDecodeError as error:
        raise ValueError(f"array {name!r} holds text that is not UTF-8") from error


def _pose(xy: NDArray[Any] | None, yaw: NDArray[Any] | None, index: int) -> Pose | None:
    if xy is None or not np.isfinite(xy[index]).all():
        return None
    heading = float(yaw[index]) if yaw is not None else np.nan
    return Pose(float(xy[index, 0]), float(xy[index, 1]), heading)


def _finite(
    file: Path, arrays: Mapping[str, NDArray[Any]], name: str, *, shape: tuple[int | None, ...]
) -> NDArray[np.float32]:
    array = _checked(file, arrays, name, kind="f", shape=shape)
    with np.errstate(over="ignore"):  # what single precision cannot hold becomes infinite, and is refused
        single = array.astype(np.float32, copy=False)
    rows = max(1, _CHUNK * len(single) // max(1, single.nbytes))
    chunks = [single[first : first + rows] for first in range(0, len(single), rows)]
    whole = np.concatenate([np.isfinite(chunk).reshape(len(chunk), -1).all(axis=1) for chunk in chunks])
    if not whole.all():
        raise DatasetError(
            f"{file}: array {name!r} has NaN or infinite values, first in image {int(whole.argmin())}; "
            "leave such images out of all arrays"
        )
    return single


def _text(file: Path, arrays: Mapping[str, NDArray[Any]], name: str, count: int) -> NDArray[np.str_] | None:
    array = _optional(file, arrays, name, kind="U", shape=(count,))
    for index, text in enumerate(array if array is not None else ()):
        if any("\ud800" <= letter <= "\udfff" for letter in text):
            raise DatasetError(
                f"{file}: array {name!r} is not valid Unicode in image {index}, so no table can hold it; rename it"
            )
    return array


def _optional(
    file: Path, arrays: Mapping[str, NDArray[Any]], name: str, *, kind: str, shape: tuple[int | None, ...]
) -> NDArray[Any] | None:
    return _checked(file, arrays, name, kind=kind, shape=shape) if name in arrays else None


def _checked(
    file: Path, arrays: Mapping[str, NDArray[Any]], name: str, *, kind: str, shape: tuple[int | None, ...]
) -> NDArray[Any]:
    array = arrays[name]
    fits = array.ndim == len(shape) and all(want in (None, got) for want, got in zip(shape, array.shape, strict=True))
    if not fits or 0 in array.shape:
        expected = "(" + ", ".join("n" if want is None else str(want) for want in shape) + ")"
        raise DatasetError(f"{file}: array {name!r} must have shape {expected} and no axis of 0, got {array.shape}")
    if array.dtype.kind != kind:
        raise DatasetError(f"{file}: array {name!r} must be {_KINDS[kind]}, got {array.dtype}")
    return array
