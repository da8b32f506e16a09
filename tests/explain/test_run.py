"""An explanation says what the tables hold, and is found by number or file."""

import dataclasses
import json

import numpy as np
import polars as pl
import pytest

from omnieval.errors import ResultError
from omnieval.explain.page import lines, match_text
from omnieval.explain.run import RunExplainer, explanation_lines
from omnieval.json_records import jsonable
from omnieval.mapping.partition import Partition
from omnieval.mapping.step import Verdict
from omnieval.results.run_folder import open_run
from omnieval.results.schemas import STEPS
from omnieval.results.tables import step_from_row


@pytest.fixture(scope="module")
def explainer(run):
    return RunExplainer(run)


def test_every_step_is_explained_and_the_first_line_is_the_decision(run, explainer):
    for frame, verdict in enumerate(run.steps["verdict"]):
        explanation = explainer.explain(frame)
        page = explanation_lines(explanation, explainer.config)
        assert explanation.decision.verdict == verdict
        assert [label for label, _ in page][:2] == ["decision", "image"]
        assert all(text for _, text in page)


def test_the_best_match_is_in_the_node_it_had_then_and_as_far_away_as_the_poses_say(run, explainer):
    partition = Partition()
    matched = 0
    for row in run.steps.iter_rows(named=True):
        match = explainer.match(row["frame"])
        if match is not None:
            matched += 1
            best = run.steps.row(row["best_frame"], named=True)
            assert match.node == partition.labels[row["best_frame"]]
            assert match.node in row["candidates"]
            assert match.distance == pytest.approx(np.hypot(row["x"] - best["x"], row["y"] - best["y"]))
            assert match.capture.room == best["room"]
            assert match.shift_degrees is not None
            assert -180 < match.shift_degrees <= 180
        partition.apply(step_from_row(row))
    assert matched > 10


def test_the_end_of_the_image_is_told_with_its_node(run, explainer):
    last = len(run.steps) - 1
    page = dict(explanation_lines(explainer.explain(last), explainer.config))
    node = run.steps["node_final"][last]
    images = run.nodes.filter(pl.col("id") == node)["images"][0]
    assert page["final map"].startswith(f"node {node}, {run.steps['placement'][last]}: ")
    assert page[""].startswith(f"that node: {images} images, R")


def test_every_active_node_is_named_once_with_its_ratio(run, explainer):
    frame = int(run.steps.filter(pl.col("gate_nodes").list.len() == pl.col("gate_nodes").list.len().max())["frame"][0])
    page = dict(lines(explainer.explain(frame).decision, explainer.config))
    told = ", ".join(page.get(label, "") for label in ("candidates", "refused", "far nodes")).replace("node ", "")
    nodes = [int(part.split(" at ")[0]) for part in told.split(", ") if " at " in part]
    assert sorted(nodes) == run.steps["gate_nodes"][frame].to_list()


@pytest.mark.parametrize("step", ["17", "image17.png"])
def test_a_step_is_found_by_number_and_by_file(explainer, step):
    assert explainer.find(step) == 17


@pytest.mark.parametrize(
    ("step", "words"),
    [
        ("80", "its steps are 0 to 79"),
        ("-1", "its steps are 0 to 79"),
        ("image80.png", "did you mean image8"),
        ("x", "name a step, 0 to 79"),
        ("²", "name a step, 0 to 79"),
    ],
)
def test_a_step_that_is_not_there_is_named_with_what_is(explainer, step, words):
    with pytest.raises(ResultError, match=words):
        explainer.find(step)


def test_the_tables_alone_suffice(run, explainer, tmp_path):
    folder = tmp_path / "moved"
    folder.mkdir()
    for name in ("run.json", "steps.parquet", "nodes.parquet"):
        (folder / name).write_bytes((run.folder / name).read_bytes())
    assert jsonable(RunExplainer(open_run(folder)).explain(40)) == jsonable(explainer.explain(40))


def test_plain_content_is_what_json_knows(explainer):
    content = jsonable(explainer.explain(40))
    assert content["decision"]["capture"]["file"] == "image40.png"
    assert isinstance(content["decision"]["gate"]["ratios"], list)
    assert jsonable([float("inf"), float("nan"), Verdict.PENDING]) == [None, None, "pending"]


def test_a_run_that_did_not_reach_its_end_is_explained_as_far_as_it_came(run, tmp_path):
    folder = tmp_path / "cut"
    folder.mkdir()
    manifest = json.loads((run.folder / "run.json").read_text())
    changed = {"status": "interrupted", "metrics": {}, "file_digests": {}}
    (folder / "run.json").write_text(json.dumps(manifest | changed))
    columns = [pl.lit(None, dtype=STEPS[name]).alias(name) for name in ("node_final", "placement", "forced")]
    run.steps.head(45).with_columns(columns).write_parquet(folder / "steps.parquet")
    explainer = RunExplainer(open_run(folder))
    page = dict(explanation_lines(explainer.explain(44), explainer.config))
    assert page["final map"] == "unknown: the run did not reach its end"
    with pytest.raises(ResultError, match="0 to 44"):
        explainer.explain(45)


def test_the_turn_is_an_angle_only_where_the_cells_of_the_descriptor_are_known(run):
    silent = {name: value for name, value in run.manifest.items() if name != "orientation_cells"}
    earlier = dataclasses.replace(run, manifest=silent)
    frame = int(run.steps.filter(pl.col("best_frame").is_not_null())["frame"][0])
    known, unknown = (RunExplainer(one).match(frame) for one in (run, earlier))
    assert known is not None
    assert unknown is not None
    assert known.shift_degrees is not None
    assert (known.shift_degrees - known.shift * 360 / 256) % 360 == pytest.approx(0.0)
    assert unknown.shift_degrees is None
    assert " deg" not in match_text(unknown)


def test_a_run_without_steps_is_refused(run, tmp_path):
    folder = tmp_path / "empty"
    folder.mkdir()
    manifest = json.loads((run.folder / "run.json").read_text())
    (folder / "run.json").write_text(json.dumps(manifest | {"file_digests": {}}))
    STEPS.to_frame().write_parquet(folder / "steps.parquet")
    with pytest.raises(ResultError, match="has no steps"):
        RunExplainer(open_run(folder))
