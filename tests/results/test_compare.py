"""Runs beside each other, and the step at which they part."""

import polars as pl
import pytest

import omnieval
from omnieval.loop import replay
from omnieval.results.compare import _first_unequal, compare, first_difference

CONFIG = {"n_init": 10, "n_new": 10, "gamma": 1.0, "omega": 3.5, "merge_y": 0.5}


@pytest.fixture(scope="module")
def runs(panoramas, tmp_path_factory):
    out = tmp_path_factory.mktemp("runs")
    return {
        name: replay(panoramas, config=omnieval.configure({**CONFIG, **changed}), out=out / name)
        for name, changed in {"one": {}, "same": {}, "strict": {"gamma": 20.0}}.items()
    }


def test_equal_runs_do_not_part(runs):
    assert first_difference(runs["one"], runs["same"]) is None


def test_the_first_differing_step_is_named_with_both_verdicts_and_the_parameter(runs):
    one, strict = runs["one"], runs["strict"]
    found = first_difference(one, strict)
    assert found is not None
    assert found.columns["verdict"] == ("assigned", "prominence")
    assert found.settings == {"gamma": (1.0, 20.0)}
    before = pl.col("frame") < found.frame
    same = ["verdict", "node", "best_frame", "gate_ratios"]
    assert one.steps.filter(before).select(same).equals(strict.steps.filter(before).select(same))


def test_a_prefix_parts_where_it_ends(runs, panoramas, tmp_path):
    sequence = omnieval.load(panoramas).cut(limit=33)
    short = replay(sequence, config=omnieval.configure(CONFIG), out=tmp_path / "short")
    found = first_difference(runs["one"], short)
    assert found is not None
    assert (found.frame, found.file, found.columns) == (33, "image33.png", {})


@pytest.mark.parametrize("row", [0, 1, 41, 98, 99])
def test_the_first_unequal_row_is_found_wherever_it_is(row):
    left = pl.DataFrame({"a": range(100), "b": [[i] for i in range(100)]})
    right = left.with_columns(pl.when(pl.col("a") >= row).then(-1).otherwise(pl.col("a")).alias("a"))
    assert _first_unequal(left, right) == row
    assert _first_unequal(left, left) is None


def test_a_comparison_shows_what_differs_and_every_metric(runs):
    table = compare(list(runs.values()))
    assert table["gamma"].to_list() == ["1.0", "1.0", "20.0"]
    assert "omega" not in table.columns
    assert set(runs["one"].metrics) <= set(table.columns)
    assert table["nodes"].to_list() == [run.metrics["nodes"] for run in runs.values()]
