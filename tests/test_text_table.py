"""Tables as text."""

import re
from decimal import Decimal

import pytest

from omnieval.text_table import Cell, aligned, latex, latex_text, markdown, markdown_text, sides

HOSTILE = "\\cmd{x} & 50 % of n_new #1 $y^2$ ~a"


def cells(line, separator):
    return [cell.strip() for cell in re.split(rf"(?<!\\){re.escape(separator)}", line)]


def test_numbers_stand_at_the_right_and_text_at_the_left():
    rows: list[tuple[Cell, ...]] = [("a", 1, None, True), ("b", Decimal("2.50"), -0.5, False)]
    assert sides(4, rows) == "lrrl"
    table = markdown(("run", "nodes", "silhouette", "forced"), rows).splitlines()
    assert re.fullmatch(r"\|:-+\|-+:\|-+:\|:-+\|", table[1])
    assert cells(table[3], "|")[1:-1] == ["b", "2.50", "-0.5000", "no"]
    assert len({len(line) for line in table}) == 1


def test_a_table_without_rows_keeps_its_columns():
    assert markdown(("a", "b_"), []).splitlines() == [r"| a | b\_ |", "|--:|----:|"]
    assert latex(("a", "b"), [])[2:] == [r"a & b \\", r"\midrule", r"\bottomrule", r"\end{tabular}"]


def test_a_cell_is_never_taken_for_a_number_or_a_line():
    assert aligned([("  name", "1e3"), ("\x01", "0x10"), ("a\nb", "")], "ll") == [
        "  name  1e3",
        r"\x01    0x10",
        r"a\nb",
    ]
    assert aligned([], "ll") == []


@pytest.mark.parametrize(
    ("text", "escaped"),
    [("n_new", "n_new"), ("_a_", r"\_a\_"), ("a|b", r"a\|b"), ("<b>", r"\<b>"), ("a\n b", "a b"), ("`\\", r"\`\\")],
)
def test_markdown_says_the_text_itself(text, escaped):
    assert markdown_text(text) == escaped


def test_every_sign_of_latex_is_escaped():
    escaped = r"\textbackslash{}cmd\{x\} \& 50 \% of n\_new \#1 \$y\^{}2\$ \textasciitilde{}a"
    assert latex_text(HOSTILE) == escaped
    begin, top, head, rule, row, bottom, end = latex((HOSTILE, "n"), [(HOSTILE, -0.5)])
    assert (begin, end) == (r"\begin{tabular}{lr}", r"\end{tabular}")
    assert (top, rule, bottom) == (r"\toprule", r"\midrule", r"\bottomrule")
    assert cells(head.removesuffix(r"\\"), "&") == [escaped, "n"]
    assert cells(row.removesuffix(r"\\"), "&") == [escaped, "$-$0.5000"]


def test_missing_values_and_greek_are_typeset():
    assert [cells(line.removesuffix(r"\\"), "&") for line in latex(("Ω", "γ"), [(None, 1)])[2:5:2]] == [
        [r"$\Omega$", r"$\gamma$"],
        ["--", "1"],
    ]
