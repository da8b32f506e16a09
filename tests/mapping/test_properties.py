"""What must hold within any replay, whatever the numbers are."""

from __future__ import annotations

from collections.abc import Sequence
from typing import get_args

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from omnieval.descriptors.description import Description
from omnieval.errors import ConfigError
from omnieval.mapping.config import Covariance, MapperConfig
from omnieval.mapping.mapper import Mapper
from omnieval.mapping.step import EventKind, FinalMap, Match, Placement, Step, Verdict
from tests.mapping.worlds import World


def test_an_image_seen_before_is_matched_with_itself() -> None:
    descriptions = World(seed=2, visits=7, spread=0.8, noise=0.005, repeats=0.3).describe()
    mapper = Mapper(MapperConfig(n_init=15, n_new=10, gamma=2.0, omega=4.0))
    seen_again = 0
    for step in [mapper.step(description) for description in descriptions]:
        if step.match is None or descriptions[step.frame] is not descriptions[step.frame - 1]:
            continue
        twins = [k for k in step.match.frames.tolist() if descriptions[k] is descriptions[step.frame]]
        if twins:
            seen_again += 1
            assert step.match.best_frame == twins[0]
            assert step.match.shift == 0
            # 1 / 1e-9 against distances of the order of 1.
            assert step.match.similarity[step.match.best] == pytest.approx(1 / len(twins) ** 2, rel=1e-3)
    assert seen_again > 5


@pytest.mark.parametrize("covariance", get_args(Covariance))
@pytest.mark.parametrize("split", ["chronological", "interleaved", "random"])
def test_a_robot_that_stands_still_makes_one_node(covariance: str, split: str) -> None:
    # Values with exact means: rounding noise is not what is tested here.
    still = Description(np.full(4, 0.5, np.float32), np.eye(8, 2, dtype=np.float32))
    mapper = Mapper(MapperConfig(n_init=10, n_new=10, covariance=covariance, split=split))
    steps = [mapper.step(still) for _ in range(30)]
    assert [step.verdict for step in steps[10:]] == [Verdict.ASSIGNED] * 20
    assert mapper.finish().labels.tolist() == [1] * 30


@pytest.mark.parametrize(
    "odd",
    [
        Description(np.full(4, np.nan, np.float32), np.zeros((8, 2), np.float32)),
        Description(np.zeros(4, np.float32), np.full((8, 2), np.inf, np.float32)),
        Description(np.zeros(5, np.float32), np.zeros((8, 2), np.float32)),
        Description(np.zeros((4, 1), np.float32), np.zeros((8, 2), np.float32)),
        Description(np.zeros(4, np.float32), np.zeros(16, np.float32)),
        Description(np.zeros(4, np.float32), np.zeros((1, 2), np.float32)),
        Description(np.zeros(4, np.float32), np.zeros((8, 1), np.float32)),
        Description(np.zeros(4, np.float32), np.zeros((4, 2), np.float32)),
    ],
)
def test_an_impossible_description_is_refused_and_leaves_the_mapper_as_it_was(odd: Description) -> None:
    usual = Description(np.zeros(4, np.float32), np.zeros((8, 2), np.float32))
    mapper = Mapper(MapperConfig(n_init=10))
    mapper.step(usual)
    with pytest.raises(ConfigError, match="image 1"):
        mapper.step(odd)
    assert mapper.step(usual).frame == 1


worlds = st.builds(
    World,
    seed=st.integers(0, 10**6),
    places=st.integers(2, 4),
    visits=st.integers(2, 5),
    dwell=st.just((8, 20)),
    passage=st.integers(0, 3),
    spread=st.sampled_from([0.2, 0.8]),
    noise=st.sampled_from([0.0, 0.01, 0.1]),
    repeats=st.sampled_from([0.0, 0.2, 0.9]),
    dimension=st.integers(1, 12),
    cells=st.sampled_from([1, 7, 16]),
    bins=st.integers(1, 3),
)
configs = st.builds(
    MapperConfig,
    n_init=st.integers(10, 15),
    n_new=st.integers(10, 15),
    gamma=st.sampled_from([0.0, 1.5, 5.0]),
    omega=st.sampled_from([0.5, 2.0, 10.0]),
    merge_y=st.sampled_from([0.0, 1.5, 10.0]),
    **{
        name: st.sampled_from(get_args(field.annotation))
        for name, field in MapperConfig.model_fields.items()
        if get_args(field.annotation)
    },
)


