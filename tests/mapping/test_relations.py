"""What must hold between two replays, whatever the numbers are."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from typing import Any, get_args

import numpy as np
import pytest

from omnieval.descriptors.description import Description
from omnieval.mapping.roman2020.mapper import Roman2020
from omnieval.mapping.roman2020.settings import Covariance, Roman2020Settings
from omnieval.mapping.step import EventKind, Step
from tests.mapping.worlds import World

WORLDS = (
    World(seed=1, visits=7),
    World(seed=2, visits=7, spread=0.8, noise=0.005),
    World(seed=3, visits=7, twins=True, noise=0.05),
)
BASE: dict[str, Any] = {"n_init": 15, "n_new": 10, "gamma": 2.0}


def replay(descriptions: Sequence[Description], **options: Any) -> list[Step]:
    mapper = Roman2020(Roman2020Settings(**(BASE | options)))
    return [mapper.step(description) for description in descriptions]


def evidence(step: Step) -> dict[str, Any]:
    """Every number of a step, comparable with ==."""
    curves = step.curves
    if curves is None:
        return dataclasses.asdict(step)
    arrays = {"frames": curves.frames, "slots": curves.slots, **curves.values}
    plain = {name: array.tolist() for name, array in arrays.items()} | {"best": curves.best, "level": curves.level}
    return dataclasses.asdict(dataclasses.replace(step, curves=None)) | {"curves": plain | {"size": curves.size}}


def decision(step: Step) -> tuple[Any, ...]:
    """What a step decided, without the numbers."""
    best = None if step.match is None else step.match.frame
    return step.frame, step.verdict, step.node, candidates(step), best, step.measured.get("run"), step.events


def candidates(step: Step) -> tuple[int, ...]:
    gate = step.compared("node")
    return () if gate is None else gate.passing


def decisions(steps: Sequence[Step]) -> list[tuple[Any, ...]]:
    return [decision(step) for step in steps]


def until_they_part(first: Sequence[Step], second: Sequence[Step]) -> list[tuple[Step, Step]]:
    """The steps that were taken in the same state: up to and including the first that decided differently."""
    pairs = list(zip(first, second, strict=True))
    same = [decision(a) == decision(b) for a, b in pairs]
    return pairs[: same.index(False) + 1] if False in same else pairs


def positions_changed(descriptions: Sequence[Description], change: Callable[[Any], Any]) -> list[Description]:
    return [dataclasses.replace(d, position=np.asarray(change(d.position), np.float32)) for d in descriptions]


@pytest.mark.parametrize("world", WORLDS)
def test_turning_the_robot_changes_no_decision(world: World) -> None:
    straight = world.describe()
    turns = np.random.default_rng(0).integers(world.cells, size=len(straight)).tolist()
    turned = [
        dataclasses.replace(d, orientation=np.roll(d.orientation, turn, axis=0))
        for d, turn in zip(straight, turns, strict=True)
    ]
    first, second = replay(straight), replay(turned)
    assert decisions(first) == decisions(second)
    matched = [(a, b) for a, b in zip(first, second, strict=True) if a.match and b.match]
    assert len(matched) > 20
    for a, b in matched:
        assert a.match is not None
        assert b.match is not None
        turn = turns[a.frame] - turns[a.match.frame]
        assert b.match.shift == (a.match.shift + turn) % world.cells


@pytest.mark.parametrize("world", WORLDS[:2])
@pytest.mark.parametrize("covariance", get_args(Covariance))
def test_the_unit_of_the_descriptors_does_not_matter(world: World, covariance: str) -> None:
    plain = world.describe()
    scaled = [Description(d.position * np.float32(8), d.orientation * np.float32(0.25)) for d in plain]
    first, second = replay(plain, covariance=covariance), replay(scaled, covariance=covariance)
    assert decisions(first) == decisions(second)


@pytest.mark.parametrize("world", WORLDS[:2])
@pytest.mark.parametrize("covariance", get_args(Covariance))
def test_the_order_and_sign_of_the_components_do_not_matter(world: World, covariance: str) -> None:
    plain = world.describe()
    order = np.random.default_rng(0).permutation(world.dimension)
    signs = np.where(np.arange(world.dimension) % 2, -1, 1)
    shuffled = positions_changed(plain, lambda position: (position * signs)[order])
    assert decisions(replay(plain, covariance=covariance)) == decisions(replay(shuffled, covariance=covariance))


@pytest.mark.parametrize("covariance", sorted({*get_args(Covariance)} - {"diagonal"}))
def test_only_diagonal_depends_on_the_axes(covariance: str) -> None:
    plain = WORLDS[0].describe()
    axes, _ = np.linalg.qr(np.random.default_rng(0).normal(size=(WORLDS[0].dimension,) * 2))
    rotated = positions_changed(plain, lambda position: axes @ position)
    assert decisions(replay(plain, covariance=covariance)) == decisions(replay(rotated, covariance=covariance))
    diagonal = "diagonal"
    assert decisions(replay(plain, covariance=diagonal)) != decisions(replay(rotated, covariance=diagonal))


@pytest.mark.parametrize("world", WORLDS)
@pytest.mark.parametrize(
    ("fewer", "more"),
    [
        ({"omega": 1.0}, {"omega": 3.5}),
        ({"omega": 3.5}, {"omega": 6.0}),
        ({"node_gate": "two-sided"}, {"node_gate": "one-sided"}),
    ],
)
def test_a_wider_gate_never_loses_a_candidate(world: World, fewer: dict[str, Any], more: dict[str, Any]) -> None:
    descriptions = world.describe()
    pairs = until_they_part(replay(descriptions, **fewer), replay(descriptions, **more))
    assert all({*candidates(a)} <= {*candidates(b)} for a, b in pairs)
    assert decision(pairs[-1][0]) != decision(pairs[-1][1])


@pytest.mark.parametrize("world", WORLDS)
@pytest.mark.parametrize("mean", ["peaks", "candidates"])
def test_a_higher_gamma_only_refuses_more(world: World, mean: str) -> None:
    descriptions = world.describe()
    low, high = (2.0, 3.0) if mean == "peaks" else (10.0, 25.0)
    pairs = until_they_part(
        replay(descriptions, gamma=low, prominence_mean=mean),
        replay(descriptions, gamma=high, prominence_mean=mean),
    )
    assert all(b.compared("centroid") is None or a.compared("centroid") is not None for a, b in pairs)
    passed, refused = pairs[-1]
    assert passed.compared("centroid") is not None
    assert refused.compared("centroid") is None


@pytest.mark.parametrize("world", WORLDS)
def test_a_higher_merge_y_only_merges_more(world: World) -> None:
    descriptions = world.describe()
    pairs = until_they_part(replay(descriptions, merge_y=0.0), replay(descriptions, merge_y=500.0))
    apart, merged = ([event.kind for event in step.events] for step in pairs[-1])
    assert EventKind.MERGED not in apart
    assert merged == [EventKind.CREATED, EventKind.MERGED]


@pytest.mark.parametrize("world", WORLDS)
@pytest.mark.parametrize("split", ["chronological", "random"])
def test_later_images_never_change_earlier_steps(world: World, split: str) -> None:
    descriptions = world.describe()
    whole = [evidence(step) for step in replay(descriptions, split=split)]
    for length in (20, len(descriptions) // 2):
        assert [evidence(step) for step in replay(descriptions[:length], split=split)] == whole[:length]


def test_asking_for_the_map_changes_nothing() -> None:
    descriptions = WORLDS[0].describe()
    mapper = Roman2020(Roman2020Settings(**BASE))
    steps = []
    for number, description in enumerate(descriptions, start=1):
        steps.append(evidence(mapper.step(description)))
        if number >= BASE["n_init"] and number % 10 == 0:
            assert len(mapper.finish().labels) == number
    assert steps == [evidence(step) for step in replay(descriptions)]
    first, second = mapper.finish(), mapper.finish()
    assert first.labels.tolist() == second.labels.tolist()
    assert first.placements == second.placements


def test_the_mapper_keeps_its_own_copy() -> None:
    descriptions = WORLDS[0].describe()
    mapper = Roman2020(Roman2020Settings(**BASE))
    buffer = Description(np.empty_like(descriptions[0].position), np.empty_like(descriptions[0].orientation))
    steps = []
    for description in descriptions:
        buffer.position[...] = description.position
        buffer.orientation[...] = description.orientation
        steps.append(evidence(mapper.step(buffer)))
        np.testing.assert_array_equal(buffer.position, description.position)
        np.testing.assert_array_equal(buffer.orientation, description.orientation)
    assert steps == [evidence(step) for step in replay(descriptions)]


@pytest.mark.parametrize("world", WORLDS)
@pytest.mark.parametrize(("parameter", "gate"), [("omega", "node"), ("gamma", "prominence")])
def test_the_smallest_margin_is_where_the_replay_tips_over(world: World, parameter: str, gate: str) -> None:
    # omega = 4 is above 3.05 - 0.15 C for every C, so that it is the threshold itself.
    options = {"omega": 4.0, "gamma": 2.0}
    descriptions = world.describe()
    steps = replay(descriptions, **options)
    found = [step.margin.value for step in steps if step.margin]
    smallest = min(found)
    assert 0 < smallest < 0.5
    for factor in (1 - 0.9 * smallest, 1 + 0.9 * smallest):
        changed = options | {parameter: options[parameter] * factor}
        assert decisions(replay(descriptions, **changed)) == decisions(steps)

    margin, frame = min((s.margin.value, s.frame) for s in steps if s.margin and s.margin.gate == gate)
    others = [
        replay(descriptions[: frame + 1], **options | {parameter: options[parameter] * (1 + change)})
        for change in (-1.01 * margin, 1.01 * margin)
    ]
    assert any(decisions(other) != decisions(steps[: frame + 1]) for other in others)
