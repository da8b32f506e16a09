"""Poses to images: by name, by time, or one after the other; between neighbours in time, where that is asked for."""

from __future__ import annotations

import math
import re
import unicodedata
from bisect import bisect_left
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from statistics import median

from omnieval.datasets.findings import Finding
from omnieval.datasets.sequence import Frame, Pose, wrapped
from omnieval.datasets.trajectory.read import Fix, Track
from omnieval.wording import counted, shown

_ENDING = re.compile(r"\.[a-z][a-z0-9]{1,4}$")
_SAME_MOMENT_NS = 1_000_000
"""Times no further apart are those of one moment, written with other digits."""
_USUAL_INTERVAL_NS = 200_000_000
"""Between images of which there are too few to tell."""


@dataclass(frozen=True)
class Joining:
    """How poses come to images.

    Attributes
    ----------
    tolerance_s
        How far an image may be from its pose in time, seconds; None for half the median interval between images.
    interpolate_s
        Poses that are no further apart, seconds, are interpolated between; None to interpolate nothing.
    """

    tolerance_s: float | None = None
    interpolate_s: float | None = None


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
    """Return the frames, those without a pose between neighbours that have one, at most so many seconds apart."""
    known = sorted(
        (f.time_ns, f.pose) for f in frames if f.pose is not None and f.time_ns is not None and _finite(f.pose)
    )
    timeline = _Timeline(known)
    found: list[Frame] = []
    for frame in frames:
        pose = None
        if frame.pose is None and frame.time_ns is not None:
            pose = timeline.between(frame.time_ns, longest_s)
        found.append(frame if pose is None else replace(frame, pose=pose))
    count = sum(one is not other for one, other in zip(found, frames, strict=True))
    return found, _said_of_interpolated(count, longest_s)


def _said_of_interpolated(count: int, longest_s: float) -> list[Finding]:
    if not count:
        return []
    message = (
        f"{counted(count, 'image')} between poses at most {longest_s:g} s apart; position and heading interpolated"
    )
    return [Finding("info", "poses-interpolated", ".", message)]


class _Timeline:
    """Poses in the order of their times, nanoseconds."""

    def __init__(self, known: Sequence[tuple[int, Pose]]) -> None:
        self._known = known
        self._times = [time for time, _ in known]

    def nearest(self, time: int) -> tuple[int, Pose] | None:
        """Return how far away in time the nearest pose is, nanoseconds, and it."""
        at = bisect_left(self._times, time)
        near = self._known[max(0, at - 1) : at + 1]
        return min(((abs(other - time), pose) for other, pose in near), key=lambda one: one[0], default=None)

    def between(self, time: int, longest_s: float) -> Pose | None:
        """Return the pose at a time between two that are at most so many seconds apart; None if there are none.

        The position is on the straight line between them, the heading on the shorter arc.
        """
        at = bisect_left(self._times, time)
        if not 0 < at < len(self._times):
            return None
        (before, one), (after, other) = self._known[at - 1], self._known[at]
        if after - before > longest_s * 1e9:
            return None
        share = (time - before) / (after - before)
        turn = math.remainder(other.yaw - one.yaw, math.tau) if _both_look(one, other) else math.nan
        return Pose(
            one.x + share * (other.x - one.x), one.y + share * (other.y - one.y), wrapped(one.yaw + share * turn)
        )


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
    fixes = sorted(
        ((fix.time_ns, fix) for fix in track.fixes if fix.time_ns is not None and fix.pose and _finite(fix.pose)),
        key=lambda one: one[0],
    )
    timeline = _Timeline([(time, fix.pose) for time, fix in fixes if fix.pose is not None])
    if how.tolerance_s is not None:
        tolerance = how.tolerance_s * 1e9
    elif how.interpolate_s is not None:
        tolerance = float(_SAME_MOMENT_NS)
    else:
        tolerance = _half_interval_ns(frames)
    posed: list[Frame] = []
    between = 0
    for frame in frames:
        pose = None
        if frame.time_ns is not None:
            near = timeline.nearest(frame.time_ns)
            pose = near[1] if near is not None and near[0] <= min(tolerance, _SAME_MOMENT_NS) else None
            if pose is None and how.interpolate_s is not None:
                pose = timeline.between(frame.time_ns, how.interpolate_s)
                between += pose is not None
            if pose is None and near is not None and near[0] <= tolerance:
                pose = near[1]
        posed.append(frame if pose is None else replace(frame, pose=Pose(pose.x, pose.y, wrapped(pose.yaw))))
    if all(frame.pose is None for frame in posed):
        return posed, [_nothing(track, *_times_in_words(frames, [time for time, _ in fixes], tolerance))], ""
    said = _said_of_interpolated(between, how.interpolate_s or 0.0)
    return posed, said, f"by time (within {tolerance / 1e9:.3g} s)"