@settings(max_examples=100, deadline=None, derandomize=True)
@given(world=worlds, config=configs)
def test_every_replay_is_consistent(world: World, config: MapperConfig) -> None:
    mapper = Mapper(config)
    steps = [mapper.step(description) for description in world.describe()]
    previous: Step | None = None
    for step in steps:
        assert_step_is_consistent(step, previous, config)
        previous = step
    assert_books_balance(steps)
    if len(steps) >= config.n_init:
        assert_map_is_consistent(mapper.finish(), steps, config)


def assert_step_is_consistent(step: Step, previous: Step | None, config: MapperConfig) -> None:
    """One step against its own evidence, by the definitions of the method."""
    refused = step.verdict in {Verdict.NO_CANDIDATE, Verdict.PROMINENCE, Verdict.CENTROID}
    if step.gate is None:
        assert step.verdict is Verdict.INITIAL
        return
    assert previous is not None
    assert step.gate.x == max(config.omega, 3.05 - 0.15 * previous.active)
    assert len(step.gate.nodes) == len(step.gate.ratios) == previous.active
    assert (step.match is None) == (len(step.gate.candidates) == 0)
    created = EventKind.CREATED in [event.kind for event in step.events]
    assert (step.node is None) == (refused and not created)
    assert step.run == config.n_new if created else step.run < config.n_new
    assert refused or step.run == 0
    assert step.margin is not None
    assert step.margin.value >= 0
    if step.match is not None:
        assert_match_is_consistent(step.match, config)
        assert step.match.node in step.gate.candidates
    if step.verdict is Verdict.ASSIGNED:
        assert step.centroid is not None
        assert step.centroid.shift <= step.centroid.bound


def assert_match_is_consistent(match: Match, config: MapperConfig) -> None:
    """The similarities are distributions; the best image stands on the highest peak."""
    assert match.position.sum() == pytest.approx(1)
    assert match.orientation.sum() == pytest.approx(1)
    assert match.similarity[match.best] == match.similarity.max()
    assert match.prominence == match.similarity.max()
    if config.prominence_mean == "peaks":
        assert match.prominence_ratio <= match.peaks * (1 + 1e-9)


def assert_books_balance(steps: Sequence[Step]) -> None:
    """Nodes are created once, numbered in order, and each is merged or still there."""
    events = [event for step in steps for event in step.events]
    created = [event.node for event in events if event.kind is EventKind.CREATED]
    merged = [event.node for event in events if event.kind is EventKind.MERGED]
    assert created == list(range(1, len(created) + 1))
    assert len({*merged}) == len(merged)
    assert steps[-1].active + steps[-1].pending == len(created) - len(merged)


def assert_map_is_consistent(final: FinalMap, steps: Sequence[Step], config: MapperConfig) -> None:
    """The final partition agrees with what the steps said."""
    assert len(final.labels) == len(final.placements) == len(steps)
    assert {*final.labels.tolist()} - {0} == {*final.nodes}
    assert final.active <= {*final.nodes}
    assert len(final.representatives) == len(final.nodes) == steps[-1].active + steps[-1].pending
    founders = {frame for step in steps for event in step.events for frame in event.frames}
    for step, label, placement in zip(steps, final.labels.tolist(), final.placements, strict=True):
        assert (label == 0) == (placement is Placement.UNASSIGNED)
        assert (step.frame in founders) == (placement is Placement.FOUNDING)
        assert (step.verdict is Verdict.ASSIGNED) == (placement is Placement.LOOP_CLOSURE)
        assert (step.verdict is Verdict.PENDING) == (placement is Placement.PENDING)
    left_over = {Placement.RETEST, Placement.FORCED, Placement.UNASSIGNED} & {*final.placements}
    assert (Placement.UNASSIGNED in left_over) == (bool(left_over) and config.leftovers == "unassigned")
