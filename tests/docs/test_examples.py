"""The examples of the documentation run, and keep the contracts they show."""

import json
import runpy

import pytest

from omnieval.metrics.evaluation import METRICS
from omnieval.testing import check_descriptor, check_mapper
from tests.docs.pages import ROOT

EXAMPLES = ROOT / "docs" / "examples"
NOTEBOOK = EXAMPLES / "replay.ipynb"


@pytest.fixture(scope="module")
def example():
    return runpy.run_path(str(EXAMPLES / "own_descriptor_and_mapper.py"))


def test_descriptor_and_mapper_keep_their_contracts(example):
    check_descriptor(example["GreyBands"]())
    check_mapper(example["NearestCentroid"])


def test_every_combination_is_judged(example, panoramas):
    judged = example["main"](f"folder:{panoramas}", 60)
    assert judged["descriptor"].to_list() == ["hog", "hog", "grey-bands", "grey-bands"]
    assert judged["mapper"].to_list() == ["Mapper", "NearestCentroid"] * 2
    assert set(judged.columns[2:]) <= set(METRICS)
    assert judged["nodes"].min() >= 1


def test_the_notebook_was_executed_and_is_small():
    notebook = json.loads(NOTEBOOK.read_text("utf-8"))
    code = [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]
    assert [cell["execution_count"] for cell in code] == list(range(1, len(code) + 1))
    assert any(cell["outputs"] for cell in code)
    assert NOTEBOOK.stat().st_size < 200_000


@pytest.mark.slow
def test_the_notebook_runs_again(small_building, tmp_path, monkeypatch):
    nbclient = pytest.importorskip("nbclient", reason="needs nbclient and ipykernel: pip install nbclient ipykernel")
    pytest.importorskip("ipykernel")
    import nbformat

    monkeypatch.chdir(tmp_path)
    notebook = nbformat.read(NOTEBOOK, as_version=4)
    nbclient.NotebookClient(notebook, timeout=120, kernel_name="python3").execute()
    errors = [out for cell in notebook.cells for out in cell.get("outputs", ()) if out["output_type"] == "error"]
    assert errors == []
