"""Tables of where, and perhaps when and in which room, images were taken: CSV, text or MATLAB arrays.

What the columns hold and in which units is said by an `omnieval.datasets.cards.GroundTruth`, or by the heading, as in
the ``poses.csv`` of a folder of images::

    file,x,y,yaw,room,time
    img_0001.png,0.00,0.00,0.000,corridor,12.25

What comes out is in metres, radians and nanoseconds. A row whose x, y and yaw are blank names an image without a known
pose.
"""

from __future__ import annotations

import csv
import math
import unicodedata
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from decimal import Decimal, InvalidOperation
from typing import cast

from omnieval.datasets.cards import COLUMNS, Column, GroundTruth
from omnieval.datasets.findings import Finding
from omnieval.datasets.sequence import Pose
from omnieval.errors import DatasetError
from omnieval.wording import did_you_mean, shown

POSES_FILE = "poses.csv"
BY_HEADING = GroundTruth(file=POSES_FILE, columns=None)
"""A table of which the heading names the columns."""

_REQUIRED = ("file", "x", "y")
"""Of a table with a heading; yaw, room and time may be missing."""
_COMMENTS = ("#", "%")
_UNITS_PER_METRE = {"m": 1, "cm": 100, "mm": 1000}
_NANOSECONDS = {"s": 1_000_000_000, "ms": 1_000_000, "us": 1_000, "ns": 1}
_LARGEST_TIME = 2**63 - 1


@dataclass(frozen=True, slots=True)
class Capture:
    """What a row says about its image; `line` is its number in the file, `pose.yaw` NaN where no column tells it."""

    line: int
    pose: Pose | None
    room: str | None
    time_ns: int | None


@dataclass(frozen=True, slots=True)
class Row:
    """One row: the image it names by `file_key` (None: the image of its rank), the capture if it can be understood."""

    file: str | None
    capture: Capture | None


@dataclass(slots=True)
class Table:
    """A table that has been read: its name, what its columns hold (None: it cannot be read at all), its rows."""

    name: str
    columns: tuple[Column, ...] | None = None
    rows: list[Row] = field(default_factory=list)


def file_key(name: str) -> str:
    """Return what two spellings of one file name have in common (composed and decomposed accents)."""
    return unicodedata.normalize("NFC", name)


def scan_table(data: bytes, name: str, truth: GroundTruth = BY_HEADING) -> tuple[Table, list[Finding]]:
    """Return the rows of a table, in order, and what is wrong with them.

    Parameters
    ----------
    data
        The bytes of the file.
    name
        Its name, for its format and for messages.
    truth
        What is known of it.
    """
    table, faults = Table(name, truth.columns), list[Finding]()

    def complain(line: int, complaint: str) -> None:
        faults.append(Finding("error", "bad-pose-row", f"{name}:{line}", complaint))

    try:
        cells = _cells(data, truth, name)
        if table.columns is None:
            line, heading = next(cells, (1, []))
            try:
                table.columns = _columns(heading)
            except ValueError as error:
                complain(line, str(error))
                return table, faults
        for line, row in cells:
            if "file" in table.columns and not any(row):
                continue
            try:
                table.rows.append(_row(truth, table.columns, line, row))
            except ValueError as error:
                unskipped = not (table.rows or truth.header or truth.columns is None)
                hint = "; if it is a heading, set layout.ground_truth.header" if unskipped else ""
                complain(line, f"{error}{hint}")
                table.rows.append(Row(None, None))
    except DatasetError as error:
        faults.append(Finding("error", "unreadable-poses", name, str(error)))
        table.columns = None
    return table, faults


def _cells(data: bytes, truth: GroundTruth, name: str) -> Iterator[tuple[int, list[str]]]:
    """Yield the number and the fields of every row, whatever the format."""
    kind = truth.resolved_format(name)
    if kind == "mat":
        yield from _matlab_cells(data, truth)
        return
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise DatasetError("not UTF-8 text; save it as UTF-8, or set layout.ground_truth.format") from error
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    if truth.columns is not None:  # else a line may begin with the name of an image
        lines = ["" if line.lstrip().startswith(_COMMENTS) else line for line in lines]  # the others keep their numbers
    delimiter = truth.delimiter or ("," if kind == "csv" else None)
    rows = _delimited(lines, delimiter) if delimiter else enumerate((line.split() for line in lines), start=1)
    filled = ((line, cells) for line, cells in rows if cells not in ([], [""]))
    if truth.header:
        next(filled, None)
    yield from filled


