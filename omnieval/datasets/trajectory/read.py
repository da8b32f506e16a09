"""A table of poses of any usual form: TUM, KITTI, EuRoC, or columns with a heading. Its content tells which form.

===== ====================================================== =========================================
form  columns                                                 told by
===== ====================================================== =========================================
TUM   time x y z qx qy qz qw                                  8 numbers, the last four a unit quaternion
EuRoC time [ns], x y z, qw qx qy qz, perhaps more             its heading, or commas and nanoseconds
KITTI 12 numbers: rows of [R | t], one line per image          12 numbers (or 16), R a rotation
else  named by a heading, in any order, others are not read   the heading (`columns.read_heading`)
===== ====================================================== =========================================

Times without a unit are seconds, or milli-, micro- or nanoseconds if they are as large as these since the epoch.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from decimal import Decimal
from statistics import median

import numpy as np
from numpy.typing import NDArray

from omnieval.datasets.findings import Finding
from omnieval.datasets.scan import FARTHEST_M, pose_remarks
from omnieval.datasets.sequence import Pose
from omnieval.datasets.trajectory.clock import LARGEST_NS, exact, unit_of
from omnieval.datasets.trajectory.columns import METRES, SECONDS, Column, Heading, Role, read_heading
from omnieval.datasets.trajectory.plane import matrices, on_the_ground
from omnieval.datasets.trajectory.text import Line, TextTable, is_number, read_text_table
from omnieval.errors import DatasetError
from omnieval.wording import counted, shown

DOCUMENTED = frozenset(("file", "x", "y", "yaw", "room", "time"))
"""Titles of columns that say all there is to say."""
_UNIT = 0.05
"""How far the norm of a quaternion may be from 1."""
_MOST = 0.9
"""Share of the rows that must be as a form says."""
_SAME_WAY = 0.9
_ANY_WAY = 0.6
"""Mean resultant lengths from which, and up to which, driving and looking go the same way or do not."""
_FEW_MOVES = 8
"""With fewer, chance decides whether they go the same way."""
_ENOUGH = 1000
"""Rows that tell the form of a table."""
_PLAIN_NUMBERS = re.compile(r"[-+.0-9eE\n]*")
_FULL_TURN = math.tau * 1.01


@dataclass(frozen=True, slots=True)
class Fix:
    """Where an image was taken that is known by its name, its time, or its rank; line is its number in the file."""

    line: int
    name: str | None = None
    time_ns: int | None = None
    pose: Pose | None = None
    room: str | None = None


@dataclass(frozen=True)
class Track:
    """A table of poses that has been read.

    Attributes
    ----------
    file
        What to call it.
    words
        What it was taken for.
    guessed
        Whether that is more than its heading says.
    fixes
        Its rows.
    findings
        What is wrong with it, or odd.
    """

    file: str
    words: str = ""
    guessed: bool = True
    fixes: tuple[Fix, ...] = ()
    findings: tuple[Finding, ...] = ()

    @property
    def named(self) -> bool:
        """Whether its rows name images."""
        return any(fix.name is not None for fix in self.fixes)

    @property
    def timed(self) -> bool:
        """Whether its rows have times."""
        return any(fix.time_ns is not None for fix in self.fixes)


def read_track(data: bytes, file: str) -> Track:
    """Return what a file of poses says, its faults among the findings.

    Parameters
    ----------
    data
        The bytes of the file.
    file
        What to call it in messages.
    """
    try:
        table = read_text_table(data)
    except DatasetError as error:
        return Track(file, findings=(Finding("error", "unreadable-poses", file, str(error)),))
    with np.errstate(over="ignore", invalid="ignore"):  # numbers may be as large as one writes them
        return _read(table, file)


def _read(table: TextTable, file: str) -> Track:
    where = file if table.heading is None else f"{file}:{table.heading[0]}"
    try:
        heading, form, of_a_camera = _understood(table)
    except ValueError as error:
        return Track(file, findings=(Finding("error", "bad-pose-row", where, str(error)),))
    return _Reader(file, table, heading, form, of_a_camera=of_a_camera).track()


def _understood(table: TextTable) -> tuple[Heading, str, bool]:
    """Return what the columns are, the name of the form, and whether it is of poses of cameras."""
    if table.heading is not None:
        titles = table.heading[1]
        heading = read_heading(titles)
        return heading, _form_of(heading, titles), False
    width, numbers = table.width, _numbers(table)
    named = bool(table.rows) and not is_number(table.rows[0][1][0])
    if named and width == 3:
        return _columns("name", "x", "y"), "name, x, y", False
    if numbers is not None and width in (12, 16):
        if not _are_rotations(numbers):
            raise ValueError(
                f"rows of {width} numbers whose first three columns are no rotation: not KITTI; {_NAME_THEM}"
            )
        return _columns(), "KITTI", True
    if numbers is not None and (width in {8, 17}):
        if not _are_unit(numbers[:, 4:8]):
            norm = float(np.median(np.linalg.norm(numbers[:, 4:8], axis=1)))
            raise ValueError(
                f"rows of {width} numbers whose columns 5 to 8 are no unit quaternion (norm {norm:.3g}): neither TUM "
                f"nor EuRoC; {_NAME_THEM}"
            )
        nanoseconds = bool(np.median(numbers[:, 0]) > 1e17)
        if width == 17 or (table.delimiter == "," and nanoseconds):
            return _columns(*_EUROC), "EuRoC", False
        if table.delimiter == "," or nanoseconds:
            raise ValueError(
                f"rows of 8 numbers that may be TUM (w of the quaternion last) or EuRoC (first); {_NAME_THEM}"
            )
        return _columns(*_TUM), "TUM", False
    raise ValueError(f"{counted(width, 'column')} without a heading; {_NAME_THEM}")


def _form_of(heading: Heading, titles: Sequence[str]) -> str:
    if tuple(heading.columns) == _TUM and not heading.unread:
        return "TUM"
    return "EuRoC" if "qw" in heading.columns and any("_RS_" in title for title in titles) else "columns"


_TUM: tuple[Role, ...] = ("time", "x", "y", "z", "qx", "qy", "qz", "qw")
_EUROC: tuple[Role, ...] = ("time", "x", "y", "z", "qw", "qx", "qy", "qz")
_NAME_THEM = "name them in a first line, such as file,x,y,yaw or time,x,y,z,qx,qy,qz,qw"


def _columns(*roles: Role) -> Heading:
    return Heading({role: Column(index, role, role) for index, role in enumerate(roles)}, (), ())


def _numbers(table: TextTable) -> NDArray[np.float64] | None:
    """Return rows of usual width as numbers, shape (n, width), of a large table some; None if most are not numbers."""
    rows = [fields for _, fields in table.rows if len(fields) == table.width]
    rows = rows[:: -(-len(rows) // _ENOUGH) or 1]
    whole = [[float(field) for field in fields] for fields in rows if all(map(is_number, fields))]
    return np.array(whole) if whole and len(whole) >= _MOST * len(rows) else None


def _are_unit(quaternions: NDArray[np.float64]) -> bool:
    norms = np.linalg.norm(quaternions, axis=1)
    return bool((np.abs(norms - 1) <= _UNIT).mean() >= _MOST)


def _are_rotations(numbers: NDArray[np.float64]) -> bool:
    turns = numbers[:, :12].reshape(-1, 3, 4)[:, :, :3]
    off = np.abs(turns @ turns.transpose(0, 2, 1) - np.eye(3)).max(axis=(1, 2))
    return bool(((off <= _UNIT) & (np.linalg.det(turns) > 0)).mean() >= _MOST)


class _Reader:
    """Turns the rows of a table into fixes, noting what is wrong with them."""

    def __init__(self, file: str, table: TextTable, heading: Heading, form: str, *, of_a_camera: bool) -> None:
        self._file, self._table, self._heading = file, table, heading
        self._form, self._of_a_camera = form, of_a_camera
        self._columns = heading.columns
        self._findings: list[Finding] = []
        self._rows: list[Line] = []
        self._notes = list(heading.notes)
        self._faulty: set[int] = set()

    def track(self) -> Track:
        """Return what the table says."""
        width = len(self._table.heading[1]) if self._table.heading else self._table.width
        for line, fields in self._table.rows:
            if len(fields) == width:
                self._rows.append((line, fields))
            else:
                self._complain(line, f"{len(fields)} fields for {width} columns; are there decimal commas?")
        names = self._texts("name")
        rooms = self._texts("room")
        times = self._times()
        given, turns = self._places(), self._turns()
        places = np.where(np.abs(given) <= FARTHEST_M, given, math.nan)
        try:
            ground = on_the_ground(places, turns, of_a_camera=self._of_a_camera)
        except ValueError as error:
            self._findings.append(Finding("error", "bad-rotations", self._file, str(error)))
            return self._done(())
        if ground.doubt:
            self._findings.append(Finding("warning", "odd-rotations", self._file, ground.doubt))
        yaws = self._yaws(ground.places) if "yaw" in self._columns else ground.yaws
        self._judge_turning(ground.places, yaws)
        if self._form == "KITTI" or "qw" in self._columns:
            self._notes.append(ground.words)
        elif "z" in self._columns:
            self._notes.append("z is not used")
        places_on_ground, places_given, looks = ground.places.tolist(), given[:, :2].tolist(), yaws.tolist()
        fixes = []
        for index, (line, _) in enumerate(self._rows):
            if "name" in self._columns and not names[index]:
                self._complain(line, "no file name; give one, or remove the row")
                continue
            (x, y), raw = places_on_ground[index], places_given[index]
            pose = self._pose(index, Pose(x, y, looks[index]), raw)
            if line in self._faulty:
                continue
            fixes.append(Fix(line, names[index] or None, times[index], pose, rooms[index] or None))
        if not fixes and not any(finding.severity == "error" for finding in self._findings):
            self._findings.append(Finding("error", "unreadable-poses", self._file, "it has a heading and no rows"))
        return self._done(tuple(fixes))

    def _done(self, fixes: tuple[Fix, ...]) -> Track:
        if self._heading.unread:
            self._notes.append(f"not read: {', '.join(map(shown, self._heading.unread))}")
        if self._table.decimal_comma:
            self._notes.append("decimal commas")
        titles = [shown(column.title) for column in self._columns.values()]
        words = f"{self._form} ({', '.join(titles)})" if self._form == "columns" else self._form
        guessed = self._form != "columns" or bool(self._notes) or not DOCUMENTED.issuperset(map(str.casefold, titles))
        return Track(self._file, "; ".join([words, *self._notes]), guessed, fixes, tuple(self._findings))

    def _complain(self, line: int, message: str) -> None:
        self._faulty.add(line)
        self._findings.append(Finding("error", "bad-pose-row", f"{self._file}:{line}", message))

    def _texts(self, role: Role) -> list[str]:
        column = self._columns.get(role)
        return [fields[column.index] if column else "" for _, fields in self._rows]

    def _values(self, role: Role) -> NDArray[np.float64]:
        """Return the numbers of a column, shape (n,), NaN where it is blank or, which is complained about, none."""
        column = self._columns.get(role)
        values = np.full(len(self._rows), math.nan)
        if column is None:
            return values
        texts = [fields[column.index] for _, fields in self._rows]
        if _PLAIN_NUMBERS.fullmatch("\n".join(texts)):
            with suppress(ValueError):  # some are blank, or no numbers after all: then one by one
                return np.array(texts, np.float64)
        for index, (line, fields) in enumerate(self._rows):
            text = fields[column.index]
            if is_number(text):
                values[index] = float(text)
            elif text:
                self._complain(line, f"{shown(column.title)} '{shown(text)}' is not a number; {_mend(text)}")
        return values

    def _places(self) -> NDArray[np.float64]:
        """Return places, shape (n, 3), metres; z is 0 where no column tells it."""
        if self._form == "KITTI":
            return self._matrix()[:, :, 3]
        axes: tuple[Role, ...] = ("x", "y", "z")
        places = np.stack([self._values(axis) / METRES.get(self._unit(axis) or "m", 1.0) for axis in axes], axis=1)
        if "z" not in self._columns:
            places[:, 2] = 0.0
        return places

    def _unit(self, role: Role) -> str | None:
        return self._columns[role].unit if role in self._columns else None

    def _matrix(self) -> NDArray[np.float64]:
        """Return the rows as [R | t], shape (n, 3, 4)."""
        values = np.full((len(self._rows), 12), math.nan)
        for index, (line, fields) in enumerate(self._rows):
            if all(map(is_number, fields)):
                values[index] = [float(field) for field in fields[:12]]
            else:
                odd = next(field for field in fields if not is_number(field))
                self._complain(line, f"'{shown(odd)}' is not a number; {_mend(odd)}")
        return values.reshape(-1, 3, 4)

    def _turns(self) -> NDArray[np.float64]:
        """Return rotations from body to world, shape (n, 3, 3), NaN where unknown."""
        unknown = np.full((len(self._rows), 3, 3), math.nan)
        if self._form == "KITTI":
            return self._matrix()[:, :, :3]
        if "qw" not in self._columns or not self._rows:
            return unknown
        parts: tuple[Role, ...] = ("qx", "qy", "qz", "qw")
        quaternions = np.stack([self._values(part) for part in parts], axis=1)
        norms = np.linalg.norm(quaternions, axis=1)
        given = np.isfinite(norms)
        sound = given & (np.abs(norms - 1) <= _UNIT)
        if given.any() and sound.sum() < _MOST * given.sum():
            message = (
                f"the quaternions are no unit quaternions (norm {np.median(norms[given]):.3g}); correct the columns"
            )
            self._findings.append(Finding("error", "bad-rotations", self._file, message))
            return unknown
        for index in np.flatnonzero(given & ~sound).tolist():
            message = f"a quaternion of norm {norms[index]:.3g} is not a rotation; the heading is left out"
            self._findings.append(Finding("warning", "bad-rotation", f"{self._file}:{self._rows[index][0]}", message))
        turns = unknown
        turns[sound] = matrices(quaternions[sound] / norms[sound, np.newaxis])
        return turns

    def _yaws(self, places: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the column of yaws, shape (n,), radians."""
        yaws, unit = self._values("yaw"), self._unit("yaw")
        title = shown(self._columns["yaw"].title)
        if unit is None and _in_degrees(places, yaws):
            largest = float(np.nanmax(np.abs(yaws)))
            message = f"{title} goes up to {largest:.4g}: taken for degrees; call it yaw_deg or yaw_rad to be sure"
            self._findings.append(Finding("warning", "yaw-in-degrees", self._file, message))
            unit = "deg"
        return np.radians(yaws) if unit == "deg" else yaws

    def _judge_turning(self, places: NDArray[np.float64], yaws: NDArray[np.float64]) -> None:
        """Note it if the robot turns the other way than it drives, as where two columns are swapped."""
        same, mirrored = _along(places, yaws)
        if mirrored >= _SAME_WAY and same <= _ANY_WAY:
            message = "headings turn the other way than the path: are x and y swapped, or is yaw clockwise?"
            self._findings.append(Finding("warning", "yaw-against-path", self._file, message))

    def _times(self) -> list[int | None]:
        column = self._columns.get("time")
        if column is None:
            return [None] * len(self._rows)
        numbers = self._exactly(column)
        if (rest := self._columns.get("nanoseconds")) is not None:
            parts = zip(numbers, self._exactly(rest), strict=True)
            numbers = [None if whole is None or part is None else whole + part / SECONDS["s"] for whole, part in parts]
        known = [number for number in numbers if number is not None]
        scale = SECONDS[column.unit] if column.unit in SECONDS else self._scale(known, shown(column.title))
        if scale is None:
            return [None] * len(self._rows)
        times: list[int | None] = []
        for (line, _), number in zip(self._rows, numbers, strict=True):
            time = None if number is None else round(number * scale)
            if time is not None and abs(time) > LARGEST_NS:
                self._complain(line, f"time '{number}' is out of range; correct it, or name its unit, such as time_ns")
                time = None
            times.append(time)
        return times

    def _exactly(self, column: Column) -> list[Decimal | None]:
        """Return the times in a column as they are written; None where it is blank or, which is said, no number."""
        numbers: list[Decimal | None] = []
        for line, fields in self._rows:
            text = fields[column.index]
            number = exact(text)
            if number is None and text:
                self._complain(line, f"{shown(column.title)} '{shown(text)}' is not a number; {_mend(text)}")
            numbers.append(number)
        return numbers

    def _scale(self, times: Sequence[Decimal], title: str) -> int | None:
        """Return how many nanoseconds the unit of times is of which only the size tells it; None if it does not."""
        try:
            unit = unit_of(times)
        except ValueError as error:
            self._findings.append(Finding("error", "unclear-times", self._file, f"{title} {error}"))
            return None
        if unit != "s":
            self._notes.append(f"{title} in {unit}")
        return SECONDS[unit]

    def _pose(self, index: int, pose: Pose, given: Sequence[float]) -> Pose | None:
        """Return the pose of a row; one that is nowhere is left as it was given, and said."""
        line, fields = self._rows[index]
        if self._form != "KITTI" and not (math.isfinite(given[0]) and math.isfinite(given[1])):
            blank = [axis for axis in ("x", "y") if not fields[self._columns[axis].index]]
            if len(blank) == 1:
                self._complain(line, f"{blank[0]} is blank; give all of the pose, or none of it")
            if blank:
                return None
        if line in self._faulty:  # it is said what is wrong with it
            return None
        if math.isfinite(pose.x) and math.isfinite(pose.y) and not math.isinf(pose.yaw):
            return pose
        pose = Pose(given[0], given[1], pose.yaw)
        self._findings += pose_remarks([(f"{self._file}:{line}", pose)], largest_yaw=math.inf)
        return pose


