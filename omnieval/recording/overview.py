"""The cluster map from above and the topological graph, as rows that follow the replay."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from omnieval.explain.decision import Decision
from omnieval.mapping.partition import Partition, count_transitions
from omnieval.mapping.step import Verdict
from omnieval.recording import layout
from omnieval.recording.evidence import verdict_color
from omnieval.recording.rooms import Rooms
from omnieval.recording.rows import NO_SEGMENTS, Arrow, Graph, Points, Row, Segments

_CLOSURES = {
    Verdict.ASSIGNED: layout.MAP_ACCEPTED,
    Verdict.PROMINENCE: layout.MAP_REFUSED,
    Verdict.CENTROID: layout.MAP_REFUSED,
}
"""Where the line to the best match of an image goes, by what became of it."""

Edges = Sequence[tuple[int, int]]

HEADING_METRES = 0.6
"""Length of the robot's arrow."""


class Overview:
    """Draws the map step by step.

    All images with their colours are drawn anew only when labels have changed or after some sqrt(n) steps; in
    between, only the images since then. So a recording does not grow with the square of its steps.
    """

    def __init__(self) -> None:
        self._positions = np.full((64, 2), np.nan)
        self._rooms = Rooms()
        self._last_drawn = 0
        self._drawn = {0: 0}
        self._graph: Graph | None = None

    @property
    def drawn(self) -> dict[int, int]:
        """At which steps how many images were drawn at once, ascending; the later ones are recent from there on."""
        return dict(self._drawn)

    def rows(self, decided: Decision, partition: Partition) -> list[tuple[str, Row]]:
        """Return what changes at this step, which `partition` has already taken in."""
        capture = decided.capture
        frame = capture.frame
        if frame == len(self._positions):
            self._positions = np.concatenate([self._positions, np.full_like(self._positions, np.nan)])
        if capture.x is not None and capture.y is not None:
            self._positions[frame] = capture.x, capture.y
        self._rooms.add(capture.room)
        labels = partition.labels
        rows = self._image_rows(frame, labels, relabelled=bool(decided.events))
        edges = tuple(count_transitions(labels))
        rows += node_rows(labels, self._positions[: frame + 1], partition.active, edges, self._rooms)
        rows += self._robot_rows(decided)
        rows += self._closure_rows(decided)
        graph = topological_graph(labels, partition.active, edges)
        if graph != self._graph:
            self._graph = graph
            rows.append((layout.GRAPH, graph))
        return rows

    def final_rows(self, labels: NDArray[np.int64], active: frozenset[int]) -> list[tuple[str, Row]]:
        """Return the map as it is when the leftovers have been placed."""
        edges = tuple(count_transitions(labels))
        return [
            *self._image_rows(len(labels), labels, relabelled=True),
            *node_rows(labels, self._positions[: len(labels)], active, edges, self._rooms),
            (layout.GRAPH, topological_graph(labels, active, edges)),
        ]

    def _image_rows(self, frame: int, labels: NDArray[np.int64], *, relabelled: bool) -> list[tuple[str, Row]]:
        rows: list[tuple[str, Row]] = []
        count = len(labels)
        if relabelled or count - self._last_drawn > math.isqrt(2 * count) + 8:
            rows.append((layout.MAP_IMAGES, self._points(labels, 0)))
            self._last_drawn = self._drawn[frame] = count
        return [*rows, (layout.MAP_RECENT, self._points(labels, self._last_drawn))]

    def _points(self, labels: NDArray[np.int64], first: int) -> Points:
        known = first + np.flatnonzero(np.isfinite(self._positions[first : len(labels), 0]))
        return Points(self._positions[known], labels[known])

    def _robot_rows(self, decided: Decision) -> list[tuple[str, Row]]:
        frame, yaw, match = decided.capture.frame, decided.capture.yaw, decided.match
        here = self._positions[frame]
        if not np.isfinite(here).all():
            return []
        rows: list[tuple[str, Row]] = [(layout.MAP_ROBOT, Points(here[np.newaxis], np.zeros(1, np.int64)))]
        if yaw is not None:
            heading = HEADING_METRES * np.array([math.cos(yaw), math.sin(yaw)])
            rows.append((layout.MAP_HEADING, Arrow(here, heading)))
        before = self._positions[frame - 1] if frame else np.full(2, np.nan)
        rows.append((layout.MAP_TRAIL, _segment(before, here, layout.WHITE)))
        there = self._positions[match.best_frame] if match is not None else np.full(2, np.nan)
        rows.append((layout.MAP_MATCH, _segment(here, there, verdict_color(decided.verdict))))
        return rows

    def _closure_rows(self, decided: Decision) -> list[tuple[str, Row]]:
        """Return the line of a loop closure between its two capture points; the view gathers those of all steps."""
        match = decided.match
        if match is None or match.distance is None or decided.verdict not in _CLOSURES:
            return []
        ends = self._positions[[decided.capture.frame, match.best_frame]]
        _, _, color, width = next(drawn for drawn in layout.CLOSURES if match.distance <= drawn[0])
        line = Segments(ends[np.newaxis], np.array([color], np.uint32), np.array([width]))
        return [(_CLOSURES[decided.verdict], line)]


