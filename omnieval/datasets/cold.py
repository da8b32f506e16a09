"""COLD, the CoSy Localization Database (A. Pronobis, B. Caputo, *COLD: The CoSy Localization Database*, IJRR 2009).

A sequence is a folder like this (or one that holds nothing but such a folder)::

    cold-freiburg/part_a/seq2_cloudy3/
      omni_cam/                      required
        t1152904768.652404_x-1.511887_y1.036311_a1.348328.jpeg
        ...
      localization/places.lst        optional: "<file name> <ROOM>-<PART>" a line
      odom_scans/odom.tdf            optional: wheel odometry, see `read_odometry`
      std_cam/, odom_scans/scans.tdf not read

An image's name carries its time (seconds since the epoch, exact to the microsecond) and its ground-truth pose:
x and y in metres (x forward along the corridor, y left), yaw in radians.
"""

from __future__ import annotations

import math
import re
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from omnieval.datasets.cards import find_card
from omnieval.datasets.scan import (
    ROOT,
    Finding,
    Scan,
    canonical_path,
    has_image_suffix,
    missing_folder,
    pose_remark,
    refusal,
    visible_names,
)
from omnieval.datasets.sequence import Camera, Frame, Pose, Sequence
from omnieval.errors import DatasetError
from omnieval.wording import safe_name, shown

OMNI_FOLDER = "omni_cam"
PLACES_FILE = "localization/places.lst"
ODOMETRY_DTYPE = np.dtype([("time_ns", np.int64), ("x", np.float64), ("y", np.float64), ("theta", np.float64)])

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
    time_ns = _nanoseconds(seconds, microseconds)
    if time_ns is None:
        raise DatasetError(f"'{shown(name)}' has a time beyond the year 2262; expected seconds since the epoch")
    return time_ns, Pose(float(x), float(y), float(yaw))


def format_name(time_ns: int, pose: Pose) -> str:
    """Return the name COLD gives an image taken at `time_ns` (cut to microseconds) and `pose`."""
    seconds, rest = divmod(time_ns, _SECOND)
    stamp = f"{seconds}.{rest // _MICROSECOND:06d}"
    return f"t{stamp}_x{pose.x:.6f}_y{pose.y:.6f}_a{pose.yaw:.6f}.jpeg"


def parse_places(text: str) -> dict[str, str]:
    r"""Return the room of every image that a ``places.lst`` names, in its order.

    The room is the ``<ROOM>`` of ``<ROOM>-<PART>``, or the whole label where there is no part.

    Raises
    ------
    DatasetError
        If a line is not a file name and a label, or an image has two different labels.

    Examples
    --------
    >>> parse_places("t1.000000_x0.000000_y0.000000_a0.000000.jpeg 2PO1-A\n")
    {'t1.000000_x0.000000_y0.000000_a0.000000.jpeg': '2PO1'}
    """
    rooms, faults = _scan_places(text)
    if faults:
        raise DatasetError(refusal(tuple(faults), root="", source="cold:PATH"))
    return rooms


def read_odometry(path: str | Path) -> NDArray[np.void]:
    """Read the wheel odometry of a sequence from its ``odom.tdf``.

    White-space columns, counted from 0: 3 seconds, 4 microseconds, 8 x, 9 y, 11 theta.

    Returns
    -------
    NDArray[np.void]
        Shape (n,), fields `time_ns` (int64, since the epoch), `x`, `y` (metres) and `theta` (radians).

    Raises
    ------
    DatasetError
        If the file cannot be read or a line lacks these columns.
    """
    rows: list[tuple[int, float, float, float]] = []
    for number, line in enumerate(_read_text(Path(path)).split("\n"), start=1):
        columns = line.split()
        if not columns:
            continue
        row = _odometry_row(columns)
        if row is None:
            raise DatasetError(
                f"{shown(str(path))}:{number}: not an odometry line; expected numbers in columns 3, 4, 8, 9, 11"
            )
        rows.append(row)
    return np.array(rows, dtype=ODOMETRY_DTYPE)


def read_cold(path: str | Path) -> Sequence:
    """Read the COLD sequence in folder `path`; nothing but names and labels is read.

    Frames are in time order; `Frame.file` is the image's name within ``omni_cam``.

    Raises
    ------
    DatasetError
        If the folder is not a COLD sequence, or a name or label does not parse.
    """
    return scan_cold(path).sequence()


def is_cold(path: Path) -> bool:
    """Tell whether `path` is a COLD sequence folder, or holds exactly one."""
    return isinstance(_sequence_folder(path), Path)


