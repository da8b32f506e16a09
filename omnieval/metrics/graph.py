"""Whether the map's graph is that of the building: nodes wherever the robot went, edges where one can go.

A node lies where its representative image was taken; edges are the transitions between nodes. The true graph is that of
the images (`ground.Ground.distances`).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import connected_components, dijkstra
from scipy.spatial import cKDTree

from omnieval.metrics.ground import NO_LENGTH_M, ROUNDING_M, Ground
from omnieval.metrics.proportion import Proportion

LONGEST_DETOUR = 1.5
"""By how much the true way may be longer than the scale for two nodes to be neighbours at that scale."""
MOST_NODES = 500
"""Of larger maps, the ways between so many nodes are judged, every k-th: there are as many pairs as nodes squared."""


@dataclass(frozen=True)
class Shape:
    """What of a graph needs no positions."""

    nodes: int
    edges: int
    components: int

    @property
    def loops(self) -> int:
        """How many edges could be taken away without a node getting out of reach."""
        return self.edges - self.nodes + self.components


@dataclass(frozen=True, slots=True)
class Edges:
    """Pairs of nodes that are neighbours at a scale, in the map and truly; see `Ways.edges`."""

    precision: Proportion
    recall: Proportion


def shape(nodes: Sequence[int], edges: Iterable[tuple[int, int]]) -> Shape:
    """Return how many nodes, edges and connected components a graph has.

    Examples
    --------
    >>> shape([1, 2, 3, 4], [(1, 2), (2, 3), (1, 3)]), shape([1, 2, 3, 4], [(1, 2), (2, 3), (1, 3)]).loops
    (Shape(nodes=4, edges=3, components=2), 1)
    """
    ends = _ends(nodes, edges)
    links = coo_array((np.ones(len(ends), np.bool_), tuple(ends.T)), shape=(len(nodes), len(nodes)))
    components = connected_components(links, directed=False, return_labels=False) if nodes else 0
    return Shape(len(nodes), len(ends), int(components))


def coverage(places: NDArray[np.float64], ground: Ground, within: float) -> Proportion:
    """Count the images within this many metres of a node.

    Parameters
    ----------
    places
        Where the nodes lie, shape (k, 2), metres.
    ground
        Where the images were taken.
    within
        Metres.
    """
    if not len(places):
        return Proportion(0, len(ground))
    distances = cKDTree(places).query(ground.positions)[0]
    return Proportion(int((distances <= within + ROUNDING_M).sum()), len(ground))


class Ways:
    """Ways between nodes, over the map and in truth.

    Parameters
    ----------
    representatives
        Which of the m images of the ground represents each node.
    edges
        Pairs of these nodes.
    ground
        Where the images were taken.
    """

    def __init__(self, representatives: Mapping[int, int], edges: Iterable[tuple[int, int]], ground: Ground) -> None:
        self._nodes = sorted(representatives)
        self._images = np.array([representatives[node] for node in self._nodes], np.int64)
        self._ends = _ends(self._nodes, edges)
        self._ground = ground

    @property
    def places(self) -> NDArray[np.float64]:
        """Where the nodes lie, shape (k, 2), metres."""
        places: NDArray[np.float64] = self._ground.positions[self._images]
        return places

    @cached_property
    def lengths(self) -> NDArray[np.float64]:
        """How long the edges are, metres."""
        lengths: NDArray[np.float64] = np.hypot(*(self.places[self._ends[:, 0]] - self.places[self._ends[:, 1]]).T)
        return lengths

    @cached_property
    def stretches(self) -> NDArray[np.float64]:
        """The shortest way over the map divided by the true one, of every pair of nodes that the map connects.

        Below 1 the map has a way through a wall, above 1 a loop that it never closed. Nodes at one place are left out.
        """
        over_map, truly = self._between
        compared = np.isfinite(over_map) & (truly > ROUNDING_M)
        ratios: NDArray[np.float64] = over_map[compared] / truly[compared]
        return ratios

    def edges(self, scale: float) -> Edges | None:
        """Return how well nodes that are near in the map are near in truth, at a scale, and the other way round.

        After TOPO-Bench (arXiv 2510.04100), in our reading: near in the map are nodes within h = ceil(scale / median
        length of an edge) edges. Precision: of these, the share whose true way is at most `LONGEST_DETOUR` times the
        scale. Recall: of the pairs whose true way is at most the scale, the share within h edges.

        Returns
        -------
        None if the map has no edge of any length.
        """
        median = float(np.median(self.lengths)) if len(self.lengths) else 0.0
        if median <= ROUNDING_M:
            return None
        near = self._hops <= math.ceil(scale / median - ROUNDING_M)
        truly = self._between[1]
        right = near & (truly <= LONGEST_DETOUR * scale + ROUNDING_M)
        reached = truly <= scale + ROUNDING_M
        return Edges(
            Proportion(int(right.sum()), int(near.sum())), Proportion(int((reached & near).sum()), int(reached.sum()))
        )

    @cached_property
    def _chosen(self) -> NDArray[np.int64]:
        every = -(-len(self._nodes) // MOST_NODES) or 1
        return np.arange(0, len(self._nodes), every)

    @cached_property
    def _between(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Lengths of the ways over the map and in truth of all pairs of chosen nodes, metres."""
        over_map = dijkstra(self._graph(self.lengths), indices=self._chosen)[:, self._chosen]
        truly = self._ground.distances(self._images[self._chosen])
        return _pairs(over_map), _pairs(truly)

    @cached_property
    def _hops(self) -> NDArray[np.float64]:
        """Edges between all pairs of chosen nodes."""
        graph = self._graph(np.ones(len(self._ends)))
        return _pairs(dijkstra(graph, indices=self._chosen)[:, self._chosen])

    def _graph(self, weights: NDArray[np.float64]) -> csr_array:
        weights = np.maximum(weights, NO_LENGTH_M)
        both = np.concatenate([self._ends, self._ends[:, ::-1]]).astype(np.int32)  # all that older SciPy takes
        size = len(self._nodes)
        return csr_array(coo_array((np.tile(weights, 2), tuple(both.T)), shape=(size, size)))


def _ends(nodes: Sequence[int], edges: Iterable[tuple[int, int]]) -> NDArray[np.int64]:
    """Return the edges as indices of their nodes, shape (e, 2)."""
    index = {node: number for number, node in enumerate(nodes)}
    return np.array([(index[one], index[other]) for one, other in edges], np.int64).reshape(-1, 2)


def _pairs(matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return what a symmetric matrix holds of every pair, once."""
    return np.asarray(matrix[np.triu_indices(len(matrix), 1)])
