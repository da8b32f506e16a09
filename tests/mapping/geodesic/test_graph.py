"""Shortest ways between keyframes, against SciPy's."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from omnieval.mapping.geodesic.graph import KeyframeGraph


def test_ways_within_reach_are_the_shortest_nearest_first() -> None:
    rng = np.random.default_rng(3)
    for _ in range(20):
        graph, lengths = KeyframeGraph(), np.zeros((15, 15))
        for _ in range(15):
            graph.add()
        for one, other in rng.integers(15, size=(25, 2)).tolist():
            length = float(rng.uniform(0.1, 3))
            graph.join(one, other, length)
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
    graph.join(0, 1, 2.0)
    graph.join(1, 2, 1.0)
    graph.join(0, 1, 5.0)
    graph.join(2, 2, 0.1)
    sources, targets = graph.edges
    assert sorted(zip(sources.tolist(), targets.tolist(), strict=True)) == [(0, 1), (1, 0), (1, 2), (2, 1)]
    assert graph.within(0, 9.0) == {0: 0.0, 1: 2.0, 2: 3.0}


def test_a_copy_goes_on_by_itself() -> None:
    graph = KeyframeGraph()
    graph.add()
    graph.add()
    other = graph.copied()
    other.join(0, 1, 1.0)
    other.add()
    assert (len(graph), graph.within(0, 9.0)) == (2, {0: 0.0})
    assert (len(other), other.within(0, 9.0)) == (3, {0: 0.0, 1: 1.0})
