"""What the documentation lists is what there is: columns, keys, parameters, metrics, commands."""

import doctest
import json
import re
import runpy

import polars as pl
import pytest

import omnieval
from omnieval.components.names import BUILT_IN, find_class
from omnieval.config import parameters
from omnieval.mapping.roman2020.evidence import Verdict
from omnieval.mapping.step import Placement, Role
from omnieval.metrics.evaluation import METRICS
from omnieval.results.schemas import (
    COMPARISON,
    NODES,
    PARTITIONS,
    QUALITY,
    STEPS,
    TRANSITIONS,
    ablation_schema,
    parameter_type,
)
from tests.cli.test_cli import SMALL, in_process
from tests.docs.pages import ROOT, section, tables

DOCS = ROOT / "docs"
COLUMNS = (DOCS / "columns.md").read_text("utf-8")
PARAMETERS = parameters(everything=False)
GROUPS = {"*metrics*": METRICS, "*parameters*": tuple(PARAMETERS)}
"""What a row of a table stands for."""
TABLES = {
    "steps.parquet": STEPS,
    "comparisons": pl.Schema({field.name: field.dtype for field in COMPARISON.fields}),
    "nodes.parquet": NODES,
    "transitions.parquet": TRANSITIONS,
    "quality.parquet": QUALITY,
    "baseline.parquet": PARTITIONS,
    "ablation.parquet": ablation_schema({name: parameter_type(field) for name, field in PARAMETERS.items()}),
}
"""Columns of the tables, by the headings under which they are described."""


def first_cells(text):
    """Return the names in the first column of all tables, groups written out."""
    cells = [row[0] for table in tables(text) for row in table[1:]]
    return [name for cell in cells for name in GROUPS.get(cell, (cell.strip("`"),))]


@pytest.mark.parametrize("heading", TABLES)
def test_every_column_is_described_and_no_other(heading):
    assert first_cells(section(COLUMNS, heading)) == list(TABLES[heading])


@pytest.mark.parametrize("heading", TABLES)
def test_every_column_has_the_type_that_is_described(heading):
    said = {row[0].strip("`"): row[1] for table in tables(section(COLUMNS, heading)) for row in table[1:]}
    assert {name: word_of(dtype) for name, dtype in TABLES[heading].items() if name in said} == {
        name: word for name, word in said.items() if name not in GROUPS
    }


def word_of(dtype):
    """Return the type of a column in a word."""
    if isinstance(dtype, pl.List):
        return "list" if isinstance(dtype.inner, pl.Struct) else f"list of {word_of(dtype.inner)}"
    words = {pl.String: "text", pl.Boolean: "bool", pl.Datetime: "time", pl.Enum: "choice"}
    return "int" if dtype.is_integer() else "float" if dtype.is_float() else words[dtype.base_type()]


def test_every_verdict_role_and_placement_is_described():
    rows = {row[0].strip("`"): row[3] for table in tables(section(COLUMNS, "steps.parquet")) for row in table[1:]}
    for column, words in {"verdict": Verdict, "role": Role, "placement": Placement}.items():
        assert [one for one in words if f"`{one}`" not in rows[column]] == []


def test_every_gate_and_column_that_a_mapper_declares_is_described():
    declared = section(COLUMNS, "What a mapper declares")
    for name in BUILT_IN["mapper"]:
        mapper = find_class("mapper", name)
        text = declared.split(f"\n### {name}\n")[1].split("\n### ")[0]
        assert first_cells(text) == [one.name for one in (*mapper.gates, *mapper.columns)]


def test_every_key_of_a_complete_run_is_described_and_no_other(panoramas, tmp_path):
    assert in_process("replay", panoramas, *SMALL, "--no-images", "--out", "run", cwd=tmp_path).returncode == 0
    content = json.loads((tmp_path / "run" / "run.json").read_text())
    described = section(COLUMNS, "run.json").split("are told of like this")
    assert set(first_cells(described[0])) == set(content)
    assert set(first_cells(described[1])) == set(content["descriptor"])


def test_every_metric_is_described_and_no_other():
    text = (DOCS / "metrics.md").read_text("utf-8")
    assert set(first_cells(text)) == set(METRICS)
    assert text.startswith("# Metrics\n")


def test_the_readme_has_the_defaults():
    readme = (ROOT / "README.md").read_text("utf-8")
    rows = {row[0].strip("`"): row[1].strip("`") for row in next(tables(section(readme, "The method")))[1:]}
    assert {name: str(parameters()[name].default) for name in rows} == rows


@pytest.mark.parametrize("page", ["columns", "commands", "metrics", "parameters"])
def test_generated_pages_are_current(page):
    made = runpy.run_path(str(DOCS / "reference.py"))[page]()
    assert (DOCS / f"{page}.md").read_text("utf-8") == made, "run: python docs/reference.py"


def test_the_site_shows_every_public_name_once():
    shown = re.findall(r"^::: omnieval\.(\w+)$", (DOCS / "api.md").read_text("utf-8"), re.MULTILINE)
    assert sorted(shown) == sorted(omnieval.__all__)


def test_links_of_pages_lead_to_where_they_are_on_the_site():
    hook = ROOT / "docs" / "site.py"
    inside = runpy.run_path(str(hook))
    tests = doctest.DocTestFinder().find(inside["relinked"], "relinked", globs=inside)
    results = [doctest.DocTestRunner().run(test) for test in tests]
    assert [(one.failed, one.attempted) for one in results] == [(0, 2)]
    relinked = inside["relinked"]
    assert (
        relinked("[a](../../CONTRIBUTING.md), [b](../data.md#x)", "tutorial/x.md")
        == "[a](../contributing.md), [b](../data.md#x)"
    )
    code = "```toml\n[table](README.md)\n```\n[far](https://example.org)"
    assert relinked(code, "contributing.md") == code
    assert all((ROOT / place).exists() for place in inside["ELSEWHERE"])


def test_the_explained_decision_of_the_readme_is_that_of_the_pictures():
    explained = (DOCS / "pictures" / "explained.txt").read_text("utf-8")
    assert f"```text\n{explained.rstrip()}\n```" in (ROOT / "README.md").read_text("utf-8")


def test_the_descriptor_of_the_readme_is_that_of_the_examples():
    example = (DOCS / "examples" / "bands.py").read_text("utf-8").split('"""\n\n', maxsplit=1)[1]
    assert f"```python\n{example}```" in (ROOT / "README.md").read_text("utf-8")


def test_the_changelog_begins_with_this_version():
    versions = re.findall(r"^## \[(.+?)\]", (ROOT / "CHANGELOG.md").read_text("utf-8"), re.MULTILINE)
    assert versions == [omnieval.__version__, "0.1.0"]