def _half_interval_ns(frames: Sequence[Frame]) -> float:
    times = sorted(frame.time_ns for frame in frames if frame.time_ns is not None)
    intervals = [later - earlier for earlier, later in pairwise(times) if later > earlier]
    return (median(intervals) if intervals else _USUAL_INTERVAL_NS) / 2


def _times_in_words(frames: Sequence[Frame], fixes: Sequence[int], tolerance_ns: float) -> tuple[str, str]:
    times = sorted(frame.time_ns for frame in frames if frame.time_ns is not None)
    if not fixes:
        return "it has no pose with a time", "give one a row"
    theirs = f"its times are {_span(fixes)}, those of the images {_span(times)}"
    if fixes[-1] < times[0] or times[-1] < fixes[0]:
        return theirs, "it is of another sequence, or of another clock or unit of time"
    return f"no pose is within {tolerance_ns / 1e9:.3g} s of an image; {theirs}", "set --poses-tolerance SECONDS"


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
    index = _NameIndex(files)
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


class _NameIndex:
    """Images by the ways to name them; a path is the surest, then the end of one, whatever its ending or case."""

    def __init__(self, files: Sequence[str]) -> None:
        plain = {file: _plain(file) for file in files}
        self._exact: Mapping[str, str] = {name: file for file, name in plain.items()}
        stems: defaultdict[str, list[str]] = defaultdict(list)
        for file, name in plain.items():
            stems[_stem(name)].append(file)
        self._stems = stems

    def meant(self, name: str) -> list[str]:
        """Return the images that a name may mean."""
        plain = _plain(name)
        if plain in self._exact:
            return [self._exact[plain]]
        candidates = self._stems.get(_stem(plain), [])
        for alike in (_parts_alike, _ending_alike, _case_alike):
            if len(candidates) < 2:
                return candidates
            likeness = [alike(plain, _plain(file)) for file in candidates]
            candidates = [file for file, score in zip(candidates, likeness, strict=True) if score == max(likeness)]
        return candidates


def _plain(name: str) -> str:
    """Return what spellings of one path have in common: separators, ``./``, composed and decomposed accents."""
    return unicodedata.normalize("NFC", name.replace("\\", "/")).removeprefix("./")


def _stem(plain: str) -> str:
    """Return the last part of a path without its ending, in lower case."""
    return _ENDING.sub("", plain.rpartition("/")[2].casefold())


def _parts_alike(one: str, other: str) -> int:
    """Return how many parts, from the end, two paths have in common, without their endings."""
    ones, others = (_ENDING.sub("", path.casefold()).split("/")[::-1] for path in (one, other))
    count = 0
    for a, b in zip(ones, others, strict=False):
        if a != b:
            break
        count += 1
    return count


def _ending_alike(one: str, other: str) -> bool:
    endings = [_ENDING.search(path.casefold()) for path in (one, other)]
    return len({ending and ending[0] for ending in endings}) == 1


def _case_alike(one: str, other: str) -> bool:
    return one.rpartition("/")[2] == other.rpartition("/")[2]
