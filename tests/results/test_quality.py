"""What a robot can do with the map of a run, wherever it is told: table, metrics, summary, compare, checks."""

import dataclasses

import numpy as np
import polars as pl
import pytest

import omnieval
from omnieval.errors import ConfigError
from omnieval.mapping.representative import representative_frames
from omnieval.metrics.catalogue import BY_NAME, CATALOGUE, METRICS, TELLING, UPKEEP
from omnieval.metrics.ground import THETAS
from omnieval.regression.reference import read_reference
from omnieval.results.compare import compare
from omnieval.results.summary import summary_fields
from tests.reference import quality as plain

SMALL = {"n_init": 10, "n_new": 10, "gamma": 1.0, "omega": 3.5, "merge_y": 0.5}


@pytest.fixture(scope="module")
def run(panoramas, tmp_path_factory):
    return omnieval.replay(panoramas, config=SMALL, out=tmp_path_factory.mktemp("quality") / "run", recording=False)


def test_the_table_holds_what_run_json_says_and_every_distance(run):
    table = run.quality
    for metric in CATALOGUE:
        if metric.of is None:
            continue
        rows = table.filter(pl.col("metric") == metric.of, pl.col("theta").eq_missing(metric.at))
        assert rows["value"].to_list() == [run.metrics[metric.name]]
        assert rows["reason"].to_list() == [run.manifest["null_reasons"].get(metric.name)]
    assert table.filter(pl.col("metric") == "pair_f1")["theta"].to_list() == list(THETAS)
    shares = table.drop_nulls("low")
    assert (shares["low"] <= shares["value"]).all()
    assert (shares["value"] <= shares["high"]).all()


def test_a_wider_place_has_no_fewer_pairs(run):
    for metric in ("pair_precision", "reentry_precision"):
        values = run.quality.filter(pl.col("metric") == metric).drop_nulls("value")["value"].to_list()
        assert values == sorted(values)


def test_what_was_known_at_the_time_is_the_column_node(run):
    steps = run.steps
    positions, stamps = steps.select("x", "y").rows(), steps["time"].cast(pl.Int64).to_list()
    for column, end in (("node", ""), ("node_final", "_final")):
        right, again, taken, chances = plain.reentries(
            positions, stamps, steps[column].fill_null(0).to_list(), 10 * 10**9, 2.0
        )
        rows = run.quality.filter(pl.col("theta") == 2.0)
        for name, hits, count in (("precision", right, again), ("recall", taken, chances)):
            row = rows.row(by_predicate=pl.col("metric") == f"reentry_{name}{end}", named=True)
            assert (row["count"], row["value"]) == (count, hits / count if count else None)
    assert run.metrics["posed"] == 80
    assert run.manifest["timings"]["upkeep_ms_p99"] >= run.manifest["timings"]["upkeep_ms_median"]


def test_the_node_of_the_tables_is_represented_by_the_image_that_is_judged(run):
    nodes = run.nodes.drop_nulls("representative_frame")
    labels = run.steps["node_final"].fill_null(0).cast(pl.Int64).to_numpy()
    for node, frame in nodes.select("id", "representative_frame").iter_rows():
        assert labels[frame] == node


def test_only_some_images_may_represent_a_node():
    labels, descriptors = np.array([1, 1, 2, 0]), np.array([[0.0], [4], [9], [0]], np.float32)
    means = np.array([[1.0], [9.0]])
    assert representative_frames(labels, [1, 2], means, descriptors) == {1: 0, 2: 2}
    assert representative_frames(labels, [1, 2], means, descriptors, np.array([1, 3])) == {1: 1}


def test_the_summary_says_it_in_words(run):
    said = dict(summary_fields(run.manifest))
    assert said["places"].startswith(f"F1 {run.metrics['pair_f1']:.3f}: ")
    assert "returns" in said
    assert "true way" in said["ways"] or said["ways"].startswith("none: ")
    older = run.manifest | {"metrics": {name: run.metrics[name] for name in METRICS if BY_NAME[name].of is None}}
    assert "places" not in dict(summary_fields(older))


def test_the_summary_of_images_without_a_position_says_why(run):
    judged = {name: None if BY_NAME[name].of else value for name, value in run.metrics.items()}
    manifest = run.manifest | {"metrics": judged, "null_reasons": dict.fromkeys(METRICS, "no poses")}
    said = dict(summary_fields(manifest))
    assert said["places"] == said["returns"] == said["ways"] == "none: no poses"


def test_compare_begins_with_what_tells_most(run):
    columns = compare([run]).columns
    assert tuple(name for name in columns if name in METRICS)[: len(TELLING)] == TELLING
    assert not {*columns} & {*UPKEEP}
    named = compare([run], ["upkeep_ms_mean"])
    assert named["upkeep_ms_mean"].to_list() == [run.manifest["timings"]["upkeep_ms_mean"]]


def test_which_way_is_better_need_not_be_said_in_a_reference(tmp_path):
    file = tmp_path / "r.toml"
    case = """schema_version = 2
[[case]]
name = "a"
source = "synthetic:cloudy"
[case.expected]
nodes = { value = 8, min = 7, max = 9 }
pair_f1 = { value = 0.4, tolerance = 0.05 }
false_merge_share = { value = 0.1, tolerance = 0.05 }
"""
    file.write_text(case)
    guards = read_reference(file)[0].guards
    assert {name: guard.better for name, guard in guards.items()} == {"pair_f1": "higher", "false_merge_share": "lower"}
    file.write_text(case.replace("pair_f1", "pair_f2"))
    with pytest.raises(ConfigError, match="did you mean pair_f1"):
        read_reference(file)


def test_every_metric_is_declared_once_and_in_words():
    assert len(BY_NAME) == len(CATALOGUE)
    for metric in CATALOGUE:
        texts = [value for value in dataclasses.asdict(metric).values() if isinstance(value, str)]
        assert metric.meaning
        assert metric.formula
        assert not any("{" in text for text in texts)
