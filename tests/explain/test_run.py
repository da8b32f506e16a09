"""An explanation says what the tables hold, and is found by number or file."""

import dataclasses
import json
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from omnieval.datasets.sequence import Frame
from omnieval.errors import ResultError
from omnieval.explain.page import lines, match_text
from omnieval.explain.run import RunExplainer, explanation_lines
from omnieval.explain.scene import Scene
from omnieval.json_records import jsonable
from omnieval.loop import replay
from omnieval.mapping.partition import Partition
from omnieval.mapping.step import Comparison, EventKind, FinalMap, Match, NodeEvent, Placement, Role, Step
from omnieval.results.run_folder import open_run
from omnieval.results.schemas import STEPS


@pytest.fixture(scope="module")
def explainer(run):
    return RunExplainer(run)


def test_every_step_is_explained_and_the_first_line_is_the_decision(run, explainer):
    for frame, verdict in enumerate(run.steps["verdict"]):
        explanation = explainer.explain(frame)
        page = explanation_lines(explanation, explainer.method)
        assert explanation.scene.step.verdict == verdict
        assert [label for label, _ in page][:2] == ["decision", "image"]
        assert all(text for _, text in page)


def test_the_best_match_is_in_the_node_it_had_then_and_as_far_away_as_the_poses_say(run, explainer):
    partition = Partition()
    matched = 0
    for row in run.steps.iter_rows(named=True):
        scene = explainer.scene(row["frame"])
        match = scene.step.match
        if match is not None:
            matched += 1
            best = run.steps.row(row["best_frame"], named=True)
            assert (match.frame, match.node) == (row["best_frame"], partition.labels[row["best_frame"]])
            assert match.node in scene.step.compared("node").passing
            assert scene.metres == pytest.approx(np.hypot(row["x"] - best["x"], row["y"] - best["y"]))
            assert (scene.best.file, scene.best.room) == (best["file"], best["room"])
            assert scene.shift_degrees is not None
            assert -180 < scene.shift_degrees <= 180
        partition.apply(scene.step)
    assert matched > 10


def test_the_outcome_is_the_role_but_for_a_refusal_where_the_robot_had_been(run_of):
    scenes = list(RunExplainer(run_of(gamma=20.0)).scenes())
    outcomes = {scene.outcome for scene in scenes}
    assert {"founding", "missed", "refused"} <= outcomes
    for scene in scenes:
        if scene.step.role is Role.REFUSED:
            assert (scene.outcome == "missed") == (scene.revisit is not None and scene.revisit.near)
        else:
            assert scene.outcome == {"joined": "closed"}.get(scene.step.role.value, scene.step.role.value)


def test_the_end_of_the_image_is_told_with_its_node(run, explainer):
    last = len(run.steps) - 1
    page = dict(explanation_lines(explainer.explain(last), explainer.method))
    node = run.steps["node_final"][last]
    images = run.nodes.filter(pl.col("id") == node)["images"][0]
    assert page["final map"].startswith(f"node {node}, {run.steps['placement'][last]}: ")
    assert page[""].startswith(f"that node: {images} images, R")


def test_every_active_node_is_named_once_with_its_ratio(explainer):
    asked = [scene for scene in explainer.scenes() if scene.step.compared("node")]
    scene = max(asked, key=lambda scene: len(scene.step.compared("node").of))
    node = scene.step.compared("node")
    told = [text for label, text in lines(scene, explainer.method) if label in ("  passed", "  refused", "  far")]
    found = dict(part.split(" at ") for part in ", ".join(told).replace("node ", "").split(", ") if " at " in part)
    assert [int(one) for one in sorted(found)] == sorted(node.of)
    for one, value in found.items():
        assert float(value) == pytest.approx(node.value_of(int(one)), rel=0.01)


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
    assert content["scene"]["image"]["file"] == "image40.png"
    assert isinstance(content["scene"]["step"]["comparisons"][0]["values"], list)
    assert jsonable([float("inf"), float("nan"), Role.PENDING]) == [None, None, "pending"]


