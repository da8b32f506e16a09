"""Runs beside each other, and the step at which they part."""

import shutil

import numpy as np
import polars as pl
import pytest
from sklearn.metrics import adjusted_rand_score

import omnieval
from omnieval.errors import ConfigError
from omnieval.loop import replay
from omnieval.results.compare import (
    _first_unequal,
    agreement,
    compare,
    first_difference,
    matched_nodes,
    same_partition,
)

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
    same = ["verdict", "node", "best_frame", "prominence_ratio"]
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


def test_agreement_counts_steps_by_verdict_and_by_partition(runs):
    one, strict = runs["one"], runs["strict"]
    agreed = agreement(one, strict)
    assert agreed is not None
    parted = agreed.first_parted
    assert parted is not None
    assert agreed.both[:parted].all()
    assert agreed.verdicts.tolist() == (one.steps["verdict"] == strict.steps["verdict"]).to_list()
    labels = [run.steps["node_final"].to_list() for run in (one, strict)]
    assert agreed.final_ari == pytest.approx(adjusted_rand_score(*labels))
    same = agreement(one, runs["same"])
    assert same is not None
    assert same.both.all()
    assert (same.first_parted, same.final_ari) == (None, 1.0)


def test_runs_over_other_images_have_no_agreement(runs, panoramas, tmp_path):
    other = replay(omnieval.load(panoramas).cut(start=10), config=omnieval.configure(CONFIG), out=tmp_path / "other")
    assert agreement(runs["one"], other) is None


@pytest.mark.parametrize(
    ("one", "other", "same"),
    [
        ([1, 1, 2, 0], [2, 2, 1, 0], True),
        ([1, 1, 2], [1, 2, 2], False),
        ([1, 1, 2], [1, 1, 1], False),
        ([1, 2, 3], [1, 1, 3], False),
        ([1, 0], [1, 1], False),
        ([0, 1], [1, 0], False),
        ([], [], True),
    ],
)
def test_partitions_are_the_same_up_to_the_names_of_their_nodes(one, other, same):
    assert same_partition(np.array(one, np.int64), np.array(other, np.int64)) is same


def test_nodes_are_matched_by_the_images_they_share():
    one = np.array([1, 1, 1, 2, 2, 3, 0])
    other = np.array([7, 7, 5, 5, 5, 0, 6])
    assert matched_nodes(one, other) == {7: 1, 5: 2}


def test_chosen_columns_are_shown_alone_even_if_the_runs_do_not_differ_in_them(runs):
    table = compare(list(runs.values()), ["omega", "nodes", "omega"])
    assert table.columns == ["run", "omega", "nodes"]
    assert table["omega"].to_list() == ["3.5"] * 3
    with pytest.raises(ConfigError, match="did you mean nodes"):
        compare(list(runs.values()), ["noodes"])


def differing_columns(*runs):
    """What a comparison shows besides the metrics."""
    table = compare(list(runs))
    return {name: table[name].to_list() for name in table.columns if name not in {"run", "status", *runs[0].metrics}}


@pytest.fixture(scope="module")
def led(panoramas, tmp_path_factory):
    """Replays with the fastest mapper: takes a name and options."""
    out = tmp_path_factory.mktemp("led")
    return lambda name, **options: replay(panoramas, mapper="leader", out=out / name, **options)


def test_runs_of_other_frames_show_their_cuts(led):
    whole, part = led("whole"), led("part", start=8, stride=2, limit=30)
    shown = differing_columns(whole, part)
    assert shown["cut.start"] == ["0", "8"]
    assert shown["cut.stride"] == ["1", "2"]
    assert shown["cut.limit"] == [None, "30"]
    assert shown["frames"] == ["80", "30"]
    assert len(set(shown["images"])) == 2
    assert set(shown) == {"source", "cut.start", "cut.stride", "cut.limit", "frames", "images"}


def test_runs_of_two_mappers_show_both_with_the_parameters_of_each(runs, led):
    shown = differing_columns(runs["one"], led("other-mapper"))
    assert shown["mapper"] == ["roman2020", "leader"]
    assert shown["omega"] == ["3.5", None]
    assert shown["radius"] == [None, "3.0"]
    assert len(set(shown["mapper.code"])) == 2
    assert not {"descriptor", "descriptor.code", "images", "frames"} & set(shown)


def test_runs_with_other_parameters_of_descriptor_and_imaging_show_them(led):
    shown = differing_columns(led("first"), led("second", config={"hog.bins": 8, "imaging.rows": 32}))
    assert shown["hog.bins"][1] == "8"
    assert shown["imaging.rows"][1] == "32"
    assert "images" not in shown


OWN = """
from pathlib import Path
import omnieval

class Own:
    weights = Path(__file__).with_suffix(".bin")

    def describe(self, panorama):
        return omnieval.Description(panorama[:4].mean(axis=1), panorama[:4].T.copy())
"""


def test_a_descriptor_that_was_edited_or_trained_on_is_another(led, tmp_path):
    file = tmp_path / "own.py"
    found = []
    for number, (source, weights) in enumerate([(OWN, b"1"), (OWN + "# edited", b"1"), (OWN + "# edited", b"2")]):
        file.write_text(source)
        file.with_suffix(".bin").write_bytes(weights)
        found.append(led(f"own{number}", descriptor=f"{file}:Own"))
    assert set(differing_columns(*found[:2])) == {"source", "descriptor.code"}
    assert set(differing_columns(*found[1:])) == {"source", "descriptor.weights"}


def test_images_that_were_left_out_are_a_difference(panoramas, tmp_path):
    images = shutil.copytree(panoramas, tmp_path / "images")
    whole = replay(images, mapper="leader", out=tmp_path / "whole", skip_bad=True)
    (images / "image9.png").write_bytes(b"")
    lacking = replay(images, mapper="leader", out=tmp_path / "lacking", skip_bad=True)
    shown = differing_columns(whole, lacking)
    assert (shown["skipped"], shown["frames"]) == (["0", "1"], ["80", "79"])
