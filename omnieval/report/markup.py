"""Tables as HTML, Markdown and LaTeX; whatever stands in a cell stays text."""

from __future__ import annotations

import re
from collections.abc import Iterator
from decimal import Decimal
from html import escape

from omnieval.report.figure import Cell, Table
from omnieval.wording import latex_text

_MARKDOWN = re.compile(r"([\\`*_{}\[\]<>#|~])")


def cell_text(cell: Cell) -> str:
    """Return a cell as text: four decimals for a fraction, a dash for nothing.

    Examples
    --------
    >>> cell_text(0.5), cell_text(8), cell_text(None), cell_text(-0.25)
    ('0.5000', '8', '–', '−0.2500')
    """
    if cell is None:
        return "–"
    if isinstance(cell, float):
        return f"{cell:.4f}".replace("-", "−")
    return str(cell).replace("-", "−") if isinstance(cell, Decimal) else str(cell)


def markdown(table: Table) -> str:
    """Return a table in Markdown (GitHub's), groups as a first column where there are several."""
    grouped = len(table.groups) > 1
    head = [*(["from"] if grouped else []), *table.columns]
    rows = [[*([name] if grouped else []), *map(cell_text, row)] for name, rows in table.groups for row in rows]
    right = [*([False] if grouped else []), *_numeric(table)]
    rule = ["---:" if numbers else "---" for numbers in right]
    lines = [_markdown_row(head), f"| {' | '.join(rule)} |", *map(_markdown_row, rows)]
    notes = "".join(f"\n{_markdown_text(note)}\n" for note in table.notes)
    return f"### {_markdown_text(table.title)}\n\n" + "\n".join(lines) + "\n" + notes


def latex(table: Table) -> str:
    """Return a table in LaTeX, for the package ``booktabs``; notes and source stand in the caption."""
    columns = "".join("r" if numbers else "l" for numbers in _numeric(table))
    caption = " ".join(map(latex_text, (f"{table.title}.", *table.notes)))
    lines = [
        r"\begin{table}",
        r"\centering",
        rf"\caption{{{caption}}}",
        rf"\begin{{tabular}}{{{columns}}}",
        r"\toprule",
        _latex_row(table.columns),
        *_latex_groups(table, len(columns)),
        r"\bottomrule",
        r"\end{tabular}",
        r"\end{table}",
    ]
    return "\n".join(lines) + "\n"


def html(table: Table, *, caption: str) -> str:
    """Return a table in HTML, in a box that scrolls by itself.

    Parameters
    ----------
    table
        The table.
    caption
        Its caption, as text.
    """
    numeric = _numeric(table)
    head = "".join(_head(name, numbers) for name, numbers in zip(table.columns, numeric, strict=True))
    bodies = "".join(_html_body(name, rows, numeric) for name, rows in table.groups)
    return (
        f'<div class="scroll" tabindex="0" role="region" aria-label="{escape(caption)}"><table>'
        f"<caption>{escape(caption)}</caption><thead><tr>{head}</tr></thead>{bodies}</table></div>"
        + "".join(f'<p class="note">{escape(note)}</p>' for note in table.notes)
    )


def _html_body(name: str, rows: tuple[tuple[Cell, ...], ...], numeric: list[bool]) -> str:
    span = f'<th scope="rowgroup" colspan="{len(numeric)}"><span>{escape(name)}</span></th>'
    head = f'<tr class="group">{span}</tr>' if name else ""
    return f"<tbody>{head}{''.join(_html_row(row, numeric) for row in rows)}</tbody>"


def _html_row(row: tuple[Cell, ...], numeric: list[bool]) -> str:
    first, *others = zip(map(cell_text, row), numeric, strict=True)
    cells = "".join(f"<td{_right(numbers)}>{escape(text)}</td>" for text, numbers in others)
    return f'<tr><th scope="row"{_right(first[1])}>{escape(first[0])}</th>{cells}</tr>'


def _head(name: str, numbers: bool, /) -> str:
    return f'<th scope="col"{_right(numbers)}>{escape(name)}</th>'


def _right(numbers: bool, /) -> str:
    return ' class="n"' if numbers else ""


def _numeric(table: Table) -> list[bool]:
    """Whether each column holds numbers."""
    rows = [row for _, rows in table.groups for row in rows]
    return [
        all(row[column] is None or isinstance(row[column], int | float | Decimal) for row in rows)
        for column in range(len(table.columns))
    ]


def _markdown_row(cells: list[str]) -> str:
    return f"| {' | '.join(map(_markdown_text, cells))} |"


def _markdown_text(text: str) -> str:
    return _MARKDOWN.sub(r"\\\1", " ".join(text.split()))


def _latex_row(cells: tuple[str, ...]) -> str:
    return " & ".join(map(latex_text, cells)) + r" \\"


def _latex_groups(table: Table, columns: int) -> Iterator[str]:
    for name, rows in table.groups:
        yield r"\midrule"
        if name:
            yield rf"\multicolumn{{{columns}}}{{l}}{{\emph{{{latex_text(name)}}}}} \\"
        for row in rows:
            yield _latex_row(tuple(map(cell_text, row)))
