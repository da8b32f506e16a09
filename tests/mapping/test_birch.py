"""Birch: a world on a line by hand, scikit-learn's own labels, and the contract."""

from __future__ import annotations

import numpy as np
import pytest
from sklearn.cluster import Birch as Tree

from omnieval.descriptors.description import Description
from omnieval.mapping.birch import Birch, BirchSettings
from omnieval.mapping.step import Match, Placement, Role
from omnieval.testing import check_mapper
from tests.mapping.worlds import World


def look(x: float) -> Description:
    return Description(np.array([x], np.float32), np.ones((4, 1), np.float32))


def test_five_images_on_a_line() -> None:
    """At 0, 1, 3, then 2 and 9; the median of the hops 1 and 2 is 1.5, so a radius of 0.5 is 0.75.

    Of 0 and 1 the radius is 0.5: one node. With 3 it would be sqrt(10/3 - 16/9) = 1.247, so 3 makes another, which 2
    joins (radius 0.5, the mean 0.5 is farther). From the mean 2.5, 9 is too far: sqrt(94/3 - (14/3)^2) = 3.091.
    """
    mapper = Birch(BirchSettings(radius=0.5, warm_up=3))
    steps = [mapper.step(look(x)) for x in (0, 1, 3, 2, 9)]
    assert [step.node for step in steps] == [None, None, 2, 2, 3]
    assert [step.verdict for step in steps] == ["too early", "too early", "first", "narrow", "too wide"]
    assert [step.role for step in steps[2:]] == [Role.FOUNDING, Role.JOINED, Role.REFUSED]
    assert [(event.node, event.frames) for event in steps[2].events[::2]] == [(1, (0, 1)), (2, (2,))]
    assert steps[3].match == Match(2, 2)
    compared = [one for step in steps[3:] for one in step.comparisons]
    assert [one.of for one in compared] == [(2,), (2,)]
    assert [one.best for one in compared] == pytest.approx([0.5 / 1.5, 3.0912 / 1.5], rel=1e-4)
    final = mapper.finish()
    assert final.labels.tolist() == [1, 1, 2, 2, 3]
    assert final.representatives[:, 0].tolist() == [0.5, 2.5, 9.0]
    assert final.placements[3] is Placement.LOOP_CLOSURE


def test_the_nodes_are_those_of_scikit_learn() -> None:
    descriptions = World(seed=3, visits=5, spread=0.8).describe()
    mapper = Birch(BirchSettings(radius=2.0, warm_up=20))
    for description in descriptions:
        mapper.step(description)
    points = np.array([description.position for description in descriptions], np.float64)
    threshold = 2.0 * float(np.median(np.linalg.norm(np.diff(points[:20], axis=0), axis=1)))
    tree = Tree(threshold=threshold, branching_factor=2000, n_clusters=None).fit(points)
    np.testing.assert_allclose(mapper.finish().representatives, tree.subcluster_centers_, rtol=1e-9)


def test_what_was_compared_agrees_with_what_was_decided() -> None:
    mapper = Birch(BirchSettings(warm_up=20))
    steps = [mapper.step(description) for description in World(seed=5, visits=5, spread=0.8).describe()]
    told = [(step.comparisons[0].passed, step.verdict == "narrow") for step in steps[20:]]
    assert all(passed == joined for passed, joined in told)
    assert {joined for _, joined in told} == {True, False}


def test_too_few_images_are_told() -> None:
    assert Birch().too_short(49) is not None
    assert Birch().too_short(50) is None
    assert Birch().finish().labels.tolist() == []


def test_standing_still_is_one_node() -> None:
    mapper = Birch(BirchSettings(warm_up=5))
    assert [mapper.step(look(3.0)).node for _ in range(20)] == [None] * 4 + [1] * 16


def test_it_keeps_the_contract() -> None:
    check_mapper(Birch)
