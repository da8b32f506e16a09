"""``poses.csv``: where, and optionally when and in which room, the images of a folder were taken.

    file,x,y,yaw,room,time
    img_0001.png,0.00,0.00,0.000,corridor,12.25

Columns in any order; x and y in metres, yaw in radians, `room` and `time` (seconds) optional. A row whose x, y
and yaw are blank names an image without a known pose.
"""

from __future__ import annotations

import csv
import io
import math
import unicodedata
from collections import Counter
from dataclasses import dataclass
from decimal import Decimal, InvalidOperation

from omnieval.datasets.scan import Finding, refusal
from omnieval.datasets.sequence import Pose
from omnieval.errors import DatasetError
from omnieval.wording import did_you_mean, shown

POSES_FILE = "poses.csv"
REQUIRED_COLUMNS = ("file", "x", "y", "yaw")
COLUMNS = (*REQUIRED_COLUMNS, "room", "time")

_SECOND = 1_000_000_000
_LARGEST_TIME = 2**63 - 1


@dataclass(frozen=True, slots=True)
class Capture:
    """What a row says about its image; `line` is its number in the file."""

    line: int
    pose: Pose | None
    room: str | None
    time_ns: int | None


def file_key(name: str) -> str:
    """Return what two spellings of one file name have in common (composed and decomposed accents)."""
    return unicodedata.normalize("NFC", name)


def parse_poses(text: str) -> dict[str, Capture]:
    """Return what a ``poses.csv`` says of each image, by `file_key`, in its order.

    Raises
    ------
    DatasetError
        If the header or a row is wrong; it names the first fault and counts the rest.
    """
    captures, faults = scan_poses(text)
    if faults:
        raise DatasetError(refusal(tuple(faults), root="", source="folder:PATH"))
    return captures


def scan_poses(text: str) -> tuple[dict[str, Capture], list[Finding]]:
    """Return the rows that can be understood, and what is wrong with the others."""
    captures: dict[str, Capture] = {}
    faults: list[Finding] = []
    reader = csv.reader(io.StringIO(text, newline=""), strict=True)
    try:
        header = [column.strip().casefold() for column in next(reader, [])]
        complaint = _header_complaint(header)
        if complaint:
            return {}, [_fault(1, complaint)]
        for row in reader:
            if not any(field.strip() for field in row):
                continue
            try:
                name, capture = _capture(header, row, reader.line_num)
                if name in captures:
                    faults.append(_fault(reader.line_num, f"{shown(name)} has two rows; keep one"))
                captures.setdefault(name, capture)
            except ValueError as error:
                faults.append(_fault(reader.line_num, str(error)))
    except csv.Error as error:
        faults.append(_fault(reader.line_num, f"not comma-separated text ({error})"))
    return captures, faults


def _fault(line: int, message: str) -> Finding:
    return Finding("error", "bad-pose-row", f"{POSES_FILE}:{line}", message)


def _header_complaint(header: list[str]) -> str | None:
    if len(header) == 1 and ";" in header[0]:
        return "columns are separated by semicolons; separate them by commas, with decimal points"
    for column in header:
        if column not in COLUMNS:
            return f"unknown column '{shown(column)}'; {did_you_mean(column, COLUMNS)}"
    twice = [column for column, count in Counter(header).items() if count > 1]
    if twice:
        return f"column {twice[0]} appears twice; keep one"
    missing = [column for column in REQUIRED_COLUMNS if column not in header]
    return f"no column {missing[0]}; expected file,x,y,yaw[,room][,time]" if missing else None


def _capture(header: list[str], row: list[str], line: int) -> tuple[str, Capture]:
    """Return the file and content of a row; ValueError says what is wrong with it."""
    if len(row) != len(header):
        decimal_commas = "; are there decimal commas?" if len(row) > len(header) else ""
        raise ValueError(f"{len(row)} fields where the header has {len(header)}{decimal_commas}")
    cells = {column: cell.strip() for column, cell in zip(header, row, strict=True)}
    if not cells["file"]:
        raise ValueError("no file name")
    time = cells.get("time", "")
    capture = Capture(
        line=line,
        pose=_pose(cells["x"], cells["y"], cells["yaw"]),
        room=cells.get("room") or None,
        time_ns=_nanoseconds(time) if time else None,
    )
    return file_key(cells["file"]), capture


def _pose(x: str, y: str, yaw: str) -> Pose | None:
    if not (x or y or yaw):
        return None
    turn = _number(yaw, "yaw")
    return Pose(_number(x, "x"), _number(y, "y"), turn)


def _number(text: str, column: str) -> float:
    if not text:
        raise ValueError(f"{column} is blank; give x, y and yaw, or none of them")
    if "_" not in text:
        try:
            return float(text)
        except ValueError:
            pass
    hint = "; write a decimal point, not a comma" if "," in text else ""
    raise ValueError(f"{column} '{shown(text)}' is not a number{hint}")


def _nanoseconds(text: str) -> int:
    """Return decimal seconds as nanoseconds; a float would lose the last digits of an epoch time."""
    try:
        seconds = Decimal(text)
    except InvalidOperation:
        hint = "; write a decimal point, not a comma" if "," in text else ""
        raise ValueError(f"time '{shown(text)}' is not a number of seconds{hint}") from None
    if not seconds.is_finite() or abs(seconds) > _LARGEST_TIME // _SECOND:
        raise ValueError(f"time '{shown(text)}' is out of range; expected seconds")
    return round(seconds * _SECOND)


def wrapped(yaw: float) -> float:
    """Return `yaw` in (-pi, pi], radians; a value that is not finite unchanged."""
    if not math.isfinite(yaw) or -math.pi < yaw <= math.pi:
        return yaw
    turned = math.remainder(yaw, math.tau)
    return math.pi if turned <= -math.pi else turned
