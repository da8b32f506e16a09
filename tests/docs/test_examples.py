"""The examples of the documentation run, and keep the contracts they show."""

import ast
import json
import runpy

import numpy as np
import polars as pl
import pytest

from omnieval.components.component import resolve_component
from omnieval.explain.run import RunExplainer
from omnieval.explain.words import decision_text
from omnieval.loop import replay
from omnieval.mapping.step import Role
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
    check_mapper(example["FirstImage"])


def test_every_combination_is_judged(example, panoramas):
    judged = example["main"](f"folder:{panoramas}", 60)
    assert judged["descriptor"].to_list() == ["hog"] * 3 + ["grey-bands"] * 3
    assert judged["mapper"].to_list() == ["roman2020", "leader", "first-image"] * 2
    assert set(judged.columns[2:]) <= set(METRICS)
    assert judged["nodes"].min() >= 1


def test_the_mapper_is_explained_in_its_own_words(example, panoramas, tmp_path):
    explainer = RunExplainer(replay(panoramas, mapper=example["FirstImage"], reach=0.9, out=tmp_path / "run"))
    scenes = [scene for scene in explainer.scenes() if scene.step.role is Role.REFUSED]
    assert scenes
    for scene in scenes:
        assert "refused (new): distance from the first image of node " in decision_text(scene.step, explainer.method)
        (flip,) = explainer.explain(scene.step.frame).flips
        assert "would let it join node" in flip.text


@pytest.mark.parametrize("rows", [32, 16])
def test_the_descriptor_of_a_file_keeps_its_contract_and_can_be_set(rows):
    component = resolve_component("descriptor", f"{EXAMPLES / 'bands.py'}:Bands", {"rows": rows})
    assert (component.name, component.settings) == ("bands", {"rows": rows, "columns": 128})
    assert component.make().describe(np.zeros((128, 512), np.uint8)).position.shape == (rows,)
    check_descriptor(component.make())


def test_the_notebook_was_executed_and_is_small():
    notebook = json.loads(NOTEBOOK.read_text("utf-8"))
    code = [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]
    assert [cell["execution_count"] for cell in code] == list(range(1, len(code) + 1))
    assert any(cell["outputs"] for cell in code)
    assert NOTEBOOK.stat().st_size < 200_000


@pytest.mark.slow
def test_the_notebook_runs_again(small_building, tmp_path, monkeypatch, capsys):
    # In this process, on the beginning of the building: a kernel of its own would take longer to start than all cells.
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    with pl.Config():  # the notebook sets how tables are shown
        for cell in json.loads(NOTEBOOK.read_text("utf-8"))["cells"]:
            if cell["cell_type"] == "code":
                shown = run_cell("".join(cell["source"]), names)
                kinds = {kind for output in cell["outputs"] for kind in output.get("data", {"stream": None})}
                assert ("text/html" in kinds) == (shown is not None and shown.lstrip().startswith("<"))
                assert ("stream" in kinds) == bool(capsys.readouterr().out)


def run_cell(source, names):
    """Run a cell; return the HTML that a notebook shows of its last value, or its text; None where it has no value."""
    tree = ast.parse(source)
    last = tree.body.pop() if isinstance(tree.body[-1], ast.Expr) else None
    exec(compile(tree, "cell", "exec"), names)
    if last is None:
        return None
    value = eval(compile(ast.Expression(last.value), "cell", "eval"), names)
    if value is None:
        return None
    return value._repr_html_() if hasattr(value, "_repr_html_") else repr(value)
