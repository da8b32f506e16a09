"""Rows of fields out of a text of unknown delimiter, with or without a heading and comments."""

from __future__ import annotations

import codecs
import csv
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

from omnieval.datasets.trajectory.columns import role_of
from omnieval.errors import DatasetError
from omnieval.wording import shown

_DELIMITERS = (",", ";", "\t", None)
"""The delimiter of each kind of text; None is any white space."""
_COMMENTS = ("#", "%")
_SAMPLE = 60
"""Rows that are looked at to find the delimiter."""
_NUMBER = re.compile(r"[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?|[-+]?(?:nan|inf|infinity)", re.IGNORECASE)
_DECIMAL_COMMA = re.compile(r"[-+]?[0-9]*,[0-9]+(?:[eE][-+]?[0-9]+)?")

Line = tuple[int, tuple[str, ...]]
"""A line's number and its fields."""


@dataclass(frozen=True)
class TextTable:
    """What a text holds.

    Attributes
    ----------
    heading
        The line that names the columns; None if there is none.
    rows
        The others, but for comments and empty lines.
    delimiter
        What separates the fields; None for white space.
    decimal_comma
        Whether commas stand for decimal points; `rows` has points.
    """

    heading: Line | None
    rows: tuple[Line, ...]
    delimiter: str | None
    decimal_comma: bool

    @cached_property
    def width(self) -> int:
        """Number of fields that most rows have."""
        return Counter(len(fields) for _, fields in self.rows).most_common(1)[0][0] if self.rows else 0


def is_number(field: str) -> bool:
    """Tell whether a field is a number with a decimal point."""
    return _NUMBER.fullmatch(field) is not None


def read_text_table(data: bytes) -> TextTable:
    """Return the rows of a text.

    Raises
    ------
    DatasetError
        If it is not text, or is empty.
    """
    lines = [(number, line) for number, line in enumerate(_lines(data), start=1) if line.strip()]
    comments = [one for one in lines if one[1].lstrip().startswith(_COMMENTS)]
    aside = {number for number, _ in comments}
    plain = [one for one in lines if one[0] not in aside]
    if not plain:
        raise DatasetError("it has no rows; is it the right file?")
    delimiter = _delimiter([line for _, line in plain[:_SAMPLE]])
    rows = list(_split(plain, delimiter))
    heading = rows.pop(0) if _names_columns(rows[0][1]) else _heading_in_comments(lines, delimiter, rows)
    if heading is not None:
        # A name of an image may begin like a comment.
        named = [one for one in comments if one[0] > heading[0]]
        rows = sorted([*rows, *(row for row in _split(named, delimiter) if _is_row(row, heading))])
    commas = delimiter != "," and _has_decimal_commas(rows)
    if commas:
        rows = [(number, tuple(map(_pointed, fields))) for number, fields in rows]
    filled = tuple(row for row in rows if any(row[1]))
    return TextTable(heading, filled, delimiter, commas)


def _lines(data: bytes) -> list[str]:
    try:
        text = data.decode("utf-16" if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)) else "utf-8-sig")
    except UnicodeDecodeError as error:
        raise DatasetError("not UTF-8 text; save it as UTF-8") from error
    if "\0" in text:
        raise DatasetError("not a text; save the table as CSV")
    return text.replace("\r\n", "\n").replace("\r", "\n").split("\n")


def _delimiter(lines: Sequence[str]) -> str | None:
    """Return what separates fields: gives most lines the same number of them, and most of these are numbers."""
    best = 0.0
    found: str | None = ","
    for candidate in _DELIMITERS:
        rows = [_fields(line, candidate) for line in lines]
        width, alike = Counter(map(len, rows)).most_common(1)[0]
        if width < 2:
            continue
        fields = [field for row in rows for field in row]
        numbers = sum(is_number(field) or not field or _is_decimal_comma(field, candidate) for field in fields)
        score = alike / len(rows) * (numbers + 1) / (len(fields) + 1)
        if score > best:
            best, found = score, candidate
    return found


def _is_decimal_comma(field: str, delimiter: str | None) -> bool:
    return delimiter != "," and _DECIMAL_COMMA.fullmatch(field) is not None


def _fields(line: str, delimiter: str | None) -> list[str]:
    return line.split() if delimiter is None else [field.strip() for field in line.split(delimiter)]


def _split(lines: Sequence[tuple[int, str]], delimiter: str | None) -> Iterator[Line]:
    if delimiter is None:
        for number, line in lines:
            yield number, tuple(line.split())
        return
    numbers = [number for number, _ in lines]
    reader = csv.reader((f"{line}\n" for _, line in lines), delimiter=delimiter, strict=True)
    try:
        for fields in reader:
            yield numbers[reader.line_num - 1], tuple(map(str.strip, fields))
    except csv.Error as error:
        at = numbers[max(0, reader.line_num - 1)]
        raise DatasetError(f"line {at} is not delimited text ({shown(str(error))}); mend it") from error


def _names_columns(fields: Sequence[str]) -> bool:
    """Tell whether a line is a heading: words, and no number among them."""
    filled = [field for field in fields if field]
    return len(filled) > 1 and not any(is_number(field) or _DECIMAL_COMMA.fullmatch(field) for field in filled)


def _heading_in_comments(lines: Sequence[tuple[int, str]], delimiter: str | None, rows: Sequence[Line]) -> Line | None:
    """Return the last comment above the rows that names as many columns as they have; None if there is none."""
    width = Counter(len(fields) for _, fields in rows).most_common(1)[0][0]
    above = [(number, line) for number, line in lines if number < rows[0][0]]
    for above_them, line in reversed(above):
        words = line.strip().lstrip("#%").strip()
        for separator in (delimiter, None, ","):
            fields = _fields(words, separator)
            if len(fields) == width and _names_columns(fields) and _are_known(fields):
                return above_them, tuple(fields)
    return None


def _are_known(fields: Sequence[str]) -> bool:
    """Tell whether words name columns, and are not a sentence of as many words."""
    return sum(role_of(field)[0] is not None for field in fields) > 1


def _is_row(row: Line, heading: Line) -> bool:
    return len(row[1]) == len(heading[1]) and any(is_number(field) for field in row[1])


def _has_decimal_commas(rows: Sequence[Line]) -> bool:
    with_commas = (field for _, row in rows for field in row if "," in field)
    if not any(map(_DECIMAL_COMMA.fullmatch, with_commas)):
        return False
    return not any("." in field and is_number(field) for _, row in rows for field in row)


def _pointed(field: str) -> str:
    return field.replace(",", ".") if _DECIMAL_COMMA.fullmatch(field) else field
