"""A sweep gives every configuration what a mapper of its own gives it, to the bit, and misses no change."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from omnieval.descriptors.description import Description
from omnieval.errors import ConfigError
from omnieval.mapping.roman2020.mapper import Roman2020
from omnieval.mapping.roman2020.settings import Roman2020Settings
from omnieval.mapping.step import Comparison, FinalMap, Step
from omnieval.mapping.sweep import Interval, Outcome, Points, Sweep
from tests.mapping.test_properties import configs, worlds
from tests.mapping.test_relations import decision, evidence
from tests.mapping.worlds import World

WORLDS = (
    World(seed=1, visits=6),
    World(seed=2, visits=6, spread=0.8, noise=0.005),
    World(seed=3, visits=6, twins=True, noise=0.05),
)
GRID = {"omega": (1.5, 4.0), "merge_y": (0.0, 1.5, 8.0), "gamma": (1.5, 2.5), "n_new": (10, 13)}


def grid(base: Roman2020Settings) -> tuple[Roman2020Settings, ...]:
    points = itertools.product(*GRID.values())
    return tuple(base.model_copy(update=dict(zip(GRID, point, strict=True))) for point in points)


def alone(config: Any, descriptions: Sequence[Description]) -> tuple[list[Step], FinalMap]:
    mapper = Roman2020(config)
    return [mapper.step(description) for description in descriptions], mapper.finish()


def plain(final: FinalMap) -> dict[str, Any]:
    """A final map, comparable with ==."""
    return {k: v.tolist() if isinstance(v, np.ndarray) else v for k, v in dataclasses.asdict(final).items()}


def swept(
    points: Sequence[Roman2020Settings], descriptions: Sequence[Description]
) -> dict[Roman2020Settings, tuple[list[Step], FinalMap]]:
    """What a sweep gives every configuration."""
    sweep = Sweep(Roman2020, [Points(tuple(points))])
    steps: dict[Any, list[Step]] = {config: [] for config in points}
    for taken in sweep.steps(descriptions):
        for region, step in taken:
            for config in region.settings:
                steps[config].append(dataclasses.replace(step.seen_by(config), curves=step.curves))
    finals = {config: outcome.final for outcome in sweep.finish() for config in outcome.region.settings}
    return {config: (steps[config], finals[config]) for config in points}


def level_aside(step: Step) -> Step:
    """A step but for the level its curve must reach, which depends on a swept parameter."""
    return (
        step if step.curves is None else dataclasses.replace(step, curves=dataclasses.replace(step.curves, level=None))
    )


def assert_alike(found: tuple[list[Step], FinalMap], expected: tuple[list[Step], FinalMap]) -> None:
    for one, other in zip(found[0], expected[0], strict=True):
        assert evidence(level_aside(one)) == evidence(level_aside(other))
    assert plain(found[1]) == plain(expected[1])


@pytest.mark.parametrize("world", WORLDS[1:])
def test_every_configuration_of_a_grid_gets_what_it_would_get_alone(world: World) -> None:
    descriptions = world.describe()
    points = grid(Roman2020Settings(n_init=15))
    found = swept(points, descriptions)
    for config in points:
        assert_alike(found[config], alone(config, descriptions))


@settings(max_examples=25, deadline=None, derandomize=True)
@given(world=worlds, base=configs, others=st.lists(configs, min_size=1, max_size=3))
def test_so_does_every_configuration_under_every_option(
    world: World, base: Roman2020Settings, others: list[Roman2020Settings]
) -> None:
    descriptions = world.describe()
    if len(descriptions) < base.n_init:
        with pytest.raises(ConfigError, match="the first node needs"):
            swept([base], descriptions)
        return
    shared = [{name: getattr(other, name) for name in Roman2020.swept} for other in others]
    points = {base, *(base.model_copy(update=values) for values in shared)}
    found = swept(sorted(points, key=repr), descriptions)
    for config in points:
        assert_alike(found[config], alone(config, descriptions))


def test_what_is_shared_is_computed_once() -> None:
    descriptions = WORLDS[0].describe()
    points = grid(Roman2020Settings(n_init=15))
    distinct = [len(taken) for taken in Sweep(Roman2020, [Points(points)]).steps(descriptions)]
    assert distinct[0] == 1
    assert sorted(distinct) == distinct, "a branch never joins another"
    assert 1 < distinct[-1] <= len(points)


def test_every_image_is_taken_once_by_everybody() -> None:
    points = grid(Roman2020Settings(n_init=15))
    for taken in Sweep(Roman2020, [Points(points)]).steps(WORLDS[1].describe()):
        found = [config for region, _ in taken for config in region.settings]
        assert sorted(found, key=repr) == sorted(points, key=repr)


def test_costs_are_divided_among_those_who_share_them() -> None:
    points = grid(Roman2020Settings(n_init=15))
    sweep = Sweep(Roman2020, [Points(points)])
    list(sweep.steps(WORLDS[0].describe()))
    assert all(outcome.seconds > 0 for outcome in sweep.finish())


def exact(parameter: str, low: float, high: float, descriptions: Sequence[Description]) -> list[Outcome[Interval]]:
    sweep = Sweep(Roman2020, [Interval(Roman2020Settings(n_init=15, n_new=10, gamma=2.0), parameter, low, high)])
    list(sweep.steps(descriptions))
    return sorted(sweep.finish(), key=lambda outcome: outcome.region.low)


@pytest.mark.parametrize("world", WORLDS)
@pytest.mark.parametrize(("parameter", "low", "high"), [("merge_y", 0.0, 12.0), ("omega", 1.0, 5.0), ("gamma", 1, 4)])
def test_the_pieces_of_an_interval_are_whole_and_right(world: World, parameter: str, low: float, high: float) -> None:
    descriptions = world.describe()
    pieces = exact(parameter, low, high, descriptions)
    borders = [piece.region.low for piece in pieces] + [pieces[-1].region.high]
    assert (borders[0], borders[-1]) == (low, high)
    assert [piece.region.high for piece in pieces] == borders[1:], "without a gap"
    rng = np.random.default_rng(0)
    for piece in [pieces[i] for i in rng.permutation(len(pieces))[:2]]:
        last = float(np.nextafter(piece.region.high, -np.inf))
        for value in (piece.region.low, rng.uniform(piece.region.low, last), last):
            config = piece.region.base.model_copy(update={parameter: float(value)})
            assert plain(alone(config, descriptions)[1]) == plain(piece.final), (parameter, value)


@pytest.mark.parametrize(("parameter", "low", "high"), [("merge_y", 0.0, 20.0), ("omega", 1.0, 3.0), ("gamma", 1, 2)])
def test_pieces_part_where_something_is_decided_otherwise(parameter: str, low: float, high: float) -> None:
    """Left and right of a border a step differs, or at least a leftover was tested with another outcome."""
    descriptions = WORLDS[0].describe()
    pieces = exact(parameter, low, high, descriptions)
    assert len(pieces) > 1
    differing = 0
    for left, right in itertools.pairwise(pieces[:8]):
        runs = [alone(region.representative, descriptions) for region in (left.region, right.region)]
        one, other = ([decision(step) for step in steps] for steps, _ in runs)
        differing += one != other
    assert differing > 0


def test_a_comparison_knows_for_which_values_it_comes_out_the_same() -> None:
    below = Comparison("node", (1.5, 3.0), 2.0, 1.5, 3.0, "omega")
    assert below.span == (1.5, 3.0)
    assert [below.same_at(value) for value in (1.4, 1.5, 2.9, 3.0)] == [False, True, True, False]
    floored = dataclasses.replace(below, floor=1.75)
    assert floored.span == (-np.inf, 3.0)
    assert floored.same_at(0.1)
    reaching = Comparison("prominence", (3.0,), 2.0, 1.5, 3.0, "gamma", reaches=True)
    assert [reaching.same_at(value) for value in (1.5, 1.6, 3.0, 3.1)] == [False, True, True, False]
    first, beyond = reaching.span
    assert reaching.same_at(first)
    assert not reaching.same_at(np.nextafter(first, 0))
    assert not reaching.same_at(beyond)
    assert reaching.same_at(np.nextafter(beyond, 0))
