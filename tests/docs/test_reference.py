"""What the documentation lists is what there is: columns, keys, parameters, metrics, commands."""

import json
import runpy

import pytest

from omnieval.config import parameters
from omnieval.mapping.step import Placement, Verdict
from omnieval.metrics.evaluation import METRICS
from omnieval.results.schemas import ABLATION, NODES, PARTITIONS, STEPS, TRANSITIONS
from tests.cli.test_cli import SMALL, in_process
from tests.docs.pages import ROOT, section, tables

DOCS = ROOT / "docs"
COLUMNS = (DOCS / "columns.md").read_text("utf-8")
GROUPS = {"*metrics*": METRICS, "*parameters*": tuple(parameters())}
"""What a row of a table stands for."""


def first_cells(text):
    """Return the names in the first column of all tables, groups written out."""
    cells = [row[0] for table in tables(text) for row in table[1:]]
    return [name for cell in cells for name in GROUPS.get(cell, (cell.strip("`"),))]


@pytest.mark.parametrize(
    ("heading", "schema"),
    [
        ("steps.parquet", STEPS),
        ("nodes.parquet", NODES),
        ("transitions.parquet", TRANSITIONS),
        ("baseline.parquet", PARTITIONS),
        ("ablation.parquet", ABLATION),
    ],
)
def test_every_column_is_described_and_no_other(heading, schema):
    assert first_cells(section(COLUMNS, heading)) == list(schema)


def test_every_verdict_and_placement_is_described():
    steps = section(COLUMNS, "steps.parquet")
    rows = {row[0].strip("`"): row[3] for table in tables(steps) for row in table[1:]}
    assert [one for one in Verdict if f"`{one}`" not in rows["verdict"]] == []
    assert [one for one in Placement if f"`{one}`" not in rows["placement"]] == []


def test_every_key_of_a_complete_run_is_described_and_no_other(panoramas, tmp_path):
    assert in_process("replay", panoramas, *SMALL, "--no-images", "--out", "run", cwd=tmp_path).returncode == 0
    content = json.loads((tmp_path / "run" / "run.json").read_text())
    assert set(first_cells(section(COLUMNS, "run.json"))) == set(content)


def test_every_metric_is_described_and_no_other():
    text = (DOCS / "metrics.md").read_text("utf-8")
    assert {"nodes", *first_cells(text)} == set(METRICS)
    assert text.startswith("# Metrics\n")
    assert "`nodes`" in text


def test_the_readme_has_the_defaults():
    readme = (ROOT / "README.md").read_text("utf-8")
    rows = {row[0].strip("`"): row[1].strip("`") for row in next(tables(section(readme, "The method")))[1:]}
    assert {name: str(parameters()[name].default) for name in rows} == rows


@pytest.mark.parametrize("page", ["commands", "parameters"])
def test_generated_pages_are_current(page):
    made = runpy.run_path(str(DOCS / "reference.py"))[page]()
    assert (DOCS / f"{page}.md").read_text("utf-8") == made, "run: python docs/reference.py"


def test_the_explained_decision_of_the_readme_is_that_of_the_pictures():
    explained = (DOCS / "pictures" / "explained.txt").read_text("utf-8")
    assert f"```text\n{explained.rstrip()}\n```" in (ROOT / "README.md").read_text("utf-8")
