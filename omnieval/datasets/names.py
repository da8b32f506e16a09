"""What the names of image files tell: their natural order, and perhaps when the images were taken."""

from __future__ import annotations

import re

_NUMBER = re.compile(r"((?<![0-9]\.)[0-9]+\.[0-9]+(?!\.?[0-9])|[0-9]+)")
"""A whole or decimal number; what more than one point divides, such as a date, is several whole ones."""
_EPOCH = re.compile(r"(?<![0-9.])(1[0-9]{9})(?:\.([0-9]{1,9})|([0-9]{3}|[0-9]{6}|[0-9]{9}))?(?![0-9])(?!\.[0-9])")
"""Seconds since the epoch, from 2001 to 2033, with decimals; or whole milli-, micro- or nanoseconds."""

NaturalKey = tuple[list[str | tuple[int, str]], str]


def natural_key(name: str) -> NaturalKey:
    """Return the key that sorts numbers within names by value, decimals too, whatever the case of the letters.

    Examples
    --------
    >>> sorted(["file10.png", "file2.png", "t12.345.png", "t9.1.png", "img_1.5.png", "img_1.10.png"], key=natural_key)
    ['file2.png', 'file10.png', 'img_1.10.png', 'img_1.5.png', 't9.1.png', 't12.345.png']
    """
    pieces = _NUMBER.split(name.casefold())
    return [_value(piece) if index % 2 else piece for index, piece in enumerate(pieces)], name


def time_in_name(stem: str) -> int | None:
    """Return when an image was taken, nanoseconds since the epoch, if its name without ending holds one such number.

    Examples
    --------
    >>> time_in_name("1403636579763555584"), time_in_name("t1152904768.652404_x-1.511887"), time_in_name("img_12")
    (1403636579763555584, 1152904768652404000, None)
    """
    found = _EPOCH.findall(stem)
    if len(found) != 1:
        return None
    seconds, decimals, smaller = found[0]
    return int(seconds) * 10**9 + int((decimals or smaller).ljust(9, "0"))


def _value(number: str) -> tuple[int, str]:
    """Return a number as its whole part and its decimals, which compare as text once the zeros at the end are gone."""
    whole, _, decimals = number.partition(".")
    return int(whole), decimals.rstrip("0")
