"""Anyone's images: a folder of them, in natural order (file2 before file10).

The folder looks like this::

    my_panoramas/
      img_0001.png                   *.png, *.jpg, *.jpeg, *.bmp, upper or lower case
      ...
      poses.csv                      optional, see `omnieval.datasets.poses`
      camera.toml                    optional, see `omnieval.datasets.camera_file`

Without ``camera.toml`` the aspect ratio of the images decides what they are. Subfolders are not read.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from omnieval.datasets.camera_file import CAMERA_FILE, parse_camera
from omnieval.datasets.poses import POSES_FILE, Capture, file_key, scan_poses, wrapped
from omnieval.datasets.scan import (
    ROOT,
    Finding,
    Scan,
    canonical_path,
    has_image_suffix,
    missing_folder,
    name_faults,
    pose_remark,
    time_remarks,
    visible_names,
)
from omnieval.datasets.sequence import Camera, Frame, Pose, Sequence
from omnieval.errors import DatasetError
from omnieval.wording import safe_name, shown

_NO_CAPTURE = Capture(line=0, pose=None, room=None, time_ns=None)


def read_folder(path: str | Path) -> Sequence:
    """Read the images in folder `path` as a sequence; only names, poses and camera are read.

    Raises
    ------
    DatasetError
        If there is no image, or ``poses.csv`` or ``camera.toml`` is wrong.
    """
    return scan_folder(path).sequence()


def scan_folder(path: str | Path) -> Scan:
    """Read as much of the folder as can be understood, and note every fault."""
    root = canonical_path(path)
    base = Scan(safe_name(root.name), f"folder:{root}", root)
    fault = missing_folder(root)
    if fault:
        return replace(base, faults=(fault,))
    names = sorted(filter(has_image_suffix, visible_names(root)), key=natural_key)
    captures, faults, remarks = _read_poses(root)
    camera, camera_faults = _read_camera(root)
    faults += camera_faults + name_faults(names)
    if not names:
        message = "no image (png, jpg, jpeg, bmp) in it; name the folder that holds them"
        faults.insert(0, Finding("error", "empty", ROOT, message))
    frames = tuple(_frame(root, name, (captures or {}).get(file_key(name), _NO_CAPTURE)) for name in names)
    if captures is not None:
        remarks += _match_remarks(names, captures) + _pose_remarks(captures) + time_remarks(frames)
    return replace(base, frames=frames, camera=camera, faults=tuple(faults), remarks=tuple(remarks))


def natural_key(name: str) -> tuple[list[str | int], str]:
    """Return the key that sorts numbers within names by value, whatever their case."""
    pieces = re.split(r"([0-9]+)", name.casefold())
    return [int(piece) if index % 2 else piece for index, piece in enumerate(pieces)], name


def _frame(root: Path, name: str, capture: Capture) -> Frame:
    pose = capture.pose
    if pose is not None:
        pose = Pose(pose.x, pose.y, wrapped(pose.yaw))
    return Frame(root / name, name, capture.time_ns, pose, capture.room)


def _read_poses(root: Path) -> tuple[dict[str, Capture] | None, list[Finding], list[Finding]]:
    """Return rows (None without a readable file), faults and remarks."""
    path = root / POSES_FILE
    if not path.exists():
        return None, [], [Finding("info", "no-poses", POSES_FILE, "not there; position metrics will be null")]
    try:
        text = _read_text(path)
    except DatasetError as error:
        return None, [Finding("error", "unreadable-poses", POSES_FILE, str(error))], []
    captures, faults = scan_poses(text)
    return (captures if captures or not faults else None), faults, []


def _read_camera(root: Path) -> tuple[Camera, list[Finding]]:
    path = root / CAMERA_FILE
    if not path.exists():
        return Camera(), []
    try:
        return parse_camera(_read_text(path)), []
    except DatasetError as error:
        return Camera(), [Finding("error", "bad-camera", CAMERA_FILE, str(error))]


def _read_text(path: Path) -> str:
    try:
        return path.read_bytes().decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise DatasetError("not UTF-8 text; save it as UTF-8") from error
    except OSError as error:
        raise DatasetError(f"cannot be read: {error.strerror or error}") from error


def _match_remarks(names: list[str], captures: Mapping[str, Capture]) -> list[Finding]:
    present = {file_key(name) for name in names}
    missing = [
        Finding("error", "missing-image", shown(name), f"named in {POSES_FILE}:{capture.line} but not there")
        for name, capture in captures.items()
        if name not in present
    ]
    poseless = [
        Finding("warning", "image-without-pose", shown(name), f"no pose in {POSES_FILE}")
        for name in names
        if captures.get(file_key(name), _NO_CAPTURE).pose is None
    ]
    return missing + poseless


def _pose_remarks(captures: Mapping[str, Capture]) -> list[Finding]:
    remarks = [
        pose_remark(capture.pose, f"{POSES_FILE}:{capture.line}", largest_yaw=math.tau)
        for capture in captures.values()
        if capture.pose is not None
    ]
    return [remark for remark in remarks if remark is not None]
