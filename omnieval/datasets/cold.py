"""COLD, the CoSy Localization Database (A. Pronobis, B. Caputo, *COLD: The CoSy Localization Database*, IJRR 2009).

A sequence is a folder like this (or one that holds nothing but such a folder; `omnieval.datasets.cold_folders` knows
two more ways to keep one)::

    cold-freiburg/part_a/seq2_cloudy3/
      omni_cam/                      required
        t1152904768.652404_x-1.511887_y1.036311_a1.348328.jpeg
        ...
      localization/places.lst        optional: "<file name> <ROOM>-<PART>" a line
      std_cam/, odom_scans/          not read

An image's name carries its time (seconds since the epoch, exact to the microsecond) and its ground-truth pose:
x and y in metres (x forward along the corridor, y left), yaw in radians.
"""

from __future__ import annotations

import math
import re
from dataclasses import replace
from pathlib import Path

from omnieval.datasets.camera_file import camera_beside
from omnieval.datasets.cards import card, find_card
from omnieval.datasets.cold_folders import ENDING, OMNI_FOLDER, ImageFolders, cold_stem, find_images
from omnieval.datasets.findings import Finding
from omnieval.datasets.labels import joined_labels
from omnieval.datasets.scan import (
    Scan,
    called,
    canonical_path,
    has_image_suffix,
    in_time,
    pose_remarks,
    read_text,
    unread_remarks,
    visible_names,
)
from omnieval.datasets.sequence import Camera, Frame, Pose
from omnieval.errors import DatasetError
from omnieval.wording import safe_name, shown

SYNTHETIC = "synthetic"
"""Card of the built-in building."""
PLACES_FILE = "localization/places.lst"
PLACES_FILES = (PLACES_FILE, "places.lst")

_NAME = re.compile(
    r"t(\d+)\.(\d{6})_x(-?\d+\.\d{6})_y(-?\d+\.\d{6})_a(-?\d+\.\d{6})\.jpeg",
    re.ASCII,
)
_NAME_FORM = "t<seconds>_x<metres>_y<metres>_a<radians>.jpeg with six decimals each"
_LABEL = re.compile(r"(?P<room>[^\s-](?:\S*?[^\s-])??)(?:-(?P<part>[^\s-]+))?")
_MICROSECOND = 1_000
_SECOND = 1_000_000_000
_LARGEST_TIME = 2**63 - 1
_YAW_LIMIT = math.pi + 1e-6
"""Six decimals round pi up, so that a heading in a name may be a little more than pi."""


def parse_name(name: str) -> tuple[int, Pose]:
    """Return time (nanoseconds since the epoch) and pose of the image called `name`.

    Raises
    ------
    DatasetError
        If `name` is not a COLD image name, or its time does not fit 64 bits of nanoseconds.

    Examples
    --------
    >>> parse_name("t1152904768.652404_x-1.511887_y1.036311_a1.348328.jpeg")
    (1152904768652404000, Pose(x=-1.511887, y=1.036311, yaw=1.348328))
    """
    match = _NAME.fullmatch(name)
    if match is None:
        raise DatasetError(f"'{shown(name)}' is not a COLD image name; expected {_NAME_FORM}")
    seconds, microseconds, x, y, yaw = match.groups()
    significant = seconds.lstrip("0") or "0"
    time_ns = int(significant[:11]) * _SECOND + int(microseconds) * _MICROSECOND  # integers keep every digit
    if len(significant) > 10 or time_ns > _LARGEST_TIME:
        raise DatasetError(f"'{shown(name)}' has a time beyond the year 2262; expected seconds since the epoch")
    return time_ns, Pose(float(x), float(y), float(yaw))


def format_name(time_ns: int, pose: Pose) -> str:
    """Return the name COLD gives an image taken at `time_ns` (cut to microseconds) and `pose`."""
    seconds, rest = divmod(time_ns, _SECOND)
    stamp = f"{seconds}.{rest // _MICROSECOND:06d}"
    return f"t{stamp}_x{pose.x:.6f}_y{pose.y:.6f}_a{pose.yaw:.6f}.jpeg"


def scan_cold(path: str | Path) -> Scan:
    """Read as much of the COLD sequence in `path` as can be understood, and note every fault."""
    given = canonical_path(path)
    found = find_images(given)
    if isinstance(found, Finding):
        return Scan(safe_name(given.name), f"cold:{given}", given, findings=(found,))
    root, published = found.root, found.layout == "published"
    below = f"{OMNI_FOLDER}/" if published else ""
    frames, faults, unnamed = _scan_names(found)
    if not frames and not faults:
        faults = [Finding("error", "empty", OMNI_FOLDER, "no image; is the download complete?")]
    poses = ((f"{below}{frame.file}", frame.pose) for frame in frames)
    remarks = in_time(frames, below=below)[1] + pose_remarks(poses, largest_yaw=_YAW_LIMIT)
    frames, label_findings = _labelled(found, frames)
    known, card_sequence = find_card(root)
    mirror = known.mirror if known else None
    # Who sorts the images by rooms may have unwrapped them, too.
    camera, camera_faults = camera_beside(root, Camera("omnidirectional" if published or mirror else "auto", mirror))
    return Scan(
        name=safe_name(root.name),
        source=f"cold:{root}",
        root=root,
        frames=tuple(frames),
        camera=camera,
        findings=(*faults, *camera_faults, *remarks, *label_findings),
        unnamed=tuple(unnamed),
        card=known.name if known else None,
        card_sequence=card_sequence,
    )


