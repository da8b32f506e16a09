"""Ground truth in the shape that a data card describes: rows of a CSV, a text file or a MATLAB array as captures.

The units and the order of the columns are those of `omnieval.datasets.layout.GroundTruth`; what comes out is in
metres, radians and nanoseconds.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Iterator
from dataclasses import dataclass
from decimal import Decimal, InvalidOperation

from omnieval.datasets.layout import GroundTruth
from omnieval.datasets.matlab import read_columns
from omnieval.datasets.poses import Capture, file_key
from omnieval.datasets.scan import Finding
from omnieval.datasets.sequence import Pose
from omnieval.errors import DatasetError
from omnieval.wording import shown

_COMMENTS = ("#", "%")
_UNITS_PER_METRE = {"m": 1, "cm": 100, "mm": 1000}
_NANOSECONDS = {"s": 1_000_000_000, "ms": 1_000_000, "us": 1_000, "ns": 1}
_LARGEST_TIME = 2**63 - 1


@dataclass(frozen=True, slots=True)
class Row:
    """What one row says: the image it names (None: the image is that of its rank) and the capture.

    `capture` is None where the row cannot be understood. `Capture.pose` has a yaw of NaN where no column tells it.
    """

    file: str | None
    capture: Capture | None


def scan_ground_truth(data: bytes, name: str, truth: GroundTruth) -> tuple[list[Row], list[Finding]]:
    """Return the rows of the ground truth, in order, and what is wrong with them.

    Parameters
    ----------
    data
        The bytes of the file.
    name
        Its name, for its format and for messages.
    truth
        What the card says of it.
    """
    rows: list[Row] = []
    faults: list[Finding] = []
    try:
        for line, cells in _cells(data, truth, name):
            file, capture, complaint = None, None, None
            try:
                file, capture = _capture(truth, line, cells)
            except ValueError as error:
                complaint = str(error)
            if complaint:
                hint = "; if it is a heading, set layout.ground_truth.header" if not rows and not truth.header else ""
                faults.append(Finding("error", "bad-pose-row", f"{name}:{line}", complaint + hint))
            rows.append(Row(file, capture))
    except DatasetError as error:
        faults.append(Finding("error", "unreadable-poses", name, str(error)))
    return rows, faults


def _cells(data: bytes, truth: GroundTruth, name: str) -> Iterator[tuple[int, list[str]]]:
    """Yield the number and the fields of every row, whatever the format."""
    kind = truth.resolved_format(name)
    if kind == "mat":
        yield from _matlab_cells(data, truth)
        return
    lines = _text_lines(data)
    delimiter = truth.delimiter or ("," if kind == "csv" else None)
    rows = _whitespace_rows(lines) if delimiter is None else _delimited_rows(lines, delimiter)
    filled = ((line, cells) for line, cells in rows if cells not in ([], [""]))
    if truth.header:
        next(filled, None)
    yield from filled


def _text_lines(data: bytes) -> list[str]:
    """Return the lines of a text, comments blanked so that the others keep their numbers."""
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise DatasetError("not UTF-8 text; save it as UTF-8, or set layout.ground_truth.format") from error
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    return ["" if line.lstrip().startswith(_COMMENTS) else line for line in lines]


def _whitespace_rows(lines: list[str]) -> Iterator[tuple[int, list[str]]]:
    for number, line in enumerate(lines, start=1):
        yield number, line.split()


def _delimited_rows(lines: list[str], delimiter: str) -> Iterator[tuple[int, list[str]]]:
    reader = csv.reader((f"{line}\n" for line in lines), delimiter=delimiter, strict=True)
    while True:
        try:
            row = next(reader, None)
        except csv.Error as error:
            reason = shown(str(error))  # it may quote a delimiter that cannot be printed
            raise DatasetError(f"line {reader.line_num} is not delimited text ({reason}); mend it") from error
        if row is None:
            return
        yield reader.line_num, [cell.strip() for cell in row]


def _matlab_cells(data: bytes, truth: GroundTruth) -> Iterator[tuple[int, list[str]]]:
    if "file" in truth.columns:
        raise DatasetError("a MATLAB array holds no file names; give one row an image, and columns without file")
    array = read_columns(data, truth.variable, transposed=truth.transposed)
    if array.shape[1] != len(truth.columns) and array.shape[0] == len(truth.columns):
        raise DatasetError(
            f"the array has {array.shape[0]} rows and {array.shape[1]} columns; change layout.ground_truth.transposed"
        )
    decimal = truth.decimal
    for number, row in enumerate(array.tolist(), start=1):
        yield number, [f"{value:.17g}".replace(".", decimal) for value in row]


def _capture(truth: GroundTruth, line: int, row: list[str]) -> tuple[str | None, Capture]:
    """Return the file and content of a row; ValueError says what is wrong with it."""
    if len(row) != len(truth.columns):
        raise ValueError(f"{len(row)} columns where the card says {', '.join(truth.columns)}; correct one of them")
    cells = dict(zip(truth.columns, row, strict=True))
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
    return (file_key(file) if file is not None else None), capture


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
    plain = _plain(text, truth)
    try:
        return float(plain)
    except ValueError:
        raise ValueError(f"{column} '{shown(text)}' is not a number; correct it, or columns in the card") from None


def _plain(text: str, truth: GroundTruth) -> str:
    """Return a number with a decimal point; text that only Python takes for a number becomes none."""
    if "_" in text or (truth.decimal == "," and "." in text):
        return ""
    return text.replace(truth.decimal, ".")


def _nanoseconds(text: str, truth: GroundTruth) -> int:
    """Return a time as nanoseconds; a float would lose the last digits of an epoch time."""
    try:
        time = Decimal(_plain(text, truth))
    except InvalidOperation:
        raise ValueError(f"time '{shown(text)}' is not a number; correct it, or columns in the card") from None
    scale = _NANOSECONDS[truth.time_unit]
    if not time.is_finite() or abs(time) > _LARGEST_TIME // scale:
        raise ValueError(f"time '{shown(text)}' is out of range; correct it, or layout.ground_truth.time_unit")
    return round(time * scale)
