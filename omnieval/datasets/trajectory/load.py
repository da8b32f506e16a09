"""Images with the poses of a file: one that is named with the source, or the one that lies beside them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from omnieval.datasets.findings import Finding, errors
from omnieval.datasets.scan import Scan, canonical_path, in_time
from omnieval.datasets.sequence import Frame
from omnieval.datasets.trajectory.beside import poses_beside
from omnieval.datasets.trajectory.between import Joining
from omnieval.datasets.trajectory.join import interpolated, joined
from omnieval.datasets.trajectory.read import read_track
from omnieval.errors import DatasetError
from omnieval.wording import near_path, shown

OPTIONS = ("poses", "poses-tolerance", "poses-interpolate")
"""Options that every source of images has, in the order in which they are written."""

_OF_POSES = frozenset(
    [
        "ambiguous-image",
        "bad-pose",
        "bad-pose-row",
        "bad-rotation",
        "bad-rotations",
        "image-without-pose",
        "missing-poses",
        "no-poses",
        "odd-rotations",
        "other-poses",
        "poses-match-nothing",
        "poses-read",
        "poses-interpolated",
        "poses-not-interpolated",
        "unread-poses",
        "rows-differ",
        "several-poses",
        "unclear-times",
        "unreadable-poses",
        "yaw-against-path",
        "yaw-in-degrees",
        "yaw-out-of-range",
    ]
)
"""Kinds of findings that are of no interest once other poses are taken."""
_OF_TIMES = frozenset(("duplicate-time", "names-not-in-order"))


@dataclass(frozen=True)
class PoseOptions:
    """What a source says of its poses.

    Attributes
    ----------
    file
        The file they are in; None for those that the source has of itself.
    joining
        How they come to the images.
    """

    file: Path | None
    joining: Joining

    @classmethod
    def of(cls, given: Mapping[str, str], source: str) -> PoseOptions:
        """Return the options of `OPTIONS` that are given.

        Raises
        ------
        DatasetError
            If one has no value, or none that makes sense; `source` is for the message.
        """
        for name, value in given.items():
            if not value:
                raise DatasetError(f"option {name} of {shown(source)} has no value; write {name}=VALUE")
        file = canonical_path(given["poses"]) if "poses" in given else None
        return cls(file, Joining.of(given, source))

    @property
    def written(self) -> dict[str, str]:
        """The options as they are written into a source."""
        file = {} if self.file is None else {"poses": str(self.file)}
        return {**file, **self.joining.written}


def with_poses(found: Scan, options: PoseOptions) -> Scan:
    """Return a scan whose images have the poses that are asked for, in place of those they have."""
    if errors(finding for finding in found.findings if finding.code not in _OF_POSES):
        return found
    if options.file is None:
        frames, more = interpolated(found.frames, options.joining.interpolate_s or 0.0)
        filled = {frame.file for frame in frames if frame.pose is not None}
        kept = [
            finding
            for finding in found.findings
            if finding.code != "image-without-pose" or not {finding.where, finding.where.rpartition("/")[2]} & filled
        ]
        return replace(found, frames=tuple(frames), findings=(*kept, *more))
    kept = [finding for finding in found.findings if finding.code not in _OF_POSES]
    frames, findings = posed(found.frames, options.file, _label(options.file, found.root), options.joining)
    if [frame.time_ns for frame in frames] != [frame.time_ns for frame in found.frames]:
        frames, times = in_time(frames)
        kept = [finding for finding in kept if finding.code not in _OF_TIMES] + times
    return replace(found, frames=tuple(frames), findings=(*kept, *findings))


def posed_by_what_is_beside(root: Path, frames: Sequence[Frame]) -> tuple[list[Frame], list[Finding]]:
    """Return images with the poses of the file beside them, if there is one, and what is odd about it."""
    file, remarks = poses_beside(root)
    if file is None:
        return list(frames), remarks
    found, findings = posed(frames, file, _label(file, root), Joining())
    return found, [*remarks, *findings]


def posed(frames: Sequence[Frame], file: Path, label: str, how: Joining) -> tuple[list[Frame], list[Finding]]:
    """Return images with the poses of a file, and what is wrong with these; with an error among it, as they are."""
    try:
        data = file.read_bytes()
    except OSError as error:
        missing = isinstance(error, FileNotFoundError)
        message = f"no such file; {near_path(file)}" if missing else f"cannot be read: {error.strerror or error}"
        return list(frames), [Finding("error", "unreadable-poses", label, message)]
    track = read_track(data, label)
    if not track.fixes or not frames:
        return list(frames), list(track.findings)
    found, findings = joined(frames, track, how)
    return found, [*track.findings, *findings]


def _label(file: Path, root: Path) -> str:
    """Return what to call a file in findings: its place within the sequence, or else its whole path."""
    return shown(file.relative_to(root).as_posix() if file.is_relative_to(root) else file.as_posix())
