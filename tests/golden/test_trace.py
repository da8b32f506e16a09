"""The golden decisions: what the mapper decided about the synthetic building, image by image, it decides again.

The traces are those of `omnieval check`, which judges metrics; here every decision counts. A mapper that is meant to
decide otherwise gets new ones from ``omnieval check --update --reference runs/reference/synthetic.toml``.
"""

import os
from pathlib import Path

import polars as pl
import pytest

import omnieval
from omnieval.datasets.check import check
from omnieval.datasets.synthetic.first import ROOMS
from omnieval.loop import replay
from omnieval.regression.cases import replayed, selection_of
from omnieval.regression.reference import read_reference
from omnieval.regression.trace import first_parting, read_trace, write_trace

REFERENCE = Path(__file__).parents[2] / "runs" / "reference" / "synthetic.toml"
CASE, SOURCE = "synthetic-cloudy-hog", "synthetic:cloudy"


def unchanged(trace, steps):
    """Fail with the first step that is decided otherwise, and by how little, if there is one."""
    parting = first_parting(trace, steps)
    if parting is None:
        return
    margin = "the replay has ended there"
    if parting.got is not None:
        value, gate = steps.select("margin", "margin_gate").row(parting.frame)
        margin = "it has no margin" if value is None else f"its margin is {value:.3g} ({gate})"
    pytest.fail(
        f"step {parting.frame} ({parting.file}) is the first that is decided otherwise: {parting.expected} became "
        f"{parting.got}; {margin}. Where that is a rounding error, the machine or a library may have changed it."
    )


@pytest.fixture
def building(monkeypatch):
    """The building takes longer to render than to map: where one was made already, the environment may say so."""
    if made := os.environ.get("OMNIEVAL_TEST_BUILDING"):
        monkeypatch.setenv("OMNIEVAL_CACHE", made)


@pytest.mark.slow
@pytest.mark.usefixtures("building")
def test_the_building_is_decided_as_ever():
    (case,) = (case for case in read_reference(REFERENCE) if case.name == CASE)
    assert case.trace is not None
    trace = read_trace(REFERENCE.parent / case.trace)
    with replayed(case.source, selection_of(case)) as run:
        assert len(trace) == len(run.steps)
        unchanged(trace, run.steps)


@pytest.mark.slow
@pytest.mark.usefixtures("building")
def test_the_building_passes_the_check():
    """It stands here because rendering the whole building takes longer than looking at it twice."""
    report = check(SOURCE)
    assert report.findings == ()
    assert set(report.rooms) == {room.code for room in ROOMS} - {"PA"}  # entered in another light only


@pytest.fixture(scope="module")
def golden(panoramas, tmp_path_factory):
    """The steps of a small replay and their trace."""
    folder = tmp_path_factory.mktemp("golden")
    config = omnieval.configure(n_init=10, n_new=10, gamma=1.0, omega=3.5, merge_y=0.5)
    steps = replay(panoramas, config=config, out=folder / "run").steps
    write_trace(steps, folder / "trace.parquet")
    return steps, read_trace(folder / "trace.parquet")


def test_an_unchanged_mapper_passes(golden):
    steps, trace = golden
    unchanged(trace, steps)


@pytest.mark.parametrize(("column", "value"), [("verdict", "forgotten"), ("node", 99), ("best_frame", 0)])
@pytest.mark.parametrize("frame", [12, 40, 79])
def test_a_changed_decision_is_named_with_its_margin(golden, column, value, frame):
    steps, trace = golden
    was = steps[column][frame]
    if column == "verdict":
        value = "prominence" if was != "prominence" else "centroid"
    at = pl.col("frame").is_in([frame, *range(frame + 1, len(steps), 2)])  # and many later ones
    changed = steps.with_columns(
        pl.when(at).then(pl.lit(value, steps.schema[column])).otherwise(pl.col(column)).alias(column)
    )
    with pytest.raises(pytest.fail.Exception) as failure:
        unchanged(trace, changed)
    message = str(failure.value)
    assert message.startswith(f"step {frame} ({steps['file'][frame]}) is the first")
    assert f"{column!r}: {was!r}" in message
    assert f"{column!r}: {value!r}" in message
    assert f"its margin is {steps['margin'][frame]:.3g} ({steps['margin_gate'][frame]})" in message


@pytest.mark.parametrize("kept", [0, 1, 50, 79])
def test_a_replay_that_ends_early_is_named_where_it_ends(golden, kept):
    steps, trace = golden
    with pytest.raises(pytest.fail.Exception, match=rf"step {kept} \(None\) .* the replay has ended there"):
        unchanged(trace, steps.head(kept))
