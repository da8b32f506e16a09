"""When images were taken, where a table beside them says so and their names do not have to.

=========== ============================ ===========================================
layout      images                       table
=========== ============================ ===========================================
TUM         ``rgb/``                     ``rgb.txt`` above: time and name
EuRoC       ``cam0/data/``               ``cam0/data.csv``: time [ns] and name
KITTI       ``image_0/``                 ``times.txt`` above: a time an image
KITTI, raw  ``image_00/data/``           ``image_00/timestamps.txt``: a date an image
any         any                          ``times`` or ``timestamps``, as txt or csv, beside the images
=========== ============================ ===========================================
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from omnieval.datasets.findings import Finding
from omnieval.datasets.scan import visible_names
from omnieval.datasets.trajectory.clock import LARGEST_NS, exact, unit_of
from omnieval.datasets.trajectory.columns import SECONDS, role_of
from omnieval.datasets.trajectory.naming import NameIndex
from omnieval.datasets.trajectory.text import TextTable, is_number, read_text_table
from omnieval.errors import DatasetError
from omnieval.wording import counted, shown

_STEMS = frozenset(("times", "timestamps", "timestamp", "image_times", "image_timestamps", "rgb"))
_ENDINGS = frozenset(("txt", "csv"))
_DATE = re.compile(r"([0-9]{4}-[0-9]{2}-[0-9]{2})[ T]([0-9]{2}:[0-9]{2}:[0-9]{2})(?:\.([0-9]{1,9}))?Z?")


@dataclass(frozen=True)
class _Row:
    name: str | None
    time_ns: int


def times_beside(root: Path, names: Sequence[str]) -> tuple[dict[str, int], list[Finding]]:
    """Return the times of images, nanoseconds by name, that a table beside their folder or in it tells.

    Empty where there is none, or several may be meant, or what it says does not fit the images; the findings say so.

    Parameters
    ----------
    root
        The folder of the images.
    names
        Their names within it, in natural order.
    """
    found = [root / name for name in visible_names(root) if _may_hold_times(name)] or _above(root)
    if not found or not names:
        return {}, []
    labels = [shown(path.relative_to(root if path.is_relative_to(root) else root.parent).as_posix()) for path in found]
    if len(found) > 1:
        message = f"{', '.join(labels)} may all hold the times of the images, and none is read; keep one"
        return {}, [Finding("warning", "unread-times", labels[0], message)]
    try:
        rows, words = _rows(found[0].read_bytes())
        times, way = _joined(names, rows)
    except OSError as error:
        return {}, [_unread(labels[0], f"cannot be read: {error.strerror or error}")]
    except (DatasetError, ValueError) as error:
        return {}, [_unread(labels[0], str(error))]
    said = f"times of images{words}, joined {way}: {len(times)} of {counted(len(names), 'image')}"
    findings = [Finding("info", "times-read", labels[0], said)]
    if len(times) < len(names):
        first = next(name for name in names if name not in times)
        lacking = f"has no time of {len(names) - len(times)} of {len(names)} images, such as {shown(first)}"
        findings.append(Finding("warning", "image-without-time", labels[0], lacking))
    return times, findings


def _unread(label: str, why: str) -> Finding:
    return Finding("warning", "unread-times", label, f"is not read as times of the images: {why}")


def _may_hold_times(name: str) -> bool:
    stem, _, ending = name.casefold().rpartition(".")
    return ending in _ENDINGS and stem in _STEMS


def _above(root: Path) -> list[Path]:
    """Return the tables of well-known layouts that lie above the folder of the images."""
    above = {"data": ("data.csv", "timestamps.txt"), "rgb": ("rgb.txt", "times.txt")}.get(root.name, ("times.txt",))
    return [path for name in above if (path := root.parent / name).is_file()]


def _rows(data: bytes) -> tuple[list[_Row], str]:
    """Return what a table says, and in words what it was taken for.

    Raises
    ------
    DatasetError
        If it is not text.
    ValueError
        If it is not of times, or their unit is not clear.
    """
    lines = [line.strip() for line in data.decode("utf-8", "replace").splitlines() if line.strip()]
    dates = [_DATE.fullmatch(line) for line in lines]
    if lines and all(dates):
        return [_Row(None, _of_date(date)) for date in dates if date], ", dates"
    table = read_text_table(data)
    time, name, unit = _columns(table)
    rows = [fields for _, fields in table.rows if len(fields) == table.width]
    numbers = [exact(fields[time]) for fields in rows]
    if len(rows) < len(table.rows) or None in numbers:
        raise ValueError("not every row has a time")
    known = [number for number in numbers if number is not None]
    unit = unit or unit_of(known)
    stamps = [round(number * SECONDS[unit]) for number in known]
    if any(abs(stamp) > LARGEST_NS for stamp in stamps):
        raise ValueError("its times are out of range")
    rows_of = [_Row(None if name is None else fields[name], at) for fields, at in zip(rows, stamps, strict=True)]
    return rows_of, "" if unit == "s" else f" in {unit}"


def _columns(table: TextTable) -> tuple[int, int | None, str | None]:
    """Return which columns hold time and name (None: none does), and the unit if it is named."""
    if table.heading is not None:
        roles = [role_of(title) for title in table.heading[1]]
        times = [index for index, (role, _) in enumerate(roles) if role == "time"]
        names = [index for index, (role, _) in enumerate(roles) if role == "name"]
        if len(times) != 1 or len(names) > 1:
            raise ValueError("its heading does not name one column of times")
        return times[0], next(iter(names), None), roles[times[0]][1]
    if table.width == 1:
        return 0, None, None
    numeric = [all(is_number(fields[column]) for _, fields in table.rows if len(fields) == 2) for column in range(2)]
    if table.width != 2 or numeric not in ([True, False], [False, True]):
        raise ValueError(f"it has {counted(table.width, 'column')} without a heading; a time, or a time and a name")
    return numeric.index(True), numeric.index(False), None


def _joined(names: Sequence[str], rows: Sequence[_Row]) -> tuple[dict[str, int], str]:
    """Return times by the images' names, and how rows were joined to images."""
    if all(row.name is None for row in rows):
        if len(rows) != len(names):
            raise ValueError(f"{counted(len(rows), 'time')} for {counted(len(names), 'image')}")
        return {name: row.time_ns for name, row in zip(names, rows, strict=True)}, "one after the other"
    index = NameIndex(names)
    times: dict[str, int] = {}
    for row in rows:
        meant = index.meant(row.name or "")
        if len(meant) > 1 or (meant and times.get(meant[0], row.time_ns) != row.time_ns):
            raise ValueError(f"{shown(row.name or '')} has two times, or may mean two images")
        times |= dict.fromkeys(meant, row.time_ns)
    if not times:
        raise ValueError(f"it names {shown(rows[0].name or '')}, and the first image is {shown(names[0])}")
    return times, "by name"


def _of_date(date: re.Match[str]) -> int:
    """Return nanoseconds since the epoch of a date and time of day, taken for those of UTC."""
    whole = datetime.fromisoformat(f"{date[1]} {date[2]}").replace(tzinfo=UTC)
    return int(whole.timestamp()) * SECONDS["s"] + int((date[3] or "0").ljust(9, "0"))
