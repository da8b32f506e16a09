"""Where the images of a stream are kept once they are decoded: a folder in the cache, whole or not there.

A folder is found by the state of the files it was decoded from (size, times of change, inode) and by what was taken
from them; it holds the images and ``index.json``. One process decodes, others wait for it.
"""

from __future__ import annotations

import json
import math
import shutil
import tempfile
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from omnieval.datasets.cachedir import cache_dir, hold_for_good, stream_folder
from omnieval.datasets.findings import Finding
from omnieval.datasets.sequence import Frame, Pose
from omnieval.datasets.source import Address
from omnieval.errors import DatasetError
from omnieval.locks import lock
from omnieval.source_code import digest_of

INDEX = "index.json"
_VERSION = 3
"""Of what is decoded and how: a folder of another version is not looked at."""


@dataclass(frozen=True)
class Contents:
    """What a stream holds.

    Attributes
    ----------
    frames
        Its images, in the order of the stream.
    findings
        What was noticed while it was decoded.
    poses
        Where images were taken, in the same order, where that is what was asked for.
    """

    frames: tuple[Frame, ...] = ()
    findings: tuple[Finding, ...] = ()
    poses: tuple[Pose | None, ...] = ()


def decoded(address: Address, files: Sequence[Path], decode: Callable[[Path], Contents]) -> tuple[Path, Contents]:
    """Return the folder of what is taken from a stream and what it holds, decoding it if that was not done yet.

    Parameters
    ----------
    address
        The stream.
    files
        The files it consists of.
    decode
        Writes the images into a folder that it is given, and says what they are.

    Raises
    ------
    DatasetError
        If the stream cannot be decoded, changes meanwhile, or the cache cannot be written.
    """
    try:
        state = _state(files)
        key = digest_of([_VERSION, address.scheme, dict(address.options), state])
        folder = stream_folder(cache_dir()) / key
        if (contents := _read(folder)) is not None:
            return folder, contents
        folder.parent.mkdir(parents=True, exist_ok=True)
        waiting = folder.with_name(f".{key}.lock")
        waiting.touch()
        with lock(waiting, wait=True) as alone:
            if (contents := _read(folder)) is None:
                contents = _make(folder, decode, certain=alone.certain)
        if _state(files) != state:
            shutil.rmtree(folder, ignore_errors=True)
            raise DatasetError("changed while it was read; wait until its recording has ended")
    except OSError as error:
        raise DatasetError(
            f"its images cannot be kept in the cache {cache_dir()}: {error.strerror or error}; make room, set "
            "OMNIEVAL_CACHE, or take fewer of them (--decode-every N)"
        ) from error
    return folder, contents


def _state(files: Sequence[Path]) -> list[list[int]]:
    """Return what changes when a file does, short of reading it whole."""
    states = [file.stat() for file in files]
    return [[at.st_size, at.st_mtime_ns, at.st_ctime_ns, at.st_ino] for at in states]


def _make(folder: Path, decode: Callable[[Path], Contents], *, certain: bool) -> Contents:
    if certain:  # what is left of processes that were killed
        for rest in folder.parent.glob(f".{folder.name}-*"):
            shutil.rmtree(rest, ignore_errors=True)
        shutil.rmtree(folder, ignore_errors=True)  # it is there, but cannot be read
    with tempfile.TemporaryDirectory(prefix=f".{folder.name}-", dir=folder.parent) as scratch:
        draft = Path(scratch) / "images"
        draft.mkdir()
        contents = decode(draft)
        (draft / INDEX).write_text(_index(contents), encoding="utf-8")
        with suppress(OSError):  # without locks another process may have been faster; both have the same images
            draft.replace(folder)
    found = _read(folder)
    if found is None:
        raise OSError(f"{folder} cannot be written")
    return found


def _index(contents: Contents) -> str:
    frames = [[frame.file, frame.time_ns] for frame in contents.frames]
    findings = [[found.severity, found.code, found.where, found.message] for found in contents.findings]
    poses = list(map(_numbers, contents.poses))
    return json.dumps({"frames": frames, "findings": findings, "poses": poses}, allow_nan=False)


def _numbers(pose: Pose | None) -> list[float | None] | None:
    """Return a pose as JSON can hold it: a yaw that is not known is null."""
    return None if pose is None else [pose.x, pose.y, pose.yaw if math.isfinite(pose.yaw) else None]


def _pose(numbers: list[float | None] | None) -> Pose | None:
    return None if numbers is None else Pose(*(math.nan if number is None else number for number in numbers))


def _read(folder: Path) -> Contents | None:
    """Return what a folder holds; None if it is not there, or not whole any more. It stays as long as this process."""
    if not hold_for_good(folder / INDEX):
        return None
    try:
        index = json.loads((folder / INDEX).read_text("utf-8"))
        there = {path.name for path in folder.iterdir()}
        frames = tuple(Frame(folder / file, file, time_ns) for file, time_ns in index["frames"])
        findings = tuple(Finding(*one) for one in index["findings"])
        poses = tuple(map(_pose, index["poses"]))
    except (OSError, ValueError, KeyError, TypeError):
        return None
    return Contents(frames, findings, poses) if there.issuperset(frame.file for frame in frames) else None
