"""How names from disk and from the command line, and numbers, are put into words; and names into file names."""

from __future__ import annotations

import difflib
import re
import unicodedata
from collections.abc import Iterable
from typing import Any

_LONGEST_NAME = 100
_LEFT_OUT = "..."


def shown(text: str) -> str:
    """Return `text` fit for one line of a message: whatever cannot be printed is escaped."""
    return text if text.isprintable() else repr(text)[1:-1]


def did_you_mean(word: str, options: Iterable[str], *, otherwise: str | None = None) -> str:
    """Return the hint that ends a message about an unknown `word`.

    Parameters
    ----------
    word
        What was given.
    options
        What would have been right.
    otherwise
        What to say when none of them is near; default: all of them.

    Examples
    --------
    >>> did_you_mean("cloudly", ["cloudy", "night"])
    'did you mean cloudy?'
    >>> did_you_mean("x", ["cloudy", "night"])
    'known are cloudy, night'
    """
    known = list(options)
    nearest = difflib.get_close_matches(word.casefold(), known, n=1)
    return f"did you mean {nearest[0]}?" if nearest else otherwise or f"known are {', '.join(known)}"


def safe_name(text: str) -> str:
    """Return `text` as a plain file name: letters of any script, digits, ``_``, ``.`` and ``-``.

    Of a name that is too long the middle is left out: its end tells more, such as the descriptor of a run.

    Examples
    --------
    >>> safe_name("my house: seq 1")
    'my-house-seq-1'
    """
    normal = unicodedata.normalize("NFC", text)
    name = re.sub(r"[^\w.-]+", "-", normal).strip("-.")
    if len(name) > _LONGEST_NAME:
        kept = _LONGEST_NAME - len(_LEFT_OUT)
        name = name[: kept - kept // 2] + _LEFT_OUT + name[-(kept // 2) :]
    return name or "sequence"


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
