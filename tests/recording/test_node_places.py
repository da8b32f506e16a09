"""Nodes and their numbers are all seen, none covers another, and they stay where they are as long as they can."""

import doctest

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from omnieval.recording import node_places
from omnieval.recording.node_places import GRAPH_SIZE, GraphLayout, apart, number_size


def chain(count, loops=()):
    """A robot's way: nodes one after another, and some loop closures."""
    return list(range(1, count + 1)), [(node, node + 1) for node in range(1, count)] + list(loops)


def nearest(places):
    away = np.linalg.norm(places[:, np.newaxis] - places, axis=2)
    return away[np.triu_indices(len(places), 1)].min()


@pytest.mark.parametrize("count", [1, 2, 6, 15, 30, 64, 200])
def test_every_node_is_within_the_picture(count):
    places = GraphLayout().place(*chain(count, [(1, count)] if count > 2 else []))
    assert places.shape == (count, 2)
    assert np.isfinite(places).all()
    assert (np.abs(places) <= np.array(GRAPH_SIZE) / 2 + 1e-9).all()


@pytest.mark.parametrize("loops", [[], [(1, 30)], [(1, 12), (5, 20), (9, 28), (2, 30)]])
def test_thirty_nodes_do_not_cover_each_other_when_they_come_one_by_one(loops):
    layout = GraphLayout()
    for count in range(1, 31):
        nodes, edges = chain(count, [edge for edge in loops if max(edge) <= count])
        places = layout.place(nodes, edges)
    assert nearest(places) > 20.0


def test_neighbours_are_nearer_than_strangers():
    nodes, edges = chain(12)
    places = GraphLayout().place(nodes, edges)
    joined = np.linalg.norm(np.diff(places, axis=0), axis=1)
    assert joined.max() < np.linalg.norm(places[0] - places[-1])


def test_a_node_more_moves_the_others_little_and_nothing_is_random():
    one, other = GraphLayout(), GraphLayout()
    for layout in (one, other):
        for count in range(1, 15):
            before = layout.place(*chain(count))
    after = one.place(*chain(15))
    np.testing.assert_array_equal(after, other.place(*chain(15)))
    assert np.linalg.norm(after[:14] - before, axis=1).mean() < 0.15 * GRAPH_SIZE[0]


def test_a_graph_without_edges_or_nodes_can_be_drawn():
    assert GraphLayout().place([], []).shape == (0, 2)
    assert nearest(GraphLayout().place([3, 8, 9], [(3, 7)])) > 16.0


@settings(deadline=None, max_examples=40)
@given(st.lists(st.tuples(st.floats(0, 20), st.floats(0, 10)), min_size=1, max_size=12))
def test_numbers_do_not_cover_each_other(places):
    size = number_size(40.0)
    moved = apart(np.array(places), size)
    for first in range(len(moved)):
        for second in range(first):
            away = np.abs(moved[first] - moved[second]) / size
            assert away.max() > 0.9
    assert np.abs(moved.mean(axis=0) - np.mean(places, axis=0)).max() < 1e-6


def test_numbers_with_room_stay_where_they_are():
    places = np.array([[0.0, 0.0], [3.0, 0.0], [0.0, 3.0]])
    np.testing.assert_array_equal(apart(places, (2.0, 2.0)), places)


def test_examples():
    assert doctest.testmod(node_places) == (0, 1)
