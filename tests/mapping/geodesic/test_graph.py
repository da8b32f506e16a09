"""Shortest ways between keyframes, against SciPy's."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from omnieval.mapping.geodesic.graph import KeyframeGraph, Way
from omnieval.mapping.geodesic.motion import Motion


def test_ways_within_reach_are_the_shortest_nearest_first() -> None:
    rng = np.random.default_rng(3)
    for _ in range(20):
        graph, lengths = KeyframeGraph(), np.zeros((15, 15))
        for _ in range(15):
            graph.add()
        for one, other in rng.integers(15, size=(25, 2)).tolist():
            length = float(rng.uniform(0.1, 3))
            graph.join(one, other, Way(length, Motion(length)))
            if one != other:
                kept = min(length, lengths[one, other] or np.inf)
                lengths[one, other] = lengths[other, one] = kept
        expected = dijkstra(csr_array(lengths), indices=0)
        found = graph.within(0, 4.0)
        assert list(found.values()) == sorted(found.values())
        assert set(found) == set(np.flatnonzero(expected <= 4.0).tolist())
        np.testing.assert_allclose([expected[one] for one in found], list(found.values()))


def test_edges_go_both_ways_and_the_shortest_length_holds() -> None:
    graph = KeyframeGraph()
    for _ in range(3):
        graph.add()
    for one, other, length in ((0, 1, 2.0), (1, 2, 1.0), (0, 1, 5.0), (2, 2, 0.1)):
        graph.join(one, other, Way(length, Motion(length)))
    sources, targets = graph.edges
    assert sorted(zip(sources.tolist(), targets.tolist(), strict=True)) == [(0, 1), (1, 0), (1, 2), (2, 1)]
    assert graph.within(0, 9.0) == {0: 0.0, 1: 2.0, 2: 3.0}


def test_a_copy_goes_on_by_itself() -> None:
    graph = KeyframeGraph()
    graph.add()
    graph.add()
    other = graph.copied()
    other.join(0, 1, Way(1.0, Motion(1.0)))
    other.add()
    assert (len(graph), graph.within(0, 9.0)) == (2, {0: 0.0})
    assert (len(other), other.within(0, 9.0)) == (3, {0: 0.0, 1: 1.0})


def test_around_a_square_the_start_is_seen_across() -> None:
    """Three sides of 4, each after a quarter turn: the last corner is 12 along the way and 4 away, to the left."""
    graph = KeyframeGraph()
    for _ in range(4):
        graph.add()
    side = Motion(4.0, 0.0, np.pi / 2)
    for corner in range(3):
        graph.join(corner, corner + 1, Way(4.0, side))
    seen = graph.seen_from(0, 12.0)
    assert [round(motion.distance, 9) for motion in seen.values()] == [0.0, 4.0, round(np.sqrt(32), 9), 4.0]
    assert [seen[3].ahead, seen[3].aside] == pytest.approx([0, 4])
    assert set(graph.seen_from(0, 11.9)) == {0, 1, 2}
    assert graph.seen_from(3, 12.0)[0].distance == pytest.approx(4.0)


def test_a_shorter_way_changes_the_length_and_not_where_things_are() -> None:
    graph = KeyframeGraph()
    for _ in range(2):
        graph.add()
    graph.join(0, 1, Way(5.0, Motion(3.0, 1.0, 0.2)))
    graph.join(0, 1, Way(4.0, Motion(9.0)))
    assert graph.within(0, 9.0)[1] == 4.0
    assert graph.seen_from(0, 9.0)[1] == Motion(3.0, 1.0, 0.2)
