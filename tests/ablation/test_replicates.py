"""Replicates: rows of perturbed sequences, the best by their mean, parameters chosen on some and judged on others."""

import dataclasses
import shutil

import polars as pl
import pytest

import omnieval
from omnieval.ablation.driver import best_run
from omnieval.ablation.grid import parse_axis
from omnieval.ablation.plan import make_plan
from omnieval.ablation.run import check_tuning, drawn, run_plan
from omnieval.ablation.summary import best_and_median, over_replicates, tuned
from omnieval.comparison.methods import compare_methods
from omnieval.comparison.records import read_records
from omnieval.errors import ConfigError
from omnieval.metrics.catalogue import METRICS
from omnieval.results.manifest import read_manifest

BASE = {"n_init": 10, "n_new": 10, "gamma": 1.0}


@pytest.fixture(scope="module")
def ablation(panoramas, tmp_path_factory):
    out = tmp_path_factory.mktemp("replicates") / "two"
    omnieval.ablate(
        panoramas, {"merge_y": [0.5, 20]}, settings=BASE, perturb="start=0:3,noise=3", replicates=3, limit=60, out=out
    )
    return out


def test_every_row_is_that_of_a_replay_of_its_source(ablation, tmp_path):
    table = pl.read_parquet(ablation / "ablation.parquet")
    assert table["replicate"].to_list() == [0, 0, 1, 1, 2, 2]
    assert table["source"].n_unique() == table["perturbation"].n_unique() == 3
    row = table.row(5, named=True)
    run = omnieval.replay(row["source"], config=BASE, merge_y=row["merge_y"], limit=60, out=tmp_path / "run")
    assert {name: row[name] for name in METRICS} == run.metrics
    assert run.manifest["perturbation"] == row["perturbation"]
    prints = read_manifest(ablation, "ablation")["dataset_fingerprints"]
    assert prints[row["source"]] == run.manifest["dataset_fingerprint"]
    assert len(set(prints.values())) == 3


def rows(values, source="folder:/a", replicates=3):
    """Rows of two settings (gamma 1 and 2), the silhouettes of whose replicates are these."""
    return [
        {
            "job": 0,
            "dataset": source[-1],
            "source": f"{source}#noise={replicate + 1}",
            "perturbation": f"noise={replicate + 1}",
            "replicate": replicate,
            "mapper": "m",
            "descriptor": "d",
            "gamma": float(gamma),
            "silhouette": values[gamma][replicate],
            "nodes": 10 * gamma + replicate,
            "batch_silhouette": 0.5,
            "error": None if values[gamma][replicate] is not None else "ValueError: no",
        }
        for gamma in values
        for replicate in range(replicates)
    ]


def frame(*some):
    return pl.DataFrame([row | {"job": job} for job, row in enumerate(row for one in some for row in one)])


def test_the_best_is_by_the_mean_over_replicates():
    # The highest single value is of gamma 1, the highest mean of gamma 2.
    table = frame(rows({1: [0.9, 0.0, 0.0], 2: [0.4, 0.5, 0.6]}))
    means = over_replicates(table)
    assert means["silhouette"].to_list() == pytest.approx([0.3, 0.5])
    assert means["nodes"].to_list() == [11.0, 21.0]
    assert means["source"].unique().to_list() == ["folder:/a"]
    assert means["runs"].to_list() == [3, 3]
    (row,) = best_and_median(table, ["gamma"]).iter_rows(named=True)
    assert (row["gamma"], row["silhouette"], row["runs"]) == (2.0, pytest.approx(0.5), 2)
    assert best_run(table) == 3


def test_what_failed_once_is_not_the_best():
    table = frame(rows({1: [0.9, 0.9, None], 2: [0.4, 0.5, 0.6]}))
    means = over_replicates(table)
    assert means["silhouette"].to_list() == [None, pytest.approx(0.5)]
    assert means["error"][0] == "1 of 3 replicates failed: ValueError: no"
    assert best_run(table) == 3


def test_parameters_are_chosen_on_one_sequence_and_judged_on_another():
    there = rows({1: [0.2, 0.2, 0.2], 2: [0.4, 0.4, 0.4]})
    here = rows({1: [0.9, 0.9, 0.9], 2: [0.3, 0.4, 0.5]}, source="folder:/b")
    found = tuned(frame(there, here), ["gamma"], ["folder:/a"], "silhouette")
    assert found.select("dataset", "role", "gamma").rows() == [("a", "tuned", 2.0), ("b", "judged", 2.0)]
    assert found["silhouette"].to_list() == pytest.approx([0.4, 0.4])
    assert found["best_there"].to_list() == pytest.approx([0.4, 0.9])
    fewer = tuned(frame(there, here), ["gamma"], ["folder:/b"], "silhouette")
    assert fewer["gamma"].unique().to_list() == [1.0]


def test_where_nothing_has_a_value_nothing_is_chosen():
    there, here = rows({1: [None] * 3, 2: [0.4, None, 0.4]}), rows({1: [0.9] * 3, 2: [0.3] * 3}, source="folder:/b")
    assert tuned(frame(there, here), ["gamma"], ["folder:/a"], "silhouette").is_empty()


def test_tuning_runs_both_and_says_it_in_run_json(panoramas, tmp_path):
    other = shutil.copytree(panoramas, tmp_path / "other")
    plan = make_plan([other], [parse_axis("radius=1,3"), parse_axis("mapper=leader")], tune_on=[str(panoramas)])
    done = run_plan(plan, out=tmp_path / "out", tune_by="pair_f1")
    assert done.tuned is not None
    assert done.tuned["role"].to_list() == ["judged", "tuned"]
    assert read_manifest(tmp_path / "out", "ablation")["tuned"] == done.tuned.to_dicts()


def test_replicates_are_cases_of_a_comparison(ablation):
    found = compare_methods(read_records([ablation]), ["merge_y"], ["nodes"])
    assert [one.estimate.n for one in found.estimates] == [3, 3]
    (difference,) = found.differences
    assert difference.difference.mean.n == 3


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"perturb": "noise=2"}, "go together"),
        ({"replicates": 3}, "go together"),
        ({"perturb": "reverse", "replicates": 3}, "fewer than 3 different"),
    ],
)
def test_halves_of_what_is_asked_are_refused(options, words):
    with pytest.raises(ConfigError, match=words):
        drawn(options.get("perturb"), options.get("replicates"))


def test_what_cannot_be_perturbed_or_judged_is_refused(panoramas):
    changed = drawn("noise=2", 2)
    with pytest.raises(ConfigError, match="holds descriptors"):
        make_plan(["some.npz"], [], perturbations=changed)
    with pytest.raises(ConfigError, match="perturbed already"):
        make_plan([f"{panoramas}#noise=1"], [], perturbations=changed)
    with pytest.raises(ConfigError, match="on which to judge"):
        make_plan([panoramas], [], tune_on=[panoramas])
    plan = dataclasses.replace(make_plan([panoramas], []), tuned_on=("folder:/a",))
    for metric, words in (("pair_f2", "did you mean pair_f1"), ("nodes", "no better direction")):
        with pytest.raises(ConfigError, match=words):
            check_tuning(plan, metric)
