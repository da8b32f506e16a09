"""How names from disk and from the command line are put into words, and into file names."""

from __future__ import annotations

import difflib
import re
import unicodedata
from collections.abc import Iterable

_LONGEST_NAME = 100
_LEFT_OUT = "..."

_LATEX = {
    "\\": r"\textbackslash{}",
    "&": r"\&",
    "%": r"\%",
    "$": r"\$",
    "#": r"\#",
    "_": r"\_",
    "{": r"\{",
    "}": r"\}",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    "–": "--",
    "−": "$-$",
    "Ω": r"$\Omega$",
    "γ": r"$\gamma$",
}


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


def latex_text(text: str) -> str:
    r"""Return text with everything escaped that LaTeX would take for a command.

    Examples
    --------
    >>> latex_text("50 % of n_new & more")
    '50 \\% of n\\_new \\& more'
    """
    return "".join(_LATEX.get(character, character) for character in " ".join(text.split()))
