"""Small words that captions share."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any


def sentences(parts: Iterable[str]) -> str:
    """Join the sentences that are there.

    Examples
    --------
    >>> sentences(["One.", "", "Two."])
    'One. Two.'
    """
    return " ".join(filter(None, parts))


def value_text(value: Any) -> str:
    """Return a value of a parameter or table as one writes it.

    Examples
    --------
    >>> value_text(1.70), value_text(20), value_text(None)
    ('1.7', '20', '–')
    """
    if value is None:
        return "–"
    return f"{value:g}" if isinstance(value, float) else str(value)


def counted(number: int, noun: str) -> str:
    """Return a number and its noun.

    Examples
    --------
    >>> counted(1, "node"), counted(3, "node")
    ('1 node', '3 nodes')
    """
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


def ordinal(number: int) -> str:
    """Return a number as an ordinal.

    Examples
    --------
    >>> [ordinal(number) for number in (2, 3, 4, 11, 21, 113)]
    ['2nd', '3rd', '4th', '11th', '21st', '113th']
    """
    ending = "th" if number % 100 in {11, 12, 13} else {1: "st", 2: "nd", 3: "rd"}.get(number % 10, "th")
    return f"{number}{ending}"


def decimals(value: float, places: int = 3) -> str:
    """Return a number with so many decimals and a true minus sign.

    Examples
    --------
    >>> decimals(-0.0723), decimals(1.25, 1)
    ('−0.072', '1.2')
    """
    return f"{value:.{places}f}".replace("-", "−")
