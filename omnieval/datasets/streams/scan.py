"""A stream as a sequence: its images in the cache, its name and faults those of the file."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from omnieval.datasets.cards import CAMERA_FILE, parse_camera
from omnieval.datasets.findings import ROOT, Finding
from omnieval.datasets.scan import Scan, exists, in_time, pose_remarks, read_text
from omnieval.datasets.sequence import Pose
from omnieval.datasets.source import Address
from omnieval.datasets.streams.store import Contents, decoded
from omnieval.errors import DatasetError
from omnieval.wording import safe_name


def scan_stream(address: Address, files: Sequence[Path], decode: Callable[[Path], Contents]) -> Scan:
    """Return the sequence in a stream, decoding it if need be; a ``camera.toml`` beside it tells its camera.

    Parameters
    ----------
    address
        The stream.
    files
        The files it consists of.
    decode
        See `store.decoded`. What it raises does not name the stream.
    """
    base = Scan(safe_name(address.path.stem), address.source, address.path)
    if not exists(address.path):
        return replace(base, findings=(Finding("error", "missing-file", ROOT, "no such file; check the path"),))
    try:
        folder, contents = decoded(address, files, decode)
        camera_file = address.path.parent / CAMERA_FILE
        camera = parse_camera(read_text(camera_file)) if exists(camera_file) else base.camera
    except DatasetError as error:
        return replace(base, findings=(Finding("error", "unreadable-stream", ROOT, str(error)),))
    frames, remarks = in_time(contents.frames)
    poses = ((frame.file, frame.pose and _with_yaw(frame.pose)) for frame in frames)
    remarks += pose_remarks(poses, largest_yaw=math.pi)
    return replace(base, root=folder, frames=tuple(frames), camera=camera, findings=(*contents.findings, *remarks))


def _with_yaw(pose: Pose) -> Pose:
    """Return a pose of which nothing is odd only because its yaw is not known."""
    return replace(pose, yaw=0.0) if math.isnan(pose.yaw) else pose
