"""Refusals that the ground truth would have allowed are found, whichever gate refused, the nearest miss first."""

import numpy as np
import polars as pl
import pytest

from omnieval.datasets import load
from omnieval.errors import ResultError
from omnieval.explain.refused import refused_closures
from omnieval.explain.revisit import AGO_STEPS
from omnieval.loop import replay


@pytest.fixture(scope="module")
def strict(run_of):
    return run_of(gamma=20.0)


@pytest.fixture(scope="module")
def table(strict):
    return refused_closures(strict, within=1.0, ago=1)


def test_every_listed_step_was_refused_with_a_true_match_near_by(strict, table):
    steps = strict.steps
    assert len(table) > 5
    for row in table.iter_rows(named=True):
        here, there = (steps.select("x", "y").row(frame) for frame in (row["step"], row["match"]))
        assert row["metres"] == pytest.approx(float(np.hypot(*np.subtract(here, there))))
        assert row["metres"] <= 1.0
        assert row["verdict"] == steps["verdict"][row["step"]]
        assert row["verdict"] in ("no-candidate", "prominence", "centroid")
        assert row["steps_ago"] == row["step"] - row["match"] > 0


def test_a_refused_prominence_is_listed_iff_its_best_match_is_near(strict, table):
    steps = strict.steps
    positions = steps.select("x", "y").to_numpy()
    expected = {
        frame
        for frame, best in steps.filter(pl.col("verdict") == "prominence").select("frame", "best_frame").iter_rows()
        if np.linalg.norm(positions[frame] - positions[best]) <= 1.0
    }
    assert expected
    assert set(table.filter(pl.col("verdict") == "prominence")["step"]) == expected


def test_the_nearest_miss_comes_first_and_is_measured_against_its_threshold(table):
    assert table["missing"].is_sorted()
    row = table.filter(pl.col("verdict") == "prominence").row(0, named=True)
    assert row["missing"] == pytest.approx((20.0 - row["value"]) / 20.0)
    assert row["value"] < row["threshold"] == 20.0


def test_a_gate_that_shut_out_the_true_place_is_named_by_that_places_node(run_of):
    run = run_of(omega=1.0)
    table = refused_closures(run, ago=1).filter(pl.col("verdict") == "no-candidate")
    assert len(table)
    for row in table.iter_rows(named=True):
        step = run.steps.row(row["step"], named=True)
        (gate,) = (one for one in step["comparisons"] if one["gate"] == "node")
        ratios = dict(zip(gate["of"], gate["values"], strict=True))
        assert row["value"] == ratios[row["match_node"]] > row["threshold"] == step["x_gate"] == gate["threshold"]


def test_only_places_revisited_are_listed_when_asked(strict, table):
    late = refused_closures(strict, ago=20)
    assert (late["steps_ago"] >= 20).all()
    assert len(late) < len(table)


def test_unless_said_otherwise_the_place_was_left_long_ago(strict):
    assert refused_closures(strict).equals(refused_closures(strict, ago=AGO_STEPS))


def test_without_poses_there_is_nothing_to_judge_by(panoramas, tmp_path):
    folder = tmp_path / "bare"
    folder.mkdir()
    for file in sorted(panoramas.glob("image?.png")) + sorted(panoramas.glob("image1?.png")):
        (folder / file.name).write_bytes(file.read_bytes())
    run = replay(load(f"folder:{folder}"), out=tmp_path / "run")
    with pytest.raises(ResultError, match="no ground-truth positions"):
        refused_closures(run)
