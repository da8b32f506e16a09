"""Which poses can be used: those that are finite, and near enough to be metres."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable

from omnieval.datasets.scan import FARTHEST_M
from omnieval.datasets.sequence import Frame, Pose


def why_unposed(frames: Iterable[Frame]) -> str | None:
    """Say why not all positions of frames are known; None if they are.

    Examples
    --------
    >>> from pathlib import Path
    >>> why_unposed([Frame(Path("a.png"), "a.png", pose=Pose(math.nan, 1.0, 0.0))])
    '1 of 1 images have a pose that is not finite'
    """
    poses = [frame.pose for frame in frames]
    known = [pose for pose in poses if pose is not None]
    finite = [pose for pose in known if math.isfinite(pose.x) and math.isfinite(pose.y)]
    if not known and poses:
        return "the sequence has no poses"
    counts = {
        "no pose": len(poses) - len(known),
        "a pose that is not finite": len(known) - len(finite),
        "a pose too far away to be metres": sum(not _is_metres(pose) for pose in finite),
    }
    lacking = [f"{count} of {len(poses)} images have {what}" for what, count in counts.items() if count]
    return "; ".join(lacking) or None


def within_a_building(frame: Frame) -> Frame:
    """Return a frame without a pose that cannot be metres: distances over such mean nothing, or overflow."""
    return frame if frame.pose is None or _is_metres(frame.pose) else dataclasses.replace(frame, pose=None)


def _is_metres(pose: Pose) -> bool:
    return abs(pose.x) <= FARTHEST_M and abs(pose.y) <= FARTHEST_M