def test_a_run_that_did_not_reach_its_end_is_explained_as_far_as_it_came(run, tmp_path):
    folder = tmp_path / "cut"
    folder.mkdir()
    manifest = json.loads((run.folder / "run.json").read_text())
    changed = {"status": "interrupted", "metrics": {}, "file_digests": {}}
    (folder / "run.json").write_text(json.dumps(manifest | changed))
    columns = [pl.lit(None, dtype=STEPS[name]).alias(name) for name in ("node_final", "placement", "forced")]
    run.steps.head(45).with_columns(columns).write_parquet(folder / "steps.parquet")
    explainer = RunExplainer(open_run(folder))
    page = dict(explanation_lines(explainer.explain(44), explainer.method))
    assert page["final map"] == "unknown: the run did not reach its end"
    with pytest.raises(ResultError, match="0 to 44"):
        explainer.explain(45)


def test_the_turn_is_an_angle_only_where_the_cells_of_the_descriptor_are_known(run):
    silent = {name: value for name, value in run.manifest.items() if name != "orientation_cells"}
    earlier = dataclasses.replace(run, manifest=silent)
    frame = int(run.steps.filter(pl.col("best_frame").is_not_null())["frame"][0])
    known, unknown = (RunExplainer(one).scene(frame) for one in (run, earlier))
    assert known.step.match is not None
    assert known.shift_degrees is not None
    assert (known.shift_degrees - known.step.match.shift * 360 / 256) % 360 == pytest.approx(0.0)
    assert unknown.shift_degrees is None
    assert " deg" in match_text(known)
    assert " deg" not in match_text(unknown)


@pytest.mark.parametrize(("shift", "cells", "degrees"), [(0, 256, 0.0), (128, 256, 180.0), (255, 256, -360 / 256)])
def test_a_shift_is_the_shorter_turn(shift, cells, degrees):
    scene = Scene(Step(9, "near", Role.JOINED, 1, Match(3, 1, shift)), Frame(Path(), "a.png"))
    assert dataclasses.replace(scene, cells=cells).shift_degrees == pytest.approx(degrees)
    assert scene.shift_degrees is None


def test_a_run_without_steps_is_refused(run, tmp_path):
    folder = tmp_path / "empty"
    folder.mkdir()
    manifest = json.loads((run.folder / "run.json").read_text())
    (folder / "run.json").write_text(json.dumps(manifest | {"file_digests": {}}))
    STEPS.to_frame().write_parquet(folder / "steps.parquet")
    with pytest.raises(ResultError, match="has no steps"):
        RunExplainer(open_run(folder))


class Halves:
    """A mapper of somebody else's, who declares nothing: two nodes, by the sign of what it compares."""

    def __init__(self):
        self.labels, self.means = [], []

    def step(self, description):
        value = float(description.position[0])
        node = 1 if value <= 0.004 else 2
        new = node not in self.labels
        self.labels.append(node)
        self.means.append(description.position)
        created = NodeEvent(EventKind.CREATED, node, frames=(len(self.labels) - 1,))
        low, high = (value, np.inf) if node == 1 else (-np.inf, value)
        return Step(
            len(self.labels) - 1,
            "left" if node == 1 else "right",
            Role.FOUNDING if new else Role.JOINED,
            node,
            events=(created, NodeEvent(EventKind.ACTIVATED, node)) if new else (),
            comparisons=() if new else (Comparison("first number", (value,), 0.004, low, high),),
        )

    def finish(self):
        labels, means = np.array(self.labels, np.int64), np.array(self.means, np.float64)
        nodes = tuple(sorted(set(self.labels)))
        first = {int(np.flatnonzero(labels == node)[0]) for node in nodes}
        placements = [Placement.FOUNDING if i in first else Placement.LOOP_CLOSURE for i in range(len(labels))]
        representatives = np.array([means[labels == node].mean(axis=0) for node in nodes])
        return FinalMap(labels, tuple(placements), nodes, frozenset(nodes), representatives)


def test_a_mapper_that_declares_nothing_is_explained_by_what_it_compared(panoramas, tmp_path):
    run = replay(panoramas, mapper=Halves(), out=tmp_path / "run")
    explainer = RunExplainer(run)
    assert (explainer.method.name, explainer.method.gates) == ("halves", ())
    joined = [scene for scene in explainer.scenes() if scene.step.comparisons]
    assert len(joined) > 70
    for scene in joined:
        explanation = explainer.explain(scene.step.frame)
        page = dict(explanation_lines(explanation, explainer.method))
        value = scene.step.comparisons[0].best
        sign = "<=" if value <= 0.004 else ">"
        assert page["decision"] == f"joined node {scene.step.node}"
        assert page["first number"].startswith("first number ")
        assert f"{sign} threshold 0.004" in page["first number"]
        assert page["margin"].endswith("was first number against threshold")
        assert explanation.flips == ()
