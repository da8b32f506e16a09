"""What the names of image files tell: their natural order, and perhaps when the images were taken."""

from __future__ import annotations

import re
from collections.abc import Iterable

_NUMBER = re.compile(r"((?<![0-9]\.)[0-9]+\.[0-9]+(?!\.?[0-9])|[0-9]+)")
"""A whole or decimal number; what more than one point divides, such as a date, is several whole ones."""
_EPOCH = re.compile(r"(?<![0-9.])(1[0-9]{9})(?:\.([0-9]{1,9})|([0-9]{3}|[0-9]{6}|[0-9]{9}))?(?![0-9])(?!\.[0-9])")
"""Seconds since the epoch, from 2001 to 2033, with decimals; or whole milli-, micro- or nanoseconds."""

_DIGITS = re.compile(r"([0-9]+)")
_FEWEST_TWINS = 3

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


def twins(names: Iterable[str]) -> dict[str, str]:
    """Return the names that differ from others in words only, as those of masks do, each with its other.

    The others are those of the form that most names have, or of two forms as frequent the shorter. It takes three such
    pairs, and as many as half of the names of the rarer form.

    Examples
    --------
    >>> twins([f"img_{n}{end}" for n in range(3) for end in (".jpg", "_mask.png")])
    {'img_0_mask.png': 'img_0.jpg', 'img_1_mask.png': 'img_1.jpg', 'img_2_mask.png': 'img_2.jpg'}
    """
    forms: dict[str, dict[tuple[str, ...], str]] = {}
    for name in names:
        pieces = _DIGITS.split(name.casefold())
        forms.setdefault("#".join(pieces[::2]), {})[tuple(pieces[1::2])] = name
    main, *others = sorted(forms, key=lambda form: (-len(forms[form]), len(form), form)) or [""]
    found: dict[str, str] = {}
    for form in others:
        pairs = {
            name: forms[main][numbers] for numbers, name in forms[form].items() if numbers and numbers in forms[main]
        }
        if len(pairs) >= _FEWEST_TWINS and 2 * len(pairs) >= len(forms[form]):
            found |= pairs
    return found


def _value(number: str) -> tuple[int, str]:
    """Return a number as its whole part and its decimals, which compare as text once the zeros at the end are gone."""
    whole, _, decimals = number.partition(".")
    return int(whole), decimals.rstrip("0")
