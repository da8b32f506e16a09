"""Tables as HTML, Markdown and LaTeX: whatever stands in a cell stays text."""

import re
from decimal import Decimal
from html.parser import HTMLParser

import pytest

from omnieval.report.figure import Content, Section, Table
from omnieval.report.markup import latex, markdown
from omnieval.report.page import page
from omnieval.text_table import typeset

HOSTILE = "a|b <script>alert(1)</script> & 50 % of n_new \\cmd{x} $y^2$ `c` ~#*\n| new row |"
TABLE = Table(
    "t",
    "Best & median_of 100 %",
    ("what", "silhouette", "y"),
    (
        ("Ours", ((HOSTILE, 0.34564, Decimal("0.75")), ("plain", None, None))),
        ("Theirs", (("x", -0.5, Decimal("2.0")),)),
    ),
    ("A note about 5 % & more.",),
)


HTML = page(Content("Best & worst", (Section("Tables", (), (TABLE,)),)), {}, "1")


def unescaped_split(line, separator):
    return re.split(rf"(?<!\\){re.escape(separator)}", line)


def test_markdown_has_as_many_cells_in_every_row():
    lines = [line for line in markdown(TABLE).splitlines() if line.startswith("|")]
    assert {len(unescaped_split(line, "|")) for line in lines} == {6}
    assert len(lines) == 2 + 3
    assert re.fullmatch(r"\|:-+\|:-+\|-+:\|-+:\|", lines[1])
    assert "<script>" not in markdown(TABLE).replace("\\<", "")
    assert "0.3456" in lines[2]
    assert "−0.5000" in lines[4]


def test_latex_has_as_many_cells_in_every_row_and_nothing_unescaped():
    text = latex(TABLE)
    rows = [line for line in text.splitlines() if line.endswith(r"\\") and "multicolumn" not in line]
    assert {len(unescaped_split(row, "&")) for row in rows} == {3}
    assert len(rows) == 4
    body = "\n".join(rows)
    assert not re.search(r"(?<!\\)[%#_~^]", body)
    assert r"\textbackslash{}cmd\{x\}" in body
    assert text.count(r"\begin{") == text.count(r"\end{") == 2
    assert r"\caption{Best \& median\_of 100 \%. A note about 5 \% \& more.}" in text
    assert r"\begin{tabular}{lrr}" in text
    depth = 0
    for brace in re.findall(r"(?<!\\)[{}]", text):
        depth += 1 if brace == "{" else -1
        assert depth >= 0
    assert depth == 0


class Cells(HTMLParser):
    def __init__(self):
        super().__init__()
        self.tags, self.rows, self.open = [], [], []

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        if tag in {"meta", "link"}:
            return
        self.open.append(tag)
        if tag == "tr":
            self.rows.append([])
        if tag in {"td", "th"}:
            self.rows[-1].append("")

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if {"td", "th"} & set(self.open):
            self.rows[-1][-1] += data


def test_html_is_well_formed_and_shows_text_as_text():
    cells = Cells()
    cells.feed(HTML)
    assert cells.open == []
    assert "script" not in cells.tags
    assert cells.rows[0] == ["what", "silhouette", "y"]
    assert cells.rows[1] == ["Ours"]
    assert cells.rows[2] == [HOSTILE, "0.3456", "0.75"]
    assert cells.rows[3] == ["plain", "–", "–"]


def test_html_names_rows_and_columns_for_screen_readers():
    assert HTML.count('scope="col"') == 3
    assert HTML.count('scope="row"') == 3
    assert HTML.count('scope="rowgroup"') == 2
    assert "<caption>Best &amp; median_of 100 %</caption>" in HTML


@pytest.mark.parametrize(
    ("cell", "text"),
    [(None, "–"), (8, "8"), (-0.07234, "−0.0723"), (Decimal("-0.15"), "−0.15"), ("seq-1", "seq-1"), (0.5, "0.5000")],
)
def test_cells_as_text(cell, text):
    assert typeset(cell) == text
