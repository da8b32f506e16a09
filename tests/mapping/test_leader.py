"""The leader: worlds of a few points on a line, and the tree that sweeps any mapper that says what it compares."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Sequence

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from omnieval.descriptors.description import Description
from omnieval.explain.flips import flips
from omnieval.explain.words import decision_text
from omnieval.mapping.interface import Method
from omnieval.mapping.leader import Leader, LeaderSettings
from omnieval.mapping.step import EventKind, FinalMap, Match, NodeEvent, Placement, Role, Step
from omnieval.mapping.sweep import Interval, Points, Sweep
from tests.mapping.test_properties import worlds
from tests.mapping.test_relations import evidence
from tests.mapping.test_sweep import plain
from tests.mapping.worlds import World

WORLDS = (World(seed=1, visits=6), World(seed=2, visits=6, spread=0.8, noise=0.005, repeats=0.2))


def look(x: float) -> Description:
    return Description(np.array([x], np.float32), np.ones((4, 1), np.float32))


def alone(radius: float, descriptions: Iterable[Description]) -> tuple[list[Step], FinalMap]:
    mapper = Leader(LeaderSettings(radius=radius))
    return [mapper.step(description) for description in descriptions], mapper.finish()


def method(radius: float) -> Method:
    return Method.of(Leader, "leader", {"radius": radius})


class TestSixImagesOnALine:
    """At 0, 1, 3, 9, 10 and 2, with a radius of 2.5.

    ======  ====================  ======  ====================  ==============================  ==========
    image   hops, sorted          median  means before          distance over median            joins
    ======  ====================  ======  ====================  ==============================  ==========
    0 at 0                                                                                      makes 1
    1 at 1  1                     1       0                     1                               1, mean 0.5
    2 at 3  1, 2                  1.5     0.5                   2.5 / 1.5 = 1.667               1, mean 4/3
    3 at 9  1, 2, 6               2       4/3                   7.667 / 2 = 3.833               makes 2
    4 at 10 1, 1, 2, 6            1.5     4/3, 9                8.667 / 1.5, 1 / 1.5 = 0.667    2, mean 9.5
    5 at 2  1, 1, 2, 6, 8         2       4/3, 9.5              0.667 / 2 = 1/3, 7.5 / 2        1, mean 1.5
    ======  ====================  ======  ====================  ==============================  ==========
    """

    SEEN = (0, 1, 3, 9, 10, 2)

    def replayed(self, radius: float = 2.5) -> tuple[list[Step], FinalMap]:
        return alone(radius, map(look, self.SEEN))

    def test_every_distance_is_the_one_on_paper(self) -> None:
        steps, _ = self.replayed()
        assert steps[0].comparisons == ()
        expected = [(1,), (2.5 / 1.5,), (23 / 6,), (26 / 4.5, 1 / 1.5), (1 / 3, 3.75)]
        for step, values in zip(steps[1:], expected, strict=True):
            (compared,) = step.comparisons
            assert (compared.gate, compared.parameter, compared.threshold) == ("distance", "radius", 2.5)
            assert compared.values == pytest.approx(values)
            assert compared.of == tuple(range(1, len(values) + 1))

    def test_an_image_joins_the_nearest_node_or_makes_one(self) -> None:
        steps, _ = self.replayed()
        assert [step.node for step in steps] == [1, 1, 1, 2, 2, 1]
        assert [step.verdict for step in steps] == ["first", "near", "near", "too far", "near", "near"]
        assert [step.role for step in steps] == [
            *(Role.FOUNDING, Role.JOINED, Role.JOINED),
            *(Role.REFUSED, Role.JOINED, Role.JOINED),
        ]
        assert [step.frame for step in steps if step.events] == [0, 3]
        assert steps[3].events == (NodeEvent(EventKind.CREATED, 2, frames=(3,)), NodeEvent(EventKind.ACTIVATED, 2))

    def test_the_match_is_the_nearest_image_of_the_node(self) -> None:
        steps, _ = self.replayed()
        assert [step.match for step in steps] == [None, Match(0, 1), Match(1, 1), None, Match(3, 2), Match(1, 1)]

    def test_the_margin_is_that_of_the_nearest_value(self) -> None:
        steps, _ = self.replayed()
        found = [step.margin.value if step.margin else None for step in steps]
        assert found[0] is None
        assert found[1:] == pytest.approx(
            [1.5 / 2.5, (2.5 - 5 / 3) / 2.5, (23 / 6 - 2.5) / 2.5, 1.8333 / 2.5, 0.5], 1e-4
        )

    def test_the_map_in_the_end(self) -> None:
        _, final = self.replayed()
        assert final.labels.tolist() == [1, 1, 1, 2, 2, 1]
        assert final.active == set(final.nodes) == {1, 2}
        founding, closed = Placement.FOUNDING, Placement.LOOP_CLOSURE
        assert final.placements == (founding, closed, closed, founding, closed, closed)
        assert final.representatives[:, 0].tolist() == pytest.approx([1.5, 9.5])

    def test_a_value_that_equals_the_radius_is_within(self) -> None:
        assert [self.replayed(radius)[0][1].node for radius in (1.0, math.nextafter(1.0, 0))] == [1, 2]

    def test_the_explanation_names_the_distance_and_the_radius(self) -> None:
        steps, _ = self.replayed()
        texts = [decision_text(step, method(2.5)) for step in steps]
        assert texts[0] == "first image of node 1"
        assert texts[3] == "refused (too far): relative distance of node 1: 3.83 > radius 2.5"
        assert texts[5] == "joined node 1: best image 1, relative distance of node 1: 0.333 <= radius 2.5"
        said = [[flip.text for flip in flips(step, method(2.5))] for step in steps]
        assert said[0] == []
        assert said[3] == ["radius >= 3.834 would let it join node 1"]
        assert said[4] == ["radius < 0.666 would keep it out of node 2"]

    def test_replayed_with_the_radius_that_a_flip_names_the_comparison_has_turned(self) -> None:
        steps, _ = self.replayed()
        (flip,) = flips(steps[3], method(2.5))
        assert flip.needed is not None
        just_below = math.nextafter(flip.needed, 0)
        for radius, verdict in ((flip.needed, "near"), (just_below, "too far")):
            again, _ = self.replayed(radius)
            assert [step.node for step in again[:3]] == [1, 1, 1]
            assert again[3].verdict == verdict
        (flip,) = flips(steps[2], method(2.5))
        assert flip.passed
        assert flip.needed == steps[2].comparisons[0].best
        for radius, verdict in ((flip.needed, "near"), (math.nextafter(flip.needed, 0), "too far")):
            again, _ = self.replayed(radius)
            assert (again[1].verdict, again[2].verdict) == ("near", verdict)


def test_a_robot_that_stands_still_stays_in_one_node() -> None:
    steps, final = alone(1.0, [look(3)] * 10)
    assert [step.node for step in steps] == [1] * 10
    assert final.representatives.tolist() == [[3.0]]


@pytest.mark.parametrize("world", WORLDS)
def test_later_images_never_change_earlier_steps(world: World) -> None:
    descriptions = world.describe()
    whole = [evidence(step) for step in alone(2.0, descriptions)[0]]
    for length in (1, 20, len(descriptions) // 2):
        assert [evidence(step) for step in alone(2.0, descriptions[:length])[0]] == whole[:length]


def test_asking_for_the_map_changes_nothing() -> None:
    descriptions = WORLDS[0].describe()
    mapper, steps = Leader(), []
    for description in descriptions:
        steps.append(evidence(mapper.step(description)))
        assert len(mapper.finish().labels) == len(steps)
    expected, final = alone(Leader().settings.radius, descriptions)
    assert steps == [evidence(step) for step in expected]
    assert plain(mapper.finish()) == plain(final)


@settings(max_examples=20, deadline=None, derandomize=True)
@given(world=worlds, radii=st.lists(st.floats(0.01, 20.0), min_size=1, max_size=6, unique=True))
def test_a_sweep_gives_every_radius_what_it_would_get_alone(world: World, radii: list[float]) -> None:
    descriptions = world.describe()
    points = tuple(LeaderSettings(radius=radius) for radius in radii)
    sweep = Sweep(Leader, [Points(points)])
    steps: dict[float, list[Step]] = {radius: [] for radius in radii}
    for taken in sweep.steps(descriptions):
        for region, step in taken:
            for one in region.settings:
                assert isinstance(one, LeaderSettings)
                steps[one.radius].append(step.seen_by(one))
    finals = {one: outcome.final for outcome in sweep.finish() for one in outcome.region.settings}
    for one in points:
        expected, final = alone(one.radius, descriptions)
        assert [evidence(step) for step in steps[one.radius]] == [evidence(step) for step in expected]
        assert plain(finals[one]) == plain(final)


def test_the_sweep_shares_what_the_radii_have_in_common() -> None:
    points = tuple(LeaderSettings(radius=float(radius)) for radius in np.geomspace(0.3, 10, 12))
    distinct = [len(taken) for taken in Sweep(Leader, [Points(points)]).steps(WORLDS[0].describe())]
    assert distinct[0] == 1
    assert sorted(distinct) == distinct, "a branch never joins another"
    assert 1 < distinct[-1] <= len(points)


def pieces_of(descriptions: Sequence[Description], low: float, high: float) -> list[tuple[Interval, FinalMap]]:
    sweep = Sweep(Leader, [Interval(LeaderSettings(), "radius", low, high)])
    list(sweep.steps(descriptions))
    return sorted(((outcome.region, outcome.final) for outcome in sweep.finish()), key=lambda piece: piece[0].low)


@pytest.mark.parametrize("world", WORLDS)
def test_the_pieces_of_an_interval_of_radii_are_whole_right_and_as_large_as_can_be(world: World) -> None:
    descriptions = world.describe()
    pieces = pieces_of(descriptions, 0.8, 12.0)
    borders = [region.low for region, _ in pieces] + [pieces[-1][0].high]
    assert (borders[0], borders[-1]) == (0.8, 12.0)
    assert [region.high for region, _ in pieces] == borders[1:], "without a gap"
    assert len(pieces) > 5
    rng = np.random.default_rng(0)
    for region, final in (pieces[i] for i in rng.permutation(len(pieces))[:5]):
        last = math.nextafter(region.high, 0)
        for radius in (region.low, rng.uniform(region.low, last), last):
            assert plain(alone(float(radius), descriptions)[1]) == plain(final), radius
    for (left, _), (right, _) in itertools.pairwise(pieces[:6]):
        one, other = (alone(region.low, descriptions)[0] for region in (left, right))
        assert [step.node for step in one] != [step.node for step in other]


@pytest.mark.parametrize("world", WORLDS)
def test_every_flip_of_a_refusal_holds_in_a_replay_of_its_own(world: World) -> None:
    """At the first image that is refused, the map so far does not depend on the radius from there up to the flip."""
    descriptions = world.describe()
    radius = 1.2
    steps, _ = alone(radius, descriptions)
    first = next(step for step in steps if step.role is Role.REFUSED)
    (flip,) = flips(first, method(radius))
    assert flip.needed is not None
    assert flip.needed > radius
    for value, role in ((flip.needed, Role.JOINED), (math.nextafter(flip.needed, 0), Role.REFUSED)):
        again, _ = alone(value, descriptions[: first.frame + 1])
        assert [step.node for step in again[:-1]] == [step.node for step in steps[: first.frame]]
        assert again[-1].role is role
