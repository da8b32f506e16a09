"""Tables of a report in Markdown and LaTeX."""

from __future__ import annotations

from itertools import islice

from omnieval.report.figure import Table
from omnieval.text_table import latex as tabular
from omnieval.text_table import latex_text, markdown_text, typeset
from omnieval.text_table import markdown as markdown_table


def markdown(table: Table) -> str:
    """Return a table in Markdown (GitHub's), groups as a first column where there are several."""
    named = [(name, *row) for name, rows in table.groups for row in rows]
    columns, rows = (["from", *table.columns], named) if len(table.groups) > 1 else (table.columns, table.rows)
    text = markdown_table(columns, rows, typeset)
    notes = "".join(f"\n{markdown_text(note)}\n" for note in table.notes)
    return f"### {markdown_text(table.title)}\n\n{text}\n{notes}"


def latex(table: Table) -> str:
    """Return a table in LaTeX, for the package ``booktabs``; notes and source stand in the caption."""
    begin, top, names, _, *body, bottom, end = tabular(table.columns, table.rows)
    caption = " ".join(map(latex_text, (f"{table.title}.", *table.notes)))
    remaining = iter(body)
    groups = []
    for name, rows in table.groups:
        span = rf"\multicolumn{{{len(table.columns)}}}{{l}}{{\emph{{{latex_text(name)}}}}} \\"
        groups += [r"\midrule", *([span] if name else []), *islice(remaining, len(rows))]
    head = [r"\begin{table}", r"\centering", rf"\caption{{{caption}}}", begin, top, names]
    return "\n".join([*head, *groups, bottom, end, r"\end{table}"]) + "\n"
