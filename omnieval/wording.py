"""How names from disk and from the command line, and numbers, are put into words; and names into file names."""

from __future__ import annotations

import difflib
import re
import unicodedata
from collections.abc import Iterable, Mapping
from pathlib import Path
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


def near_path(path: Path) -> str:
    """Return the hint that ends a message about a path that is not there: what in its folder is called alike."""
    try:
        names = sorted(
            shown(one.name) for one in path.parent.iterdir() if not one.name.startswith(".") and one.name != path.name
        )
    except OSError:
        names = []
    return did_you_mean(path.name, names, otherwise="check the path")


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
    """Return a number with this many decimals and a true minus sign.

    Examples
    --------
    >>> decimals(-0.0723), decimals(1.25, 1)
    ('−0.072', '1.2')
    """
    return f"{value:.{places}f}".replace("-", "−")


_SIZES = {"kB": 10**3, "MB": 10**6, "GB": 10**9, "TB": 10**12}
_TIMES = {"h": 3600.0, "d": 86_400.0, "w": 7 * 86_400.0}


def bytes_in_words(count: int) -> str:
    """Return a number of bytes as a person reads it, with powers of ten.

    Examples
    --------
    >>> bytes_in_words(12_345_678), bytes_in_words(512), bytes_in_words(2_000_000_000)
    ('12.3 MB', '512 bytes', '2.0 GB')
    """
    unit, size = next(((unit, size) for unit, size in reversed(_SIZES.items()) if count >= size), ("bytes", 1))
    return f"{count} {unit}" if size == 1 else f"{count / size:.1f} {unit}"


def parse_bytes(text: str) -> int:
    """Read a size: a number and kB, MB, GB or TB, powers of ten; without these, bytes.

    Raises
    ------
    ValueError
        What is expected, if it is none.

    Examples
    --------
    >>> parse_bytes("10GB"), parse_bytes("1.5 kb"), parse_bytes("0")
    (10000000000, 1500, 0)
    """
    return round(_amount(text, {**_SIZES, "": 1}, "a size such as 10GB or 500MB"))


def parse_seconds(text: str) -> float:
    """Read a time: a number and h, d or w; errors are as of `parse_bytes`.

    Examples
    --------
    >>> parse_seconds("12h"), parse_seconds("2d")
    (43200.0, 172800.0)
    """
    return _amount(text, _TIMES, "a time such as 30d, 12h or 4w")


def _amount(text: str, units: Mapping[str, float], expected: str) -> float:
    found = re.fullmatch(r"\s*([0-9]+(?:\.[0-9]+)?)\s*([A-Za-z]*)\s*", text)
    by_name = {unit.casefold(): size for unit, size in units.items()}
    size = by_name.get(found[2].casefold()) if found else None
    if found is None or size is None:
        raise ValueError(f"{expected}, not {shown(text)!r}")
    return float(found[1]) * size
