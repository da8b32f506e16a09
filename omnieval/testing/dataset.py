"""The contract of datasets: what a reader must hand on."""

from __future__ import annotations

import math
from collections.abc import Callable
from collections.abc import Sequence as Listing
from itertools import pairwise
from pathlib import PurePosixPath

import numpy as np

from omnieval.datasets import load as load_source
from omnieval.datasets.sequence import Frame, Sequence
from omnieval.errors import DatasetError
from omnieval.testing.contract import require, same

_FRAMES_READ = 8
"""Images of a sequence that are read; a sequence may have thousands."""


def check_dataset(sequence: Sequence, *, load: Callable[[str], Sequence] = load_source) -> None:
    """Check that a sequence keeps the contract of datasets.

    - `name` is a plain file name; there are frames.
    - `file` of every frame is unique and relative, with ``/`` as separator and without ``..``.
    - Times, where known, are whole nanoseconds and do not go backwards; poses, where known, are finite, with yaw in
      (-pi, pi]; rooms, where known, are not empty.
    - `read` gives the bytes of an image, the same twice (a few frames, the first and the last among them).
    - `cut` keeps order and calibration frames, says what it did, and refuses to leave nothing.
    - `source` loads the same sequence again.

    Parameters
    ----------
    sequence
        The sequence under test.
    load
        What loads a source; give your own for a scheme that omnieval does not know.

    Raises
    ------
    AssertionError
        At the first clause that does not hold.
    """
    name = sequence.name
    plain = bool(name) and not set(name) & set("/\\\0") and name not in {".", ".."}
    require(plain, f"the sequence's name must be a plain file name, got {name!r}")
    require(len(sequence.frames) > 0, "the sequence has no frames")
    _check_names(sequence.frames)
    for frame in sequence.frames:
        _check_labels(frame)
    _check_times(sequence.frames)
    for index in sorted({round(i) for i in np.linspace(0, len(sequence) - 1, _FRAMES_READ)}):
        _check_reading(sequence.frames[index])
    whole = load(sequence.source)
    require(
        whole.name == name and same(_cut_again(whole, sequence).frames, sequence.frames),
        f"source {sequence.source!r} must load the same sequence again, but its name or frames differ",
    )
    _check_cut(sequence, whole)


def _cut_again(whole: Sequence, part: Sequence) -> Sequence:
    start, stride, limit = part.cut_from
    return whole.cut(start=start, stride=stride, limit=limit)


def _check_names(frames: Listing[Frame]) -> None:
    seen: set[str] = set()
    for frame in frames:
        file = PurePosixPath(frame.file)
        require(
            bool(frame.file) and "\\" not in frame.file and not file.is_absolute() and ".." not in file.parts,
            f"a frame's file must be relative to the sequence, with / as separator, got {frame.file!r}",
        )
        require(frame.file not in seen, f"frames must have unique files, but {frame.file!r} occurs twice")
        seen.add(frame.file)


def _check_labels(frame: Frame) -> None:
    pose = frame.pose
    if pose is not None:
        finite = math.isfinite(pose.x) and math.isfinite(pose.y)
        require(finite, f"{frame.file}: a position must be finite, or the pose None, got {pose}")
        require(
            math.isnan(pose.yaw) or -math.pi < pose.yaw <= math.pi,
            f"{frame.file}: yaw must lie in (-pi, pi], got {pose.yaw}",
        )
    require(frame.room != "", f"{frame.file}: an unknown room must be None, not empty")


def _check_times(frames: Listing[Frame]) -> None:
    known = [frame for frame in frames if frame.time_ns is not None]
    for frame in known:
        require(isinstance(frame.time_ns, int), f"{frame.file}: time_ns must be an int, got {frame.time_ns!r}")
    for earlier, later in pairwise(known):
        require(
            (earlier.time_ns or 0) <= (later.time_ns or 0),
            f"frames must be in the order of capture, but {later.file!r} is earlier than {earlier.file!r} before it",
        )


def _check_reading(frame: Frame) -> None:
    data = frame.read()
    require(isinstance(data, bytes) and bool(data), f"{frame.file}: read must give the bytes of an image")
    require(frame.read() == data, f"{frame.file}: read must give the same bytes twice")


def _check_cut(sequence: Sequence, whole: Sequence) -> None:
    count = len(sequence)
    start, stride, limit = min(1, count - 1), 2, max(1, count // 3)
    part = sequence.cut(start=start, stride=stride, limit=limit)
    asked = f"cut(start={start}, stride={stride}, limit={limit})"
    require(
        same(part.frames, sequence.frames[start::stride][:limit]), f"{asked} must keep those frames, in their order"
    )
    require(
        same(_cut_again(whole, part).frames, part.frames),
        f"{asked} must say in cut_from what it leaves of the whole, got {part.cut_from}",
    )
    require(same(part.calibration, sequence.calibration), f"{asked} must keep the frames the camera is estimated from")
    try:
        sequence.cut(start=count)
    except DatasetError:
        return
    raise AssertionError(f"cut(start={count}) leaves no frame and must raise DatasetError")
