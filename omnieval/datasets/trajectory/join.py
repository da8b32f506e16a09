"""Poses to images: by name, by time, or one after the other; between neighbours in time, where that is asked for."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import pairwise
from statistics import median

import numpy as np

from omnieval.datasets.findings import Finding
from omnieval.datasets.sequence import Frame, Pose, wrapped
from omnieval.datasets.trajectory.between import SAME_MOMENT_NS, Joining, neighbours
from omnieval.datasets.trajectory.naming import NameIndex
from omnieval.datasets.trajectory.read import Fix, Track
from omnieval.wording import counted, shown

_USUAL_INTERVAL_NS = 200_000_000
"""Between images of which there are too few to tell."""


def joined(frames: Sequence[Frame], track: Track, how: Joining) -> tuple[list[Frame], list[Finding]]:
    """Return the frames with the poses of a track, in place of any they have, and what is odd about that.

    Rows that name images give them their times and rooms too.

    Parameters
    ----------
    frames
        The images in order.
    track
        The poses.
    how
        Tolerance and interpolation.
    """
    bare = [frame if frame.pose is None else replace(frame, pose=None) for frame in frames]
    by_name = _by_name([frame.file for frame in frames], track) if track.named else None
    timed = track.timed and any(frame.time_ns is not None for frame in frames)
    if by_name is not None and (by_name[0] or any(found.severity == "error" for found in by_name[1]) or not timed):
        fixes, findings = by_name
        if not fixes and not findings:
            return bare, [_nothing(track, "none of its names is that of an image", _example(frames, track))]
        way = "by name"
        posed = [_fixed(frame, fixes.get(frame.file)) for frame in bare]
        if all(frame.time_ns is not None for frame in bare) and any(_untimed(fixes.get(f.file)) for f in bare):
            posed = [replace(one, time_ns=frame.time_ns) for one, frame in zip(posed, bare, strict=True)]
    elif timed:
        posed, findings, way = _by_time(bare, track, how)
    elif len(track.fixes) == len(frames):
        pairs = zip(bare, track.fixes, strict=True)
        posed, findings, way = [_fixed(frame, fix) for frame, fix in pairs], [], "one after the other"
    else:
        why = "no image has a time in its name" if track.timed else "it names no images and tells no times"
        message = f"{len(track.fixes)} rows for {counted(len(frames), 'image')}, and {why}; give a column file"
        return bare, [Finding("error", "rows-differ", track.file, message)]
    if any(found.severity == "error" for found in findings):
        return posed, findings
    known = sum(frame.pose is not None for frame in posed)
    message = (
        f"{track.words}; {counted(len(track.fixes), 'row')}, joined {way}: {known} of {counted(len(frames), 'image')}"
    )
    said = [Finding("info", "poses-read", track.file, message)] if track.guessed or way != "by name" else []
    if way.startswith("by name") and how.interpolate_s is not None:
        posed, more = interpolated(posed, how.interpolate_s)
        findings = [*findings, *more]
    return posed, [*said, *findings, *unposed(posed, f"no pose in {track.file}")]


def unposed(frames: Iterable[Frame], message: str) -> list[Finding]:
    """Return a finding for each frame without a pose."""
    return [
        Finding("warning", "image-without-pose", shown(frame.file), message) for frame in frames if frame.pose is None
    ]


def interpolated(frames: Sequence[Frame], longest_s: float) -> tuple[list[Frame], list[Finding]]:
    """Return the frames, those without a pose between neighbours that have one, at most this many seconds apart."""
    known = [(f.time_ns, f.pose) for f in frames if f.pose is not None and f.time_ns is not None and _finite(f.pose)]
    poses, _ = _at([None if frame.pose else frame.time_ns for frame in frames], known, 0.0, longest_s)
    found = [frame if pose is None else replace(frame, pose=pose) for frame, pose in zip(frames, poses, strict=True)]
    said = _said_of_interpolated(sum(pose is not None for pose in poses), longest_s)
    timeless = sum(frame.pose is None and frame.time_ns is None for frame in found)
    if timeless and longest_s > 0:
        message = f"{counted(timeless, 'image')} without a pose and without a time, so that nothing can be interpolated"
        said.append(Finding("warning", "poses-not-interpolated", ".", f"{message}; give times, such as in times.txt"))
    return found, said


def _said_of_interpolated(count: int, longest_s: float) -> list[Finding]:
    if not count:
        return []
    message = (
        f"{counted(count, 'image')} between poses at most {longest_s:g} s apart; position and heading interpolated"
    )
    return [Finding("info", "poses-interpolated", ".", message)]


def _at(
    moments: Sequence[int | None], known: Sequence[tuple[int, Pose]], tolerance_s: float, interpolate_s: float | None
) -> tuple[list[Pose | None], int]:
    """Return the pose at each moment by `between.neighbours`, and how many of them lie between two of the known.

    Between two the position is on the straight line from one to the other, the heading on the shorter arc.
    """
    known = sorted(known, key=lambda one: one[0])
    asked = [index for index, moment in enumerate(moments) if moment is not None]
    times = np.array([time for time, _ in known], np.int64)
    by = neighbours(np.array([moments[index] for index in asked], np.int64), times, tolerance_s, interpolate_s)
    poses: list[Pose | None] = [None] * len(moments)
    for index, before, after, share in zip(asked, by.before, by.after, by.share.tolist(), strict=True):
        if before >= 0:
            poses[index] = _on_the_way(known[before][1], known[after][1], share)
    return poses, by.between


def _on_the_way(one: Pose, other: Pose, share: float) -> Pose:
    if one is other:
        return Pose(one.x, one.y, wrapped(one.yaw))
    turn = math.remainder(other.yaw - one.yaw, math.tau) if _both_look(one, other) else math.nan
    return Pose(one.x + share * (other.x - one.x), one.y + share * (other.y - one.y), wrapped(one.yaw + share * turn))


def _both_look(one: Pose, other: Pose) -> bool:
    return math.isfinite(one.yaw) and math.isfinite(other.yaw)


def _finite(pose: Pose) -> bool:
    return math.isfinite(pose.x) and math.isfinite(pose.y)


def _fixed(frame: Frame, fix: Fix | None) -> Frame:
    if fix is None:
        return frame
    pose = fix.pose and Pose(fix.pose.x, fix.pose.y, wrapped(fix.pose.yaw))
    time = frame.time_ns if fix.time_ns is None else fix.time_ns
    return Frame(frame.path, frame.file, time, pose, fix.room or frame.room)


def _untimed(fix: Fix | None) -> bool:
    return fix is None or fix.time_ns is None


def _by_time(frames: Sequence[Frame], track: Track, how: Joining) -> tuple[list[Frame], list[Finding], str]:
    """Return the frames with the poses nearest in time, or between neighbours, what is wrong, and how that was done."""
    known = [
        (fix.time_ns, fix.pose) for fix in track.fixes if fix.time_ns is not None and fix.pose and _finite(fix.pose)
    ]
    if how.tolerance_s is not None:
        tolerance_s = how.tolerance_s
    else:
        tolerance_s = (SAME_MOMENT_NS if how.interpolate_s is not None else _half_interval_ns(frames)) / 1e9
    poses, between = _at([frame.time_ns for frame in frames], known, tolerance_s, how.interpolate_s)
    posed = [frame if pose is None else replace(frame, pose=pose) for frame, pose in zip(frames, poses, strict=True)]
    if all(pose is None for pose in poses):
        return posed, [_nothing(track, *_times_in_words(frames, sorted(time for time, _ in known), tolerance_s))], ""
    said = _said_of_interpolated(between, how.interpolate_s or 0.0)
    return posed, said, f"by time (within {tolerance_s:.3g} s)"


def _half_interval_ns(frames: Sequence[Frame]) -> float:
    times = sorted(frame.time_ns for frame in frames if frame.time_ns is not None)
    intervals = [later - earlier for earlier, later in pairwise(times) if later > earlier]
    return (median(intervals) if intervals else _USUAL_INTERVAL_NS) / 2


def _times_in_words(frames: Sequence[Frame], fixes: Sequence[int], tolerance_s: float) -> tuple[str, str]:
    times = sorted(frame.time_ns for frame in frames if frame.time_ns is not None)
    if not fixes:
        return "it has no pose with a time", "give one a row"
    theirs = f"its times are {_span(fixes)}, those of the images {_span(times)}"
    if fixes[-1] < times[0] or times[-1] < fixes[0]:
        return theirs, "it is of another sequence, or of another clock or unit of time"
    return f"no pose is within {tolerance_s:.3g} s of an image; {theirs}", "set --poses-tolerance SECONDS"


def _span(times_ns: Sequence[int]) -> str:
    return f"{times_ns[0] / 1e9:.3f} to {times_ns[-1] / 1e9:.3f} s"


def _nothing(track: Track, what: str, hint: str) -> Finding:
    return Finding("error", "poses-match-nothing", track.file, f"{what}: {hint}")


def _example(frames: Sequence[Frame], track: Track) -> str:
    first = next(fix.name for fix in track.fixes if fix.name is not None)
    image = f"the first image is {shown(frames[0].file)}" if frames else "there are no images"
    return f"it names {shown(first)}, and {image}"


def _by_name(files: Sequence[str], track: Track) -> tuple[dict[str, Fix], list[Finding]]:
    """Return the rows by the images they name, and what is odd about the names; both empty if none names an image."""
    index = NameIndex(files)
    fixes: dict[str, Fix] = {}
    findings: list[Finding] = []
    strangers: list[Finding] = []
    for fix in track.fixes:
        if fix.name is None:
            continue
        images = index.meant(fix.name)
        if len(images) == 1 and images[0] not in fixes:
            fixes[images[0]] = fix
            continue
        where = f"{track.file}:{fix.line}"
        if not images:
            message = f"named in {where} but not there"
            strangers.append(Finding("warning", "missing-image", shown(fix.name), message))
        elif len(images) > 1:
            message = f"{shown(fix.name)} may be {shown(images[0])} or {shown(images[1])}; give the path"
            findings.append(Finding("error", "ambiguous-image", where, message))
        else:
            findings.append(Finding("error", "bad-pose-row", where, f"{shown(images[0])} has two rows; keep one"))
    return fixes, [*findings, *(strangers if fixes else [])]
