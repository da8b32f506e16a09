"""Descriptions as a NumPy archive (``.npz``), for use elsewhere and for descriptors computed elsewhere.

Arrays, n images: `position` (n, d) and `orientation` (n, cells, bins), floating point; `file` (n,) text; optional
`xy` (n, 2) metres and `yaw` (n,) radians (NaN where unknown), `room` (n,) text (empty where unknown), `time_ns`
(n,) int64. Nothing in an archive is ever executed: pickled objects are refused.
"""

from __future__ import annotations

import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from omnieval.datasets.sequence import Frame, Pose
from omnieval.descriptors.description import Description
from omnieval.errors import DatasetError


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
        Shape (n, cells, bins), float32.
    """

    frames: tuple[Frame, ...]
    position: NDArray[np.float32]
    orientation: NDArray[np.float32]

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


def load_archive(file: Path) -> Archive:
    """Read an archive, checking every array's shape, type and values.

    Raises
    ------
    DatasetError
        One line that says which array is wrong and how.
    """
    try:
        with np.load(file, allow_pickle=False) as content:
            arrays = {name: content[name] for name in content.files}
    except (OSError, ValueError, EOFError, zipfile.BadZipFile, AttributeError) as error:
        raise DatasetError(f"cannot read descriptors {file}: {error}; expected a .npz archive") from error
    position = _checked(file, arrays, "position", kinds="f", shape=(None, None))
    count = len(position)
    orientation = _checked(file, arrays, "orientation", kinds="f", shape=(count, None, None))
    names = _optional(file, arrays, "file", kinds="U", shape=(count,))
    xy = _optional(file, arrays, "xy", kinds="f", shape=(count, 2))
    yaw = _optional(file, arrays, "yaw", kinds="f", shape=(count,))
    rooms = _optional(file, arrays, "room", kinds="U", shape=(count,))
    times = _optional(file, arrays, "time_ns", kinds="i", shape=(count,))
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
    return Archive(frames, position.astype(np.float32), orientation.astype(np.float32))


def _pose(xy: NDArray[Any] | None, yaw: NDArray[Any] | None, index: int) -> Pose | None:
    if xy is None or not np.isfinite(xy[index]).all():
        return None
    heading = float(yaw[index]) if yaw is not None else np.nan
    return Pose(float(xy[index, 0]), float(xy[index, 1]), heading)


def _optional(
    file: Path, arrays: Mapping[str, NDArray[Any]], name: str, *, kinds: str, shape: tuple[int | None, ...]
) -> NDArray[Any] | None:
    return _checked(file, arrays, name, kinds=kinds, shape=shape) if name in arrays else None


def _checked(
    file: Path, arrays: Mapping[str, NDArray[Any]], name: str, *, kinds: str, shape: tuple[int | None, ...]
) -> NDArray[Any]:
    if name not in arrays:
        raise DatasetError(f"{file}: no array {name!r}; it has {', '.join(sorted(arrays)) or 'none'}")
    array = arrays[name]
    fits = array.ndim == len(shape) and all(want in (None, got) for want, got in zip(shape, array.shape, strict=True))
    if not fits or 0 in array.shape:
        expected = "(" + ", ".join("n" if want is None else str(want) for want in shape) + ")"
        raise DatasetError(f"{file}: array {name!r} must have shape {expected} and no axis of 0, got {array.shape}")
    if array.dtype.kind not in kinds:
        raise DatasetError(f"{file}: array {name!r} has type {array.dtype}, expected kind {kinds!r}")
    if name in {"position", "orientation"} and not np.isfinite(array).all():
        bad = int(np.flatnonzero(~np.isfinite(array).reshape(len(array), -1).all(axis=1))[0])
        raise DatasetError(f"{file}: array {name!r} has NaN or infinite values, first in image {bad}")
    return array