def _delimited(lines: list[str], delimiter: str) -> Iterator[tuple[int, list[str]]]:
    reader = csv.reader((f"{line}\n" for line in lines), delimiter=delimiter, strict=True)
    try:
        for row in reader:
            yield reader.line_num, [cell.strip() for cell in row]
    except csv.Error as error:
        reason = shown(str(error))  # it may quote a delimiter that cannot be printed
        raise DatasetError(f"line {reader.line_num} is not delimited text ({reason}); correct it") from error


def _matlab_cells(data: bytes, truth: GroundTruth) -> Iterator[tuple[int, list[str]]]:
    from omnieval.datasets.matlab import read_columns  # what it needs takes longer to load than a usual table to read

    columns = truth.columns or ()
    if "file" in columns:
        raise DatasetError("a MATLAB array holds no file names; give one row per image, and columns without file")
    array = read_columns(data, truth.variable, transposed=truth.transposed)
    if array.shape[1] != len(columns) and array.shape[0] == len(columns):
        raise DatasetError(
            f"the array has {array.shape[0]} rows and {array.shape[1]} columns; change layout.ground_truth.transposed"
        )
    for number, row in enumerate(array.tolist(), start=1):
        yield number, [f"{value:.17g}".replace(".", truth.decimal) for value in row]


def _columns(heading: list[str]) -> tuple[Column, ...]:
    """Return what the columns below a heading hold; ValueError says what is wrong with it."""
    names = [name.casefold() for name in heading]
    if len(names) == 1 and ";" in names[0]:
        raise ValueError("columns are separated by semicolons; separate them by commas, with decimal points")
    for name, count in Counter(names).items():
        if name not in COLUMNS:
            raise ValueError(f"unknown column '{shown(name)}'; {did_you_mean(name, COLUMNS)}")
        if count > 1:
            raise ValueError(f"column {name} appears twice; keep one")
    missing = [name for name in _REQUIRED if name not in names]
    if missing:
        raise ValueError(f"no column {missing[0]}; expected file,x,y[,yaw][,room][,time]")
    return cast("tuple[Column, ...]", tuple(names))


def _row(truth: GroundTruth, columns: tuple[Column, ...], line: int, row: list[str]) -> Row:
    """Return what a row says; ValueError says what is wrong with it."""
    if len(row) != len(columns):
        hint = "are there decimal commas?" if len(row) > len(columns) else "correct it, or the columns"
        raise ValueError(f"{len(row)} fields for the columns {', '.join(columns)}; {hint}")
    cells = dict(zip(columns, row, strict=True))
    file = cells.get("file")
    if file == "":
        raise ValueError("no file name; give one, or remove the row")
    time = cells.get("time", "")
    capture = Capture(
        line=line,
        pose=_pose(cells["x"], cells["y"], cells.get("yaw"), truth),
        room=cells.get("room") or None,
        time_ns=_nanoseconds(time, truth) if time else None,
    )
    return Row(file_key(file) if file is not None else None, capture)


def _pose(x: str, y: str, yaw: str | None, truth: GroundTruth) -> Pose | None:
    """Return the pose in metres and radians, None if all of its fields are blank."""
    if not (x or y or yaw):
        return None
    per_metre = _UNITS_PER_METRE[truth.length_unit]
    heading = math.nan if yaw is None else _number(yaw, "yaw", truth)
    if truth.angle_unit == "deg":
        heading = math.radians(heading)
    return Pose(_number(x, "x", truth) / per_metre, _number(y, "y", truth) / per_metre, heading)


def _number(text: str, column: str, truth: GroundTruth) -> float:
    if not text:
        raise ValueError(f"{column} is blank; give all of the pose, or none of it")
    try:
        return float(_plain(text, truth))
    except ValueError:
        raise ValueError(f"{column} '{shown(text)}' is not a number; {_mend(text, truth)}") from None


def _plain(text: str, truth: GroundTruth) -> str:
    """Return a number with a decimal point; text that only Python takes for a number becomes none."""
    if "_" in text or (truth.decimal == "," and "." in text):
        return ""
    return text.replace(truth.decimal, ".")


def _mend(text: str, truth: GroundTruth) -> str:
    commas = "," in text and truth.decimal == "."
    return "write a decimal point, not a comma" if commas else "correct it, or the columns"


def _nanoseconds(text: str, truth: GroundTruth) -> int:
    """Return a time as nanoseconds; a float would lose the last digits of an epoch time."""
    try:
        time = Decimal(_plain(text, truth))
    except InvalidOperation:
        raise ValueError(f"time '{shown(text)}' is not a number; {_mend(text, truth)}") from None
    scale = _NANOSECONDS[truth.time_unit]
    if not time.is_finite() or abs(time) > _LARGEST_TIME // scale:
        raise ValueError(f"time '{shown(text)}' is out of range; correct it, or its unit")
    return round(time * scale)
