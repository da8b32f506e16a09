"""Decided again, a run decides as its tables say, and shows the curves that these do not hold."""

import dataclasses

import polars as pl
import pytest

import omnieval
from omnieval.errors import ResultError
from omnieval.loop import replay
from omnieval.mapping.leader import Leader
from omnieval.material.reopened import reopened
from omnieval.remap import decided_again, remapped
from omnieval.results.tables import read_steps

PAPERS = {"n_init": 10, "n_new": 10, "gamma": 1.0, "omega": 3.5, "merge_y": 0.5}


def as_recorded(step):
    """A step as a table holds it: without curves, and without what was not measured."""
    measured = {name: value for name, value in step.measured.items() if value is not None}
    return dataclasses.replace(step, curves=None, measured=measured)


@pytest.fixture(scope="module", params=["roman2020", "leader"])
def run(request, panoramas, tmp_path_factory):
    settings = PAPERS if request.param == "roman2020" else {"radius": 1.5}
    out = tmp_path_factory.mktemp("remap") / request.param
    return replay(panoramas, mapper=request.param, config=settings, out=out)


def test_every_step_is_that_of_the_table(run):
    with reopened(run) as material:
        again = list(remapped(run, material))
    recorded = [step for step, _ in read_steps(run.steps, run.method.columns)]
    assert [as_recorded(step) for step in again] == recorded
    curves = [step.curves for step in again if step.curves is not None]
    assert {name for one in curves for name in one.values} == set(run.method.curves)
    best = [int(one.frames[one.best]) for one in curves]
    assert best == [step.match.frame for step in again if step.curves is not None and step.match is not None]


def test_a_part_of_a_run_is_decided_again_alone(run):
    with reopened(run) as material:
        steps = list(decided_again(run.config.mapper, run.steps.head(30), material, "the beginning"))
    assert [step.verdict for step in steps] == run.steps["verdict"].head(30).to_list()


@pytest.mark.parametrize(
    "change", [pl.lit("else").alias("verdict"), (pl.col("node") + 1).alias("node"), (pl.col("best_frame") * 0)]
)
def test_a_table_that_says_otherwise_is_refused(run, change):
    other = run.steps.with_columns(change)
    with reopened(run) as material, pytest.raises(ResultError, match=r"step \d+ of there is decided differently now"):
        list(decided_again(run.config.mapper, other, material, "there"))


def test_a_mapper_that_was_an_object_of_this_process_is_not_decided_again(panoramas, tmp_path):
    class Own(Leader):
        name = "own"

    run = omnieval.replay(panoramas, mapper=Own(), out=tmp_path / "run", limit=20)
    with reopened(run) as material, pytest.raises(ResultError, match="the mapper own was an object"):
        list(remapped(run, material))
