"""Where nodes and their numbers stand when they are drawn, so that all are seen and none covers another."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

GRAPH_SIZE = (480.0, 130.0)
"""Width and height that the topological graph fills, in the viewer's units: a node is about 20 of them wide."""
GRAPH_BORDER = 16.0
"""Free space around it for the boxes of the nodes at its rim."""

_BOX = (25.0, 25.0)
"""Width and height of a node and a little space."""
_LINK = 60.0
"""Length of an edge while there is room."""
_NUMBER = (0.046, 0.038)
"""Width and height of a number on the map, as a share of the map's width in the layout that all recordings have."""
_MARK = 0.012
"""Half the height of the mark of a node, likewise."""
_MOST = 64
"""With more nodes than this, new ones are put beside their neighbours and nothing else moves: a step must be quick."""
_ROUNDS = 40


class GraphLayout:
    """Places the nodes of a growing graph: edges are springs, nodes keep each other off, and all lies in a rectangle.

    From graph to graph, nodes start where they were, so that the picture changes as little as the graph does. Nothing
    is random.
    """

    def __init__(self) -> None:
        self._at: dict[int, NDArray[np.float64]] = {}

    def place(self, nodes: Sequence[int], edges: Sequence[tuple[int, int]]) -> NDArray[np.float64]:
        """Return where nodes are to be drawn, shape (n, 2), within `GRAPH_SIZE` about (0, 0).

        Parameters
        ----------
        nodes
            The nodes of the graph, n different ones.
        edges
            Pairs of them.
        """
        if not nodes:
            return np.zeros((0, 2))
        index = {node: number for number, node in enumerate(nodes)}
        ends = np.array([(index[a], index[b]) for a, b in edges if a in index and b in index and a != b], np.int64)
        ends = ends.reshape(-1, 2)
        places = self._begin(nodes, ends)
        if len(nodes) <= _MOST:
            places = _relaxed(places, ends)
        self._at = dict(zip(nodes, places, strict=True))
        return _fitted(places)

    def _begin(self, nodes: Sequence[int], ends: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return where nodes are before they move: new ones beside a neighbour that has a place."""
        places = np.array([self._at.get(node, (np.nan, np.nan)) for node in nodes])
        for number in np.flatnonzero(np.isnan(places[:, 0])):
            beside = np.concatenate([ends[ends[:, 0] == number, 1], ends[ends[:, 1] == number, 0]])
            known = places[beside][~np.isnan(places[beside, 0])]
            middle = known.mean(axis=0) if len(known) else np.zeros(2)
            angle = 2.399963 * number  # the golden angle: successive nodes on all sides
            places[number] = middle + 0.5 * np.array([np.cos(angle), np.sin(angle)])
        return places


def _relaxed(places: NDArray[np.float64], ends: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return places after springs have pulled and nodes have pushed (Fruchterman and Reingold 1991), edges 1 long."""
    places = places.copy()
    for number in range(_ROUNDS):
        away = places[:, np.newaxis] - places
        squares = np.maximum((away**2).sum(axis=2), 1e-3)
        moves = (away / squares[:, :, np.newaxis]).sum(axis=1)
        along = places[ends[:, 1]] - places[ends[:, 0]]
        pulls = along * np.linalg.norm(along, axis=1, keepdims=True)
        np.add.at(moves, ends[:, 0], pulls)
        np.add.at(moves, ends[:, 1], -pulls)
        moves -= 0.1 * places  # or parts that no edge joins drift away
        length = np.linalg.norm(moves, axis=1, keepdims=True)
        places += moves * np.minimum(1.0, 0.3 * (1 - number / _ROUNDS) / np.maximum(length, 1e-9))
    return places


def _fitted(places: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return places in the rectangle: as they are while there is room, else closer together on each axis."""
    low, high = places.min(axis=0), places.max(axis=0)
    scale = np.minimum(_LINK, np.array(GRAPH_SIZE) / np.maximum(high - low, 1e-9))
    spread = apart((places - (low + high) / 2) * scale, _BOX)
    low, high = spread.min(axis=0), spread.max(axis=0)
    shrink = np.minimum(1.0, np.array(GRAPH_SIZE) / np.maximum(high - low, 1e-9))
    fitted: NDArray[np.float64] = (spread - (low + high) / 2) * shrink
    return fitted


def below(places: NDArray[np.float64], width: float) -> NDArray[np.float64]:
    """Return where numbers stand: below the marks of their nodes, on a map that is so wide; y up."""
    return places - (0.0, _MARK * width)


def number_size(width: float) -> tuple[float, float]:
    """Return the width and height of a number on a map that is so wide, in the same unit."""
    return _NUMBER[0] * width, _NUMBER[1] * width


def apart(places: NDArray[np.float64], size: tuple[float, float]) -> NDArray[np.float64]:
    """Return places at which boxes of one size do not cover each other, as near to the given ones as they come.

    Parameters
    ----------
    places
        Where they would stand, shape (n, 2). With more than 64 of them they stay there: no map has room for so many.
    size
        Width and height of a box, in the same unit.

    Examples
    --------
    >>> apart(np.array([[0.0, 0.0], [1.5, 0.25], [9.0, 0.0]]), (2.0, 1.0)).tolist()
    [[-0.25, 0.0], [1.75, 0.25], [9.0, 0.0]]
    """
    if not 1 < len(places) <= _MOST:
        return places
    boxes = places / size
    first, second = np.triu_indices(len(boxes), 1)
    for _ in range(_ROUNDS):
        between = boxes[second] - boxes[first]
        over = 1.0 - np.abs(between)
        hit = np.flatnonzero((over > 1e-9).all(axis=1))
        if not len(hit):
            break
        axis = over[hit].argmin(axis=1)
        push = 0.5 * over[hit, axis] * np.where(between[hit, axis] < 0, -1.0, 1.0)
        np.add.at(boxes, (first[hit], axis), -push)
        np.add.at(boxes, (second[hit], axis), push)
    return boxes * size
