"""Room labels to images: by name, or else by time, and what matches nothing is said."""

from __future__ import annotations

import bisect
import re
import statistics
from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from pathlib import PurePosixPath

from omnieval.datasets.findings import Finding
from omnieval.datasets.names import time_in_name
from omnieval.datasets.sequence import Frame
from omnieval.wording import counted, shown

_ENDING = re.compile(r"\.[a-z][a-z0-9]*$")


def joined_labels(
    frames: Sequence[Frame],
    rooms: Mapping[str, str],
    file: str,
    *,
    time_of: Callable[[str], int | None] = time_in_name,
    below: str = "",
) -> tuple[dict[str, str], list[Finding]]:
    """Return the rooms by the frames' files, and what is odd about them.

    A label belongs to the image of its name, whatever folders stand before it and whatever its ending. An image that no
    label names takes that of the nearest time, if a label names another image less than half a frame interval away:
    such lists are written for another camera of the same robot.

    Parameters
    ----------
    frames
        In the order of their times.
    rooms
        Rooms by the names in the list.
    file
        Name of the list, for messages.
    time_of
        Returns the time that a name without folders and ending holds, nanoseconds.
    below
        Folder of the frames, for messages.
    """
    stems = {_stem(frame.file): frame.file for frame in frames}
    own = {name: stems[stem] for name in rooms if (stem := _stem(name)) in stems}
    labels = {own[name]: room for name, room in rooms.items() if name in own}
    strange = {name: room for name, room in rooms.items() if name not in own}
    times = {name: time for name in strange if (time := time_of(_stem(name))) is not None}
    by_time = _by_time([frame for frame in frames if frame.file not in labels], times, _half_interval_ns(frames))
    if rooms and not labels and not by_time:
        message = f"none of its {counted(len(rooms), 'label')} names an image that is here, or one taken at such a time"
        first = shown(next(iter(rooms)))
        return {}, [Finding("error", "labels-match-nothing", file, f"{message} (first: {first}); correct or remove it")]
    labels |= {frame: strange[name] for frame, name in by_time.items()}
    used = set(by_time.values())
    where = f"{below}/" if below else ""
    findings = [
        Finding("warning", "missing-image", f"{where}{shown(name)}", f"named in {file} but not there")
        for name in strange
        if name not in used
    ]
    findings += [
        Finding("warning", "label-by-time", f"{where}{frame}", f"has its room from the image nearest in time in {file}")
        for frame in by_time
    ]
    findings += [
        Finding("warning", "image-without-label", f"{where}{frame.file}", f"not named in {file}")
        for frame in frames
        if frame.file not in labels and frame.room is None
    ]
    return labels, findings


def _by_time(frames: Sequence[Frame], times_ns: Mapping[str, int], limit_ns: float) -> dict[str, str]:
    """Return the name nearest in time to each frame, if it is nearer than `limit_ns`."""
    timed = sorted((time, name) for name, time in times_ns.items())
    times = [time for time, _ in timed]
    nearest: dict[str, str] = {}
    for frame in frames:
        if frame.time_ns is None or not timed:
            continue
        at = bisect.bisect(times, frame.time_ns)
        time, name = min(timed[max(0, at - 1) : at + 1], key=lambda one: abs(one[0] - (frame.time_ns or 0)))
        if abs(time - frame.time_ns) < limit_ns:
            nearest[frame.file] = name
    return nearest


def _half_interval_ns(frames: Sequence[Frame]) -> float:
    """Return half the usual time between frames, nanoseconds; 0 where there is none."""
    times = [frame.time_ns for frame in frames if frame.time_ns is not None]
    return statistics.median(b - a for a, b in pairwise(times)) / 2 if len(times) > 1 else 0.0


def _stem(name: str) -> str:
    """Return the last part of a path without its ending, in lower case; decimals are no ending."""
    return _ENDING.sub("", PurePosixPath(name.replace("\\", "/")).name.casefold())