def _mend(text: str) -> str:
    return "write a decimal point, not a comma" if "," in text else "correct it, or the columns"


def _in_degrees(places: NDArray[np.float64], yaws: NDArray[np.float64]) -> bool:
    """Tell whether yaws of unknown unit are degrees: they go with the path so, or are too large for radians."""
    known = yaws[np.isfinite(yaws)]
    if not len(known):
        return False
    as_radians, as_degrees = max(_along(places, yaws)), max(_along(places, np.radians(yaws)))
    if as_degrees >= _SAME_WAY and as_radians <= _ANY_WAY:
        return True
    too_large = bool(np.abs(known).max() > _FULL_TURN)
    return too_large and not (as_radians >= _SAME_WAY and as_degrees <= _ANY_WAY)


def _along(places: NDArray[np.float64], yaws: NDArray[np.float64]) -> tuple[float, float]:
    """Return how steadily yaws differ from the direction of driving, and how steadily they add up with it, 0 to 1.

    1 is a constant difference, as of a robot that drives ahead. Both are 0 where it hardly moves, and the second where
    it drives into one direction only, so that nothing can be told.
    """
    moves = np.diff(places, axis=0)
    lengths = np.hypot(*moves.T)
    usable = np.isfinite(lengths) & np.isfinite(yaws[1:])
    long_enough = usable & (lengths > 0.5 * median(lengths[usable].tolist())) if usable.any() else usable
    ways, looks = np.arctan2(moves[long_enough, 1], moves[long_enough, 0]), yaws[1:][long_enough]
    if len(ways) < _FEW_MOVES:
        return 0.0, 0.0
    straight = _steadiness(ways) > _SAME_WAY
    return _steadiness(ways - looks), 0.0 if straight else _steadiness(ways + looks)


def _steadiness(angles: NDArray[np.float64]) -> float:
    """Return the mean resultant length of angles, 0 to 1."""
    return float(np.abs(np.exp(1j * angles).mean()))
