"""Jobs as trees: how they are divided, and the pieces of an interval."""

import dataclasses
import random

import polars as pl
import pytest

import omnieval
from omnieval.ablation.grid import parse_axis, parse_span
from omnieval.ablation.jobs import dataset_key
from omnieval.ablation.plan import make_plan
from omnieval.ablation.run import job_states, run_plan
from omnieval.ablation.summary import pieces
from omnieval.ablation.tree import LARGEST, plant
from omnieval.config import Setting
from omnieval.errors import ConfigError
from omnieval.metrics.evaluation import METRICS

BASE = {"n_init": 10, "n_new": 10, "gamma": 1.0}


def plan_of(panoramas, *axes, exact=None, **changes):
    settings = [Setting(name, value, "test") for name, value in {**BASE, **changes}.items()]
    span = parse_span(exact) if exact else None
    return make_plan([panoramas], [parse_axis(axis) for axis in axes], settings, exact=span)


def trees_of(plan, processes):
    return [
        [job.number for job in tree] for tree in plant(plan.jobs, [dataset_key(job) for job in plan.jobs], processes)
    ]


def test_jobs_that_differ_in_thresholds_are_one_tree(panoramas):
    plan = plan_of(panoramas, "covariance=diagonal,ridge", "omega=1,2", "merge_y=1,2")
    assert trees_of(plan, 1) == trees_of(plan, 2) == [[0, 1, 2, 3], [4, 5, 6, 7]]


def test_every_process_has_a_tree(panoramas):
    plan = plan_of(panoramas, "omega=1:5:1")
    assert trees_of(plan, 2) == [[0, 1, 2], [3, 4]]
    assert trees_of(plan, 9) == [[0], [1], [2], [3], [4]]


def test_a_tree_is_never_larger_than_what_a_kill_may_lose(panoramas):
    trees = trees_of(plan_of(panoramas, "omega=1:10:1", "merge_y=1:15:1"), 1)
    assert max(map(len, trees)) <= LARGEST
    assert sorted(number for tree in trees for number in tree) == list(range(150))


def test_one_job_that_fails_fails_alone(panoramas, tmp_path, monkeypatch):
    from omnieval.mapping.roman2020.mapper import Roman2020

    decide = Roman2020.decide

    def fragile(mapper, frame):
        if frame == 30 and mapper.settings.omega == 1:
            raise ArithmeticError("omega = 1 is not to my taste")
        return decide(mapper, frame)

    monkeypatch.setattr(Roman2020, "decide", fragile)
    ablation = run_plan(plan_of(panoramas, "omega=1,2,3"), out=tmp_path / "out")
    errors = ablation.table["error"].to_list()
    assert [error is None for error in errors] == [False, True, True]
    assert "not to my taste" in errors[0]
    assert ablation.table["silhouette"].is_null().to_list() == [True, False, False]


def test_an_axis_the_descriptor_does_not_have_makes_no_rows(panoramas, tmp_path):
    plan = plan_of(panoramas, "descriptor=hog,gist", "hog.bins=8,16")
    table = run_plan(plan, out=tmp_path / "out").table
    assert table.select("descriptor", "hog.bins").rows() == [("hog", 8), ("hog", 16), ("gist", None)]


@pytest.fixture(scope="module")
def exact(panoramas, tmp_path_factory):
    out = tmp_path_factory.mktemp("exact") / "out"
    return run_plan(plan_of(panoramas, "omega=0.5,3.5", exact="merge_y=0.5:1000"), out=out)


def test_an_interval_has_a_row_for_every_map(exact):
    for (_,), rows in exact.table.group_by("omega", maintain_order=True):
        assert rows["exact"].unique().to_list() == ["merge_y"]
        assert rows["exact_from"][0] == 0.5
        assert rows["exact_to"][-1] == 1000
        assert rows["exact_from"][1:].to_list() == rows["exact_to"][:-1].to_list()
        assert rows["merge_y"].to_list() == rows["exact_from"].to_list()
    assert len(exact.table) > 2
    assert exact.failed == 0


def test_the_map_is_the_same_all_over_a_piece(exact, panoramas, tmp_path):
    rng = random.Random(0)
    for number, row in enumerate(exact.table.iter_rows(named=True)):
        merge_y = rng.uniform(row["exact_from"], row["exact_to"])
        config = omnieval.configure(BASE, omega=row["omega"], merge_y=merge_y)
        run = omnieval.replay(panoramas, config=config, out=tmp_path / str(number))
        assert {name: row[name] for name in METRICS} == run.metrics


def test_an_interval_is_done_when_its_pieces_are(exact, panoramas):
    plan = plan_of(panoramas, "omega=0.5,3.5", exact="merge_y=0.5:1000")
    assert [state for _, state in job_states(plan, exact.folder, keep_steps=False)] == ["done", "done"]
    resumed = run_plan(plan, out=exact.folder, resume=True)
    assert resumed.table.equals(exact.table)


def test_the_summary_of_an_interval_names_its_pieces(exact):
    summary = pieces(exact.table, ["omega"])
    assert summary.columns[:5] == ["dataset", "mapper", "descriptor", "omega", "exact"]
    assert len(summary) == len(exact.table)


def test_from_python(panoramas, tmp_path):
    settings = {"n_init": 10, "n_new": 10}
    table = omnieval.ablate(panoramas, settings=settings, exact="gamma=0.5:1.5", out=tmp_path / "out")
    assert isinstance(table, pl.DataFrame)
    assert set(table["exact"]) == {"gamma"}


@pytest.mark.parametrize(
    ("exact", "words"),
    [
        ("merge_y", "expected NAME=FIRST:LAST"),
        ("merge_y=1:2:3", "expected NAME=FIRST:LAST"),
        ("n_new=10:20", "only omega, merge_y, gamma"),
        ("merge_y=3:1", "the first value must be below the last"),
        ("merge_y=nan:1", "the first value must be below the last"),
        ("omega=-1:2", "omega"),
        ("gamma=0.5:2", "both varied"),
    ],
)
def test_an_interval_that_makes_no_sense_is_refused(panoramas, exact, words):
    with pytest.raises(ConfigError, match=words):
        plan_of(panoramas, exact=exact)


def test_an_interval_records_nothing(panoramas, tmp_path):
    plan = dataclasses.replace(plan_of(panoramas, exact="merge_y=0.5:3"))
    with pytest.raises(ConfigError, match="--exact makes no single runs"):
        run_plan(plan, out=tmp_path / "out", keep_steps=True)
