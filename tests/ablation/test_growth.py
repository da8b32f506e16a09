"""Sweeps that grow: what is done is kept, and the table is that of one that was as large from the beginning."""

import json
import shutil

import polars as pl
import pytest

from omnieval.ablation.grid import parse_axis
from omnieval.ablation.growth import lost
from omnieval.ablation.plan import make_plan
from omnieval.ablation.run import drawn, job_states, run_plan
from omnieval.ablation.store import Store
from omnieval.config import Setting
from omnieval.errors import ResultError
from omnieval.report.sources import open_sources

BASE = [Setting(name, value, "test") for name, value in {"n_init": 10, "n_new": 10, "gamma": 1.0}.items()]
SMALL = ("mapper=leader", "radius=2,4")
LARGE = ("mapper=leader,roman2020", "radius=1,2,4", "omega=2.5,3.5")


@pytest.fixture(scope="module")
def other(panoramas, tmp_path_factory):
    return shutil.copytree(panoramas, tmp_path_factory.mktemp("other") / "before")


def plan_of(sources, axes, **more):
    base = BASE if "roman2020" in axes[0] else []
    return make_plan(sources, [parse_axis(axis) for axis in axes], base, **more)


def files(folder):
    return {path.name.partition("-")[2]: path.read_bytes() for path in (folder / "parts").iterdir()}


@pytest.fixture(scope="module")
def large(panoramas, other, tmp_path_factory):
    out = tmp_path_factory.mktemp("growth") / "large"
    return run_plan(plan_of([other, panoramas], LARGE), out=out, keep_steps=True)


@pytest.fixture
def small(panoramas, tmp_path):
    return run_plan(plan_of([panoramas], SMALL), out=tmp_path / "grown", keep_steps=True, record_best=True).folder


def trace_of(folder, job):
    store = Store(folder)
    part = store.part(job)
    assert part is not None
    return pl.read_parquet(str(store.steps(part))).drop("milliseconds")


def same(grown, large):
    assert grown.table.drop("seconds").equals(large.table.drop("seconds"))
    for job in range(len(large.table)):
        assert trace_of(grown.folder, job).equals(trace_of(large.folder, job))


def test_a_finished_sweep_grows_by_values_components_and_sources_before_its_own(small, panoramas, other, large):
    before = pl.read_parquet(small / "ablation.parquet")
    plan = plan_of([other, panoramas], LARGE)
    states = [state for _, state in job_states(plan, small, keep_steps=True)]
    assert states.count("done") == 2
    grown = run_plan(plan, out=small, resume=True, keep_steps=True)
    same(grown, large)
    kept = grown.table.filter(pl.col("seconds").is_in(before["seconds"].to_list()))
    assert kept["radius"].to_list() == [2, 4]
    assert kept["job"].to_list() != before["job"].to_list()
    assert not (small / "best").exists()
    assert json.loads((small / "run.json").read_text())["jobs"] == len(large.table) == 10
    (sweep,) = open_sources([small]).sweeps
    assert len(sweep.replays) == 4


def test_growth_that_is_stopped_at_any_file_loses_nothing(small, panoramas, other, large, monkeypatch):
    plan, kept = plan_of([other, panoramas], LARGE), files(small).keys()
    add, calls = Store.add, []

    def stopped(store, part):
        calls.append(part)
        if len(calls) in (2, 3):
            raise KeyboardInterrupt
        add(store, part)

    with monkeypatch.context() as patch:
        patch.setattr(Store, "add", stopped)
        for _ in range(2):
            with pytest.raises(KeyboardInterrupt):
                run_plan(plan, out=small, resume=True, keep_steps=True)
            assert files(small).keys() == kept
    before = files(small)
    same(run_plan(plan, out=small, resume=True, keep_steps=True), large)
    seconds = {key: json.loads(text)["rows"][0]["seconds"] for key, text in before.items()}
    assert {key: json.loads(files(small)[key])["rows"][0]["seconds"] for key in kept} == seconds


def test_what_was_fixed_may_be_varied(small, panoramas):
    grown = plan_of([panoramas], [*SMALL, "imaging.rows=64,128"])
    assert [state for _, state in job_states(grown, small, keep_steps=True)].count("done") == 2


def test_more_replicates_are_growth(panoramas, tmp_path):
    def plan(replicates):
        return plan_of([panoramas], ["mapper=leader"], perturbations=drawn("noise=3", replicates))

    run_plan(plan(2), out=tmp_path / "out")
    assert [state for _, state in job_states(plan(3), tmp_path / "out", keep_steps=False)].count("done") == 2


def test_what_is_lost_is_refused_by_name(small, panoramas, other):
    for sources, axes, words in (
        ([panoramas], ["mapper=leader", "radius=1,2"], r"grid\.axes\.radius was \[2.0, 4.0\], now \[1.0, 2.0\]"),
        ([panoramas], ["mapper=roman2020", "omega=2,4"], r'components\.mapper was \["leader"\], now \["roman2020"\]'),
        ([other], SMALL, r"grid\.sources was"),
        ([panoramas], [*SMALL, "imaging.rows=32"], r"grid\.parameters\.imaging\.rows was \d+, now \[32\]"),
    ):
        with pytest.raises(ResultError, match=words):
            job_states(plan_of(sources, axes), small, keep_steps=True)
    place = {plan_of([source], SMALL).jobs[0].input.source for source in (panoramas, other)}
    (here,) = {plan_of([panoramas], SMALL).jobs[0].input.source}
    (there,) = place - {here}
    with pytest.raises(ResultError, match=r"grid\.localize\.folder:.* was absent, now"):
        job_states(plan_of([other, panoramas], SMALL, localize={here: there}), small, keep_steps=True)


def grid(**changes):
    whole = {"sources": ["a", "b"], "cuts": [[0, 1, None], [0, 2, None]], "exact": None, "axes": {"x": [1, 2]}}
    return {**whole, "components": {"mapper": [{"name": "m", "code": "1"}]}, "parameters": {"y": 3}, **changes}


@pytest.mark.parametrize(
    ("changes", "found"),
    [
        ({}, {}),
        ({"sources": ["c", "b", "a"], "cuts": [[0, 9, 9], [0, 2, None], [0, 1, None]]}, {}),
        ({"axes": {"x": [2, 0, 1], "y": [3, 4]}, "parameters": {}}, {}),
        (
            {"sources": ["a"], "cuts": [[0, 1, 5]]},
            {"sources": (["a", "b"], ["a"]), "cuts.a": ([0, 1, None], [0, 1, 5])},
        ),
        ({"components": {"mapper": [{"name": "m", "code": "2"}]}}, {"components.mapper.m.code": ("1", "2")}),
        ({"axes": {}, "parameters": {"x": 1, "y": 3}}, {"axes.x": ([1, 2], 1)}),
        ({"parameters": {}}, {"parameters.y": (3, None)}),
        ({"exact": ["z", 1, 2]}, {"exact": (None, ["z", 1, 2])}),
        ({"skipped": {"a": ["1.png"]}}, {"skipped.a": (None, ["1.png"])}),
    ],
)
def test_what_a_grid_has_lost(changes, found):
    assert lost(grid(), grid(**changes)) == {f"grid.{name}": both for name, both in found.items()}