def scan_cold(path: str | Path) -> Scan:
    """Read as much of the COLD sequence in `path` as can be understood, and note every fault."""
    given = canonical_path(path)
    root = _sequence_folder(given)
    if isinstance(root, Finding):
        return Scan(safe_name(given.name), f"cold:{given}", given, faults=(root,))
    names = visible_names(root / OMNI_FOLDER)
    frames, faults = _scan_names(root, names)
    rooms, label_faults = _read_places(root)
    remarks = _order_remarks(frames) + _pose_remarks(frames) + _stray_remarks(names)
    if rooms is None and not label_faults:
        remarks.append(Finding("info", "no-labels", PLACES_FILE, "not there; frames have no room"))
    if rooms is not None:
        frames = [Frame(f.path, f.file, f.time_ns, f.pose, rooms.get(f.file)) for f in frames]
        remarks += _label_remarks(names, frames, rooms)
    if not frames and not faults:
        faults = [Finding("error", "empty", OMNI_FOLDER, "no image; is the download complete?")]
    card, card_sequence = find_card(root)
    readable = {frame.file for frame in frames}
    return Scan(
        name=safe_name(root.name),
        source=f"cold:{root}",
        root=root,
        frames=tuple(frames),
        camera=Camera("omnidirectional", card.mirror if card else None),
        faults=tuple(faults + label_faults),
        remarks=tuple(remarks),
        unnamed=tuple(root / OMNI_FOLDER / n for n in names if has_image_suffix(n) and n not in readable),
        card=card.name if card else None,
        card_sequence=card_sequence,
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
        text = _read_text(path)
    except DatasetError as error:
        return None, [Finding("error", "unreadable-labels", PLACES_FILE, str(error))]
    return _scan_places(text)


def _scan_places(text: str) -> tuple[dict[str, str], list[Finding]]:
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


def _order_remarks(frames: list[Frame]) -> list[Finding]:
    return [
        Finding("error", "duplicate-time", f"{OMNI_FOLDER}/{b.file}", f"taken at the same time as {a.file}; keep one")
        for a, b in pairwise(frames)
        if a.time_ns == b.time_ns
    ]


def _pose_remarks(frames: list[Frame]) -> list[Finding]:
    remarks = [
        pose_remark(frame.pose, f"{OMNI_FOLDER}/{frame.file}", largest_yaw=_YAW_LIMIT)
        for frame in frames
        if frame.pose is not None
    ]
    return [remark for remark in remarks if remark is not None]


def _stray_remarks(names: list[str]) -> list[Finding]:
    return [
        Finding("warning", "stray-file", f"{OMNI_FOLDER}/{shown(name)}", "not an image; ignored")
        for name in names
        if not has_image_suffix(name)
    ]


def _label_remarks(names: list[str], frames: list[Frame], rooms: dict[str, str]) -> list[Finding]:
    present = set(names)
    missing = [
        Finding("error", "missing-image", f"{OMNI_FOLDER}/{shown(name)}", f"named in {PLACES_FILE} but not there")
        for name in rooms
        if name not in present
    ]
    unlabelled = [
        Finding("warning", "image-without-label", f"{OMNI_FOLDER}/{frame.file}", f"not named in {PLACES_FILE}")
        for frame in frames
        if frame.room is None
    ]
    return missing + unlabelled


def _read_text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8-sig")
    except (OSError, ValueError) as error:
        reason = "not UTF-8 text" if isinstance(error, ValueError) else (error.strerror or str(error))
        raise DatasetError(f"cannot read {shown(str(path))}: {reason}") from error


def _odometry_row(columns: list[str]) -> tuple[int, float, float, float] | None:
    if len(columns) < 12 or not (columns[3].isascii() and columns[4].isascii()):
        return None
    if not (columns[3].isdigit() and columns[4].isdigit()):
        return None
    time_ns = _nanoseconds(columns[3], columns[4])
    try:
        x, y, theta = float(columns[8]), float(columns[9]), float(columns[11])
    except ValueError:
        return None
    if time_ns is None or not (math.isfinite(x) and math.isfinite(y) and math.isfinite(theta)):
        return None
    return time_ns, x, y, theta


def _nanoseconds(seconds: str, microseconds: str) -> int | None:
    """Return the time in nanoseconds, None if it does not fit 64 bits. Integers keep every digit."""
    significant, micros = seconds.lstrip("0") or "0", microseconds.lstrip("0") or "0"
    if len(significant) > 10 or len(micros) > 6:
        return None
    time_ns = int(significant) * _SECOND + int(micros) * _MICROSECOND
    return time_ns if time_ns <= _LARGEST_TIME else None