def node_rows(
    labels: NDArray[np.int64],
    positions: NDArray[np.float64],
    active: frozenset[int],
    edges: Edges,
    rooms: Rooms,
) -> list[tuple[str, Row]]:
    """Return the nodes at the mean positions of their images, and the transitions between them.

    Parameters
    ----------
    labels
        Node of every image, shape (n,), 0 where unassigned.
    positions
        Capture positions, shape (n, 2), metres; NaN where unknown, which leaves the image out.
    active
        The active nodes; the others are marked as pending.
    edges
        The transitions (`count_transitions`).
    rooms
        Rooms of the images.
    """
    placed = (labels > 0) & np.isfinite(positions[:, 0])
    if not placed.any():
        return []
    nodes, index = np.unique(labels[placed], return_inverse=True)
    sums = np.stack([np.bincount(index, axis) for axis in positions[placed].T], axis=1)
    means = sums / np.bincount(index)[:, np.newaxis]
    where = dict(zip(nodes.tolist(), means, strict=True))
    ends = np.array([(where[a], where[b]) for a, b in edges if a in where and b in where])
    segments = Segments(ends, np.full(len(ends), layout.FAINT_COLOR, np.uint32)) if len(ends) else NO_SEGMENTS
    names = tuple(_node_label(node, active) for node in nodes.tolist())
    facts = {
        "state": ["active" if node in active else "pending" for node in nodes.tolist()],
        "images": [str(total) for total in np.bincount(labels)[nodes].tolist()],
        "rooms": rooms.shares(labels, nodes),
    }
    return [(layout.MAP_NODES, Points(means, nodes, names, facts)), (layout.MAP_TRANSITIONS, segments)]


def topological_graph(labels: NDArray[np.int64], active: frozenset[int], edges: Edges) -> Graph:
    """Return the nodes of the map and the transitions between them; needs no positions."""
    nodes = [node for node in np.unique(labels).tolist() if node > 0]
    return Graph(
        nodes=tuple(str(node) for node in nodes),
        labels=tuple(_node_label(node, active) for node in nodes),
        colors=tuple(layout.node_color(node) for node in nodes),
        edges=tuple((str(a), str(b)) for a, b in edges),
    )


def _node_label(node: int, active: frozenset[int]) -> str:
    return f"{node}" if node in active else f"({node})"


def _segment(start: NDArray[np.float64], end: NDArray[np.float64], color: int) -> Segments:
    ends = np.stack([start, end])
    return Segments(ends[np.newaxis], np.array([color], np.uint32)) if np.isfinite(ends).all() else NO_SEGMENTS
