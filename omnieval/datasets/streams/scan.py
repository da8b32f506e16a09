"""A stream as a sequence: its images in the cache, its name and faults those of the file."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from omnieval.datasets.camera_file import camera_beside
from omnieval.datasets.findings import ROOT, Finding
from omnieval.datasets.scan import Scan, exists, in_time, pose_remarks
from omnieval.datasets.sequence import Pose
from omnieval.datasets.source import Address
from omnieval.datasets.streams.store import Contents, decoded
from omnieval.errors import DatasetError
from omnieval.wording import near_path, safe_name

NO_POSES = "no-poses"
"""The finding that nothing tells where images were taken."""
_LOG = logging.getLogger("omnieval")
_OF_POSES = ("pose-topic", "pose-frame", "poses-tolerance", "poses-interpolate")
"""Options that decide where images were taken, but not which they are."""


def scan_stream(
    address: Address,
    files: Sequence[Path],
    decode: Callable[[Path], Contents],
    locate: Callable[[Contents], Contents] | None = None,
) -> Scan:
    """Return the sequence in a stream, decoding it if need be; a ``camera.toml`` beside it tells its camera.

    Parameters
    ----------
    address
        The stream.
    files
        The files it consists of.
    decode
        See `store.decoded`. What it raises does not name the stream.
    locate
        Says where the images were taken, if an option names what tells it; then nothing that `decode` has found about
        missing poses holds.
    """
    base = Scan(safe_name(address.path.stem), address.source, address.path)
    if not exists(address.path):
        return replace(
            base, findings=(Finding("error", "missing-file", ROOT, f"no such file; {near_path(address.path)}"),)
        )
    try:
        folder, contents = decoded(address.without(*_OF_POSES), files, _announced(address, decode))
        if locate is not None and "pose-topic" in address.options:
            contents = _located(contents, decoded(address, files, lambda _: locate(contents))[1])
    except DatasetError as error:
        return replace(base, findings=(Finding("error", "unreadable-stream", ROOT, str(error)),))
    camera, faults = camera_beside(address.path.parent, base.camera)
    frames, remarks = in_time(contents.frames)
    poses = ((frame.file, frame.pose and _with_yaw(frame.pose)) for frame in frames)
    remarks += pose_remarks(poses, largest_yaw=math.pi)
    return replace(
        base, root=folder, frames=tuple(frames), camera=camera, findings=(*contents.findings, *faults, *remarks)
    )


def _announced(address: Address, decode: Callable[[Path], Contents]) -> Callable[[Path], Contents]:
    """Return `decode`, saying first that it may take a while."""

    def announcing(folder: Path) -> Contents:
        _LOG.info("decoding %s into the cache, once", address.path)
        return decode(folder)

    return announcing


def _located(images: Contents, places: Contents) -> Contents:
    """Return images with their poses."""
    frames = (replace(frame, pose=pose) for frame, pose in zip(images.frames, places.poses, strict=True))
    kept = (finding for finding in images.findings if finding.code != NO_POSES)
    return Contents(tuple(frames), (*kept, *places.findings))


def _with_yaw(pose: Pose) -> Pose:
    """Return a pose of which nothing is odd only because its yaw is not known."""
    return replace(pose, yaw=0.0) if math.isnan(pose.yaw) else pose
