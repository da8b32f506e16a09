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
from omnieval.mapping.partition import Partition
from omnieval.mapping.roman2020.evidence import ROLES, Verdict
from omnieval.mapping.roman2020.mapper import Roman2020
from omnieval.mapping.roman2020.settings import Covariance, Roman2020Settings
from omnieval.mapping.step import EventKind, FinalMap, Placement, Role, Step
from tests.mapping.worlds import World


def test_an_image_seen_before_is_matched_with_itself() -> None:
    descriptions = World(seed=2, visits=7, spread=0.8, noise=0.005, repeats=0.3).describe()
    mapper = Roman2020(Roman2020Settings(n_init=15, n_new=10, gamma=2.0, omega=4.0))
    seen_again = 0
    for step in [mapper.step(description) for description in descriptions]:
        if step.match is None or descriptions[step.frame] is not descriptions[step.frame - 1]:
            continue
        assert step.curves is not None
        twins = [k for k in step.curves.frames.tolist() if descriptions[k] is descriptions[step.frame]]
        if twins:
            seen_again += 1
            assert (step.match.frame, step.match.shift) == (twins[0], 0)
            # 1 / 1e-9 against distances of the order of 1.
            assert step.measured["similarity"] == pytest.approx(1 / len(twins) ** 2, rel=1e-3)
    assert seen_again > 5


@pytest.mark.parametrize("covariance", get_args(Covariance))
@pytest.mark.parametrize("split", ["chronological", "interleaved", "random"])
def test_a_robot_that_stands_still_makes_one_node(covariance: str, split: str) -> None:
    # Values with exact means: rounding noise is not what is tested here.
    still = Description(np.full(4, 0.5, np.float32), np.eye(8, 2, dtype=np.float32))
    mapper = Roman2020(Roman2020Settings(n_init=10, n_new=10, covariance=covariance, split=split))
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
    mapper = Roman2020(Roman2020Settings(n_init=10))
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
    Roman2020Settings,
    n_init=st.integers(10, 15),
    n_new=st.integers(10, 15),
    gamma=st.sampled_from([0.0, 1.5, 5.0]),
    omega=st.sampled_from([0.5, 2.0, 10.0]),
    merge_y=st.sampled_from([0.0, 1.5, 10.0]),
    **{
        name: st.sampled_from(get_args(field.annotation))
        for name, field in Roman2020Settings.model_fields.items()
        if get_args(field.annotation)
    },
)


@settings(max_examples=60, deadline=None, derandomize=True)
@given(world=worlds, config=configs)
def test_every_replay_is_consistent(world: World, config: Roman2020Settings) -> None:
    mapper, partition = Roman2020(config), Partition()
    steps = [mapper.step(description) for description in world.describe()]
    for step in steps:
        assert_step_is_consistent(step, partition, config)
        partition.apply(step)
    assert_books_balance(steps, partition)
    if len(steps) >= config.n_init:
        assert_map_is_consistent(mapper.finish(), steps, partition, config)


def assert_step_is_consistent(step: Step, before: Partition, config: Roman2020Settings) -> None:
    """One step against its own evidence, by the definitions of the method."""
    assert step.measured.keys() <= {column.name for column in Roman2020.columns}
    assert {one.gate for one in step.comparisons} <= {gate.name for gate in Roman2020.gates}
    assert step.role == ROLES[Verdict(step.verdict)]
    refused = step.role is Role.REFUSED
    gate, run = step.compared("node"), step.measured["run"]
    assert run is not None
    if gate is None:
        assert step.verdict == Verdict.INITIAL
        return
    assert gate.threshold == max(config.omega, 3.05 - 0.15 * len(before.active))
    assert gate.of == tuple(sorted(before.active))
    assert (step.match is None) == (not gate.passing)
    created = EventKind.CREATED in [event.kind for event in step.events]
    assert (step.node is None) == (refused and not created)
    assert run == config.n_new if created else run < config.n_new
    assert refused or run == 0
    assert step.margin is not None
    assert step.margin.value >= 0
    if step.match is not None:
        assert_match_is_consistent(step, config)
        assert step.match.node in gate.passing
        assert before.labels[step.match.frame] == step.match.node
    if step.role is Role.JOINED:
        centroid = step.compared("centroid")
        assert centroid is not None
        assert centroid.passed
    assert_thresholds_are_between_their_limits(step)


def assert_thresholds_are_between_their_limits(step: Step) -> None:
    """Every comparison says that its own threshold decides as it did."""
    for one in step.comparisons:
        assert one.same_at(one.threshold), one


def assert_match_is_consistent(step: Step, config: Roman2020Settings) -> None:
    """The similarities are distributions; the best image stands on the highest peak; the columns say the same."""
    curves, measured = step.curves, step.measured
    assert curves is not None
    similarity = curves.values["similarity"]
    assert curves.values["position"].sum() == pytest.approx(1)
    assert curves.values["orientation"].sum() == pytest.approx(1)
    assert measured["similarity"] == measured["prominence"] == similarity[curves.best] == similarity.max()
    for name in ("position", "orientation"):
        assert measured[f"similarity_{name}"] == curves.values[name][curves.best]
    peaks, ratio = measured["peaks"], measured["prominence_ratio"]
    assert peaks is not None
    assert ratio is not None
    if config.prominence_mean == "peaks":
        assert ratio <= peaks * (1 + 1e-9)
    prominence = step.compared("prominence")
    assert (prominence is None) == (curves.level is None) == (peaks < 2)
    if prominence is not None and curves.level is not None:
        assert (prominence.best, prominence.threshold) == (ratio, config.gamma)
        assert prominence.passed == (curves.level <= 1.0) or curves.level == pytest.approx(1.0)


def assert_books_balance(steps: Sequence[Step], partition: Partition) -> None:
    """Nodes are created once, numbered in order, and each is merged or still there."""
    events = [event for step in steps for event in step.events]
    created = [event.node for event in events if event.kind is EventKind.CREATED]
    merged = [event.node for event in events if event.kind is EventKind.MERGED]
    assert created == list(range(1, len(created) + 1))
    assert len({*merged}) == len(merged)
    assert partition.count == len(created) - len(merged)


def assert_map_is_consistent(
    final: FinalMap, steps: Sequence[Step], partition: Partition, config: Roman2020Settings
) -> None:
    """The final partition agrees with what the steps said."""
    assert len(final.labels) == len(final.placements) == len(steps)
    assert {*final.labels.tolist()} - {0} == {*final.nodes}
    assert final.active == partition.active <= {*final.nodes}
    assert len(final.representatives) == len(final.nodes) == partition.count
    founders = {frame for step in steps for event in step.events for frame in event.frames}
    for step, label, placement in zip(steps, final.labels.tolist(), final.placements, strict=True):
        assert (label == 0) == (placement is Placement.UNASSIGNED)
        assert (step.frame in founders) == (placement is Placement.FOUNDING)
        assert (step.verdict == Verdict.ASSIGNED) == (placement is Placement.LOOP_CLOSURE)
        assert (step.verdict == Verdict.PENDING) == (placement is Placement.PENDING)
    left_over = {Placement.RETEST, Placement.FORCED, Placement.UNASSIGNED} & {*final.placements}
    assert (Placement.UNASSIGNED in left_over) == (bool(left_over) and config.leftovers == "unassigned")
