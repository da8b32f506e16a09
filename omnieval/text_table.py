"""Tables as text: aligned for a terminal, in Markdown, and in LaTeX. Whatever stands in a cell stays text."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from decimal import Decimal

from tabulate import LATEX_ESCAPE_RULES, tabulate

from omnieval.wording import shown

Cell = str | int | float | Decimal | None
"""A float is shown with four decimals, a decimal number as it is, a truth value as yes or no."""

_SIDES = {"l": "left", "r": "right"}
_MARKDOWN = re.compile(r"[\\`*\[<#|~]|\b_+|_+\b")
_SIGNS = str.maketrans({"–": "--", "−": "$-$", "Ω": r"$\Omega$", "γ": r"$\gamma$"})
_LATEX = str.maketrans(LATEX_ESCAPE_RULES)


def cell_text(cell: Cell) -> str:
    """Return a cell as text for a terminal.

    Examples
    --------
    >>> [cell_text(cell) for cell in (0.5, 8, None, -0.25, True, "a-b")]
    ['0.5000', '8', '-', '-0.2500', 'yes', 'a-b']
    """
    if cell is None:
        return "-"
    if isinstance(cell, bool):
        return "yes" if cell else "no"
    return f"{cell:.4f}" if isinstance(cell, float) else str(cell)


def typeset(cell: Cell) -> str:
    """Return a cell as text for print: with a true minus sign, and a dash for nothing.

    Examples
    --------
    >>> [typeset(cell) for cell in (0.5, 8, None, -0.25, True, "a-b")]
    ['0.5000', '8', '–', '−0.2500', 'yes', 'a-b']
    """
    if cell is None:
        return "–"
    return cell if isinstance(cell, str) else cell_text(cell).replace("-", "−")


def sides(columns: int, rows: Iterable[Sequence[Cell]]) -> str:
    """Return for each column ``r`` if it holds numbers, which stand at its right, and ``l`` if it holds text."""
    numbers = [True] * columns
    for row in rows:
        for column, cell in enumerate(row):
            numbers[column] &= cell is None or (isinstance(cell, int | float | Decimal) and not isinstance(cell, bool))
    return "".join("r" if number else "l" for number in numbers)


def aligned(rows: Iterable[Sequence[str]], at: str) -> list[str]:
    """Return one line per row, with columns two spaces apart.

    Parameters
    ----------
    rows
        Their cells.
    at
        The side of each column, ``l`` or ``r``.

    Examples
    --------
    >>> aligned([("nodes", "3"), ("gamma", "12")], "lr")
    ['nodes   3', 'gamma  12']
    """
    return _table([list(map(shown, row)) for row in rows], at, "plain")


def markdown(columns: Sequence[str], rows: Sequence[Sequence[Cell]], write: Callable[[Cell], str] = cell_text) -> str:
    r"""Return a table in Markdown (GitHub's).

    Parameters
    ----------
    columns
        Their names.
    rows
        Their cells.
    write
        How a cell becomes text.

    Examples
    --------
    >>> print(markdown(("run", "n_new"), [("a|b", 20)]))
    | run  | n_new |
    |:-----|------:|
    | a\|b |    20 |
    """
    texts = [[markdown_text(write(cell)) for cell in row] for row in (columns, *rows)]
    rule, head, *body = _table(texts, sides(len(columns), rows), "pipe")
    return "\n".join([head, rule, *body])


def latex(columns: Sequence[str], rows: Sequence[Sequence[Cell]]) -> list[str]:
    """Return the lines of a ``tabular`` for the package ``booktabs``: four of its head, one a row, two of its end."""
    texts = [[_one_line(typeset(cell)) for cell in row] for row in (columns, *rows)]
    lines = _table(texts, sides(len(columns), rows), "latex_booktabs")
    begin, top, head, *others = (line.translate(_SIGNS).strip() for line in lines)
    return [begin, top, head, r"\midrule", *others]


def markdown_text(text: str) -> str:
    r"""Return text in which nothing means anything to Markdown.

    Examples
    --------
    >>> print(markdown_text("n_new of *all* <b> in __a__"))
    n_new of \*all\* \<b> in \_\_a\_\_
    """
    return _MARKDOWN.sub(lambda found: re.sub(r"(.)", r"\\\1", found[0]), _one_line(text))


def latex_text(text: str) -> str:
    r"""Return text with everything escaped that LaTeX would take for a command.

    Examples
    --------
    >>> latex_text("50 % of n_new & more")
    '50 \\% of n\\_new \\& more'
    """
    return _one_line(text).translate(_LATEX).translate(_SIGNS)


def _table(rows: Sequence[Sequence[str]], at: str, form: str) -> list[str]:
    # Names of columns are a row like others, since tabulate makes room around headers. Cells are text already: none
    # shall be taken for a number, and no indented name for a sloppy one.
    places = [_SIDES[side] for side in at]
    text = tabulate(rows, tablefmt=form, colalign=places, disable_numparse=True, preserve_whitespace=True)
    return text.splitlines()


def _one_line(text: str) -> str:
    return shown(" ".join(text.split()))
