"""COLD, the CoSy Localization Database (A. Pronobis, B. Caputo, *COLD: The CoSy Localization Database*, IJRR 2009).

A sequence is a folder like this (or one that holds nothing but such a folder)::

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

from omnieval.datasets.cards import card, find_card
from omnieval.datasets.findings import ROOT, Finding
from omnieval.datasets.scan import (
    Scan,
    canonical_path,
    has_image_suffix,
    in_time,
    missing_folder,
    pose_remarks,
    read_text,
    visible_names,
)
from omnieval.datasets.sequence import Camera, Frame, Pose
from omnieval.errors import DatasetError
from omnieval.wording import did_you_mean, safe_name, shown

OMNI_FOLDER = "omni_cam"
SYNTHETIC = "synthetic"
"""Card of the built-in building."""
PLACES_FILE = "localization/places.lst"

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
"""Six decimals round pi up."""


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


def is_cold(path: Path) -> bool:
    """Tell whether `path` is a COLD sequence folder, or holds exactly one."""
    return isinstance(_sequence_folder(path), Path)


def scan_cold(path: str | Path) -> Scan:
    """Read as much of the COLD sequence in `path` as can be understood, and note every fault."""
    given = canonical_path(path)
    root = _sequence_folder(given)
    if isinstance(root, Finding):
        return Scan(safe_name(given.name), f"cold:{given}", given, findings=(root,))
    names = visible_names(root / OMNI_FOLDER)
    frames, faults = _scan_names(root, names)
    rooms, label_faults = _read_places(root)
    poses = ((f"{OMNI_FOLDER}/{frame.file}", frame.pose) for frame in frames)
    remarks = in_time(frames, below=f"{OMNI_FOLDER}/")[1] + pose_remarks(poses, largest_yaw=_YAW_LIMIT)
    remarks += _stray_remarks(names)
    if rooms is None and not label_faults:
        remarks.append(Finding("info", "no-labels", PLACES_FILE, "not there; frames have no room"))
    if rooms is not None:
        frames = [Frame(f.path, f.file, f.time_ns, f.pose, rooms.get(f.file)) for f in frames]
        remarks += _label_remarks(names, frames, rooms)
    if not frames and not faults:
        faults = [Finding("error", "empty", OMNI_FOLDER, "no image; is the download complete?")]
    known, card_sequence = find_card(root)
    readable = {frame.file for frame in frames}
    return Scan(
        name=safe_name(root.name),
        source=f"cold:{root}",
        root=root,
        frames=tuple(frames),
        camera=Camera("omnidirectional", known.mirror if known else None),
        findings=(*faults, *label_faults, *remarks),
        unnamed=tuple(root / OMNI_FOLDER / n for n in names if has_image_suffix(n) and n not in readable),
        card=known.name if known else None,
        card_sequence=card_sequence,
    )


def scan_rendered(light: str) -> Scan:
    """Read the built-in building in `light` (empty: the first of `LIGHTS`), rendering it into the cache if need be.

    Raises
    ------
    DatasetError
        If there is no such light.
    """
    from omnieval.datasets.synthetic import LIGHTS, cached

    chosen = light or LIGHTS[0]
    if chosen not in LIGHTS:
        raise DatasetError(f"no light '{shown(light)}' in synthetic:{shown(light)}; {did_you_mean(light, LIGHTS)}")
    return replace(
        scan_cold(cached(chosen)),
        name=f"synthetic-{chosen}",
        source=f"synthetic:{chosen}",
        camera=Camera("omnidirectional", card(SYNTHETIC).mirror),
        card=SYNTHETIC,
        card_sequence=chosen,
    )


def _sequence_folder(path: Path) -> Path | Finding:
    """Return the folder that holds ``omni_cam``: `path`, its only such child, or its parent if it is that one."""
    fault = missing_folder(path)
    if fault:
        return fault
    if path.name == OMNI_FOLDER:
        return path.parent
    if (path / OMNI_FOLDER).is_dir():
        return path
    names = visible_names(path)
    nested = [name for name in names if (path / name / OMNI_FOLDER).is_dir()]
    return path / nested[0] if len(nested) == 1 else _no_sequence_folder(names, nested)


def _no_sequence_folder(names: list[str], nested: list[str]) -> Finding:
    if not names:
        return Finding("error", "empty", ROOT, "the folder is empty; name the sequence folder of a COLD download")
    if nested:
        first = ", ".join(shown(name) for name in nested[:3])
        message = f"holds {len(nested)} sequences ({first}{', ...' if len(nested) > 3 else ''}); name one of them"
        return Finding("error", "several-sequences", ROOT, message)
    message = f"no {OMNI_FOLDER} folder; name the sequence folder of a COLD download"
    return Finding("error", "missing-omni-cam", ROOT, message)


def _scan_names(root: Path, names: list[str]) -> tuple[list[Frame], list[Finding]]:
    frames: list[Frame] = []
    faults: list[Finding] = []
    for name in filter(has_image_suffix, names):
        try:
            time_ns, pose = parse_name(name)
        except DatasetError as error:
            faults.append(Finding("error", "bad-name", f"{OMNI_FOLDER}/{shown(name)}", str(error)))
        else:
            frames.append(Frame(root / OMNI_FOLDER / name, name, time_ns, pose))
    frames.sort(key=lambda frame: (frame.time_ns or 0, frame.file))
    return frames, faults


def _read_places(root: Path) -> tuple[dict[str, str] | None, list[Finding]]:
    """Return the rooms by file name, None if there is no ``places.lst``."""
    path = root / PLACES_FILE
    if not path.exists():
        return None, []
    try:
        text = read_text(path)
    except DatasetError as error:
        return None, [Finding("error", "unreadable-labels", PLACES_FILE, str(error))]
    return scan_places(text)


def scan_places(text: str) -> tuple[dict[str, str], list[Finding]]:
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
        where = f"{PLACES_FILE}:{number}"
        if len(fields) != 2 or match is None:
            message = f"'{shown(line.strip())}' is not '<file name> <ROOM>-<PART>'; correct or remove the line"
            faults.append(Finding("error", "bad-label", where, message))
        elif labels.setdefault(fields[0], fields[1]) != fields[1]:
            message = f"{shown(fields[0])} is {labels[fields[0]]} and {shown(fields[1])}; keep one label"
            faults.append(Finding("error", "conflicting-label", where, message))
        else:
            rooms[fields[0]] = match["room"]
    return rooms, faults


def _stray_remarks(names: list[str]) -> list[Finding]:
    return [
        Finding("warning", "stray-file", f"{OMNI_FOLDER}/{shown(name)}", "not an image; ignored")
        for name in names
        if not has_image_suffix(name)
    ]


def _label_remarks(names: list[str], frames: list[Frame], rooms: dict[str, str]) -> list[Finding]:
    present = set(names)
    missing = [
        Finding("warning", "missing-image", f"{OMNI_FOLDER}/{shown(name)}", f"named in {PLACES_FILE} but not there")
        for name in rooms
        if name not in present
    ]
    unlabelled = [
        Finding("warning", "image-without-label", f"{OMNI_FOLDER}/{frame.file}", f"not named in {PLACES_FILE}")
        for frame in frames
        if frame.room is None
    ]
    return missing + unlabelled