def scan_rendered(text: str) -> Scan:
    """Read a built-in building, ``LIGHT[:BUILDING]`` (empty: the first light), rendering it into the cache if need be.

    Raises
    ------
    DatasetError
        If there is no such light or building.
    """
    from omnieval.datasets.synthetic import cached, rendered

    which = rendered(text)
    return replace(
        scan_cold(cached(which.light, which.building)),
        name=which.name,
        source=which.source,
        camera=Camera("omnidirectional", card(SYNTHETIC).mirror),
        card=SYNTHETIC,
        card_sequence=which.light if which.building == 1 else None,
    )


def _scan_names(found: ImageFolders) -> tuple[list[Frame], list[Finding], list[Path]]:
    """Return the frames in the order of their times, what is wrong with names, and the image files without a frame."""
    frames: list[Frame] = []
    findings: list[Finding] = []
    unnamed: list[Path] = []
    for folder in found.folders:
        for name in visible_names(found.root / folder):
            path, where = found.root / folder / name, "/".join(filter(None, (folder, name)))
            if not has_image_suffix(name):
                unread = unread_remarks([where])
                stray = [Finding("warning", "stray-file", shown(where), "not an image; ignored")] if folder else []
                findings += unread or stray
                continue
            published = found.layout == "published"
            try:
                time_ns, pose = parse_name(name if published else f"{cold_stem(name)}{ENDING}")
            except DatasetError as error:
                findings.append(Finding("error", "bad-name", shown(where), str(error)))
                unnamed.append(path)
            else:
                room = _room(folder) if found.layout == "rooms" else None
                frames.append(Frame(path, name if published else where, time_ns, pose, room))
    frames.sort(key=lambda frame: (frame.time_ns or 0, frame.file))
    return frames, findings, unnamed


def _time_of(stem: str) -> int | None:
    """Return the time in the name of an image of any camera of the robot, nanoseconds; None if it has none."""
    try:
        return parse_name(f"{stem}{ENDING}")[0]
    except DatasetError:
        return None


def _room(label: str) -> str:
    """Return the room of a label, ``<ROOM>-<PART>`` or ``<ROOM>``."""
    match = _LABEL.fullmatch(label)
    return match["room"] if match else label


def _called(root: Path, name: str) -> Path:
    """Return a file below `root`, whatever the case of its own name."""
    folder, _, last = name.rpartition("/")
    return called(root / folder, last)


def _labelled(found: ImageFolders, frames: list[Frame]) -> tuple[list[Frame], list[Finding]]:
    """Return the frames with the rooms that ``places.lst`` gives them, and what is odd about that."""
    try:
        path = next((path for name in PLACES_FILES if (path := _called(found.root, name)).exists()), None)
    except DatasetError as error:
        return frames, [Finding("error", "unreadable-labels", PLACES_FILE, str(error))]
    if path is None:
        if any(frame.room for frame in frames):
            return frames, []
        return frames, [Finding("info", "no-labels", PLACES_FILE, "not there; frames have no room")]
    file = path.relative_to(found.root).as_posix()
    try:
        text = read_text(path)
    except DatasetError as error:
        return frames, [Finding("error", "unreadable-labels", file, str(error))]
    rooms, faults = scan_places(text, file)
    labels, findings = joined_labels(
        frames, rooms, file, time_of=_time_of, below=OMNI_FOLDER if found.layout == "published" else ""
    )
    labelled = [replace(frame, room=labels.get(frame.file, frame.room)) for frame in frames]
    return labelled, [*faults, *findings]


def scan_places(text: str, file: str = PLACES_FILE) -> tuple[dict[str, str], list[Finding]]:
    r"""Return the room of every image that a ``places.lst`` names, in its order, and what is wrong with its lines.

    The room is the ``<ROOM>`` of ``<ROOM>-<PART>``, or the whole label where there is no part.

    Examples
    --------
    >>> scan_places("t1.000000_x0.000000_y0.000000_a0.000000.jpeg 2PO1-A\n")
    ({'t1.000000_x0.000000_y0.000000_a0.000000.jpeg': '2PO1'}, [])
    """
    labels: dict[str, str] = {}
    rooms: dict[str, str] = {}
    faults: list[Finding] = []
    for number, line in enumerate(text.split("\n"), start=1):
        fields = line.split()
        if not fields:
            continue
        match = _LABEL.fullmatch(fields[-1])
        where = f"{file}:{number}"
        if len(fields) != 2 or match is None:
            message = f"'{shown(line.strip())}' is not '<file name> <ROOM>-<PART>'; correct or remove the line"
            faults.append(Finding("error", "bad-label", where, message))
        elif labels.setdefault(fields[0], fields[1]) != fields[1]:
            message = f"{shown(fields[0])} is {labels[fields[0]]} and {shown(fields[1])}; keep one label"
            faults.append(Finding("error", "conflicting-label", where, message))
        else:
            rooms[fields[0]] = match["room"]
    return rooms, faults
