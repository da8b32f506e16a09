"""The cluster map from above and the topological graph, as rows that follow the replay."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from omnieval.mapping.partition import Partition, count_transitions
from omnieval.recording import layout
from omnieval.recording.evidence import verdict_color
from omnieval.recording.records import StepView
from omnieval.recording.rows import NO_SEGMENTS, Arrow, Graph, Points, Row, Segments

HEADING_METRES = 0.6
"""Length of the robot's arrow."""


class Overview:
    """Draws the map step by step.

    All images with their colours are drawn anew only when labels have changed or after some sqrt(n) steps; in
    between, only the images since then. So a recording does not grow with the square of its steps.
    """

    def __init__(self) -> None:
        self._positions = np.full((64, 2), np.nan)
        self._last_drawn = 0
        self._graph: Graph | None = None

    def rows(self, view: StepView, partition: Partition) -> list[tuple[str, Row]]:
        """Return what changes at this step, which `partition` has already taken in."""
        frame = view.step.frame
        if frame == len(self._positions):
            self._positions = np.concatenate([self._positions, np.full_like(self._positions, np.nan)])
        if view.position is not None:
            self._positions[frame] = view.position
        labels = partition.labels
        rows = self._image_rows(labels, relabelled=bool(view.step.events))
        rows += node_rows(labels, self._positions[: frame + 1], partition.active)
        rows += self._robot_rows(view)
        graph = topological_graph(labels, partition.active)
        if graph != self._graph:
            self._graph = graph
            rows.append((layout.GRAPH, graph))
        return rows

    def final_rows(self, labels: NDArray[np.int64], active: frozenset[int]) -> list[tuple[str, Row]]:
        """Return the map as it is when the leftovers have been placed."""
        return [
            *self._image_rows(labels, relabelled=True),
            *node_rows(labels, self._positions[: len(labels)], active),
            (layout.GRAPH, topological_graph(labels, active)),
        ]

    def _image_rows(self, labels: NDArray[np.int64], *, relabelled: bool) -> list[tuple[str, Row]]:
        rows: list[tuple[str, Row]] = []
        count = len(labels)
        if relabelled or count - self._last_drawn > math.isqrt(2 * count) + 8:
            rows.append((layout.MAP_IMAGES, self._points(labels, 0)))
            self._last_drawn = count
        return [*rows, (layout.MAP_RECENT, self._points(labels, self._last_drawn))]

    def _points(self, labels: NDArray[np.int64], first: int) -> Points:
        known = first + np.flatnonzero(np.isfinite(self._positions[first : len(labels), 0]))
        return Points(self._positions[known], labels[known])

    def _robot_rows(self, view: StepView) -> list[tuple[str, Row]]:
        frame, match = view.step.frame, view.step.match
        here = self._positions[frame]
        if not np.isfinite(here).all():
            return []
        rows: list[tuple[str, Row]] = [(layout.MAP_ROBOT, Points(here[np.newaxis], np.zeros(1, np.int64)))]
        if view.yaw is not None:
            heading = HEADING_METRES * np.array([math.cos(view.yaw), math.sin(view.yaw)])
            rows.append((layout.MAP_HEADING, Arrow(here, heading)))
        before = self._positions[frame - 1] if frame else np.full(2, np.nan)
        rows.append((layout.MAP_TRAIL, _segment(before, here, layout.WHITE)))
        there = self._positions[match.best_frame] if match is not None else np.full(2, np.nan)
        rows.append((layout.MAP_MATCH, _segment(here, there, verdict_color(view.step.verdict))))
        return rows


def node_rows(
    labels: NDArray[np.int64], positions: NDArray[np.float64], active: frozenset[int]
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
    """
    placed = (labels > 0) & np.isfinite(positions[:, 0])
    if not placed.any():
        return []
    nodes, index = np.unique(labels[placed], return_inverse=True)
    sums = np.stack([np.bincount(index, axis) for axis in positions[placed].T], axis=1)
    means = sums / np.bincount(index)[:, np.newaxis]
    where = dict(zip(nodes.tolist(), means, strict=True))
    edges = [edge for edge in count_transitions(labels) if edge[0] in where and edge[1] in where]
    segments = NO_SEGMENTS
    if edges:
        ends = np.array([(where[a], where[b]) for a, b in edges])
        segments = Segments(ends, np.full(len(edges), layout.FAINT_COLOR, np.uint32))
    names = tuple(_node_label(node, active) for node in nodes.tolist())
    return [(layout.MAP_NODES, Points(means, nodes, names)), (layout.MAP_TRANSITIONS, segments)]


def topological_graph(labels: NDArray[np.int64], active: frozenset[int]) -> Graph:
    """Return the nodes of the map and the transitions between them; needs no positions."""
    nodes = [node for node in np.unique(labels).tolist() if node > 0]
    return Graph(
        nodes=tuple(str(node) for node in nodes),
        labels=tuple(_node_label(node, active) for node in nodes),
        colors=tuple(layout.node_color(node) for node in nodes),
        edges=tuple((str(a), str(b)) for a, b in count_transitions(labels)),
    )


def _node_label(node: int, active: frozenset[int]) -> str:
    return f"{node}" if node in active else f"({node})"


def _segment(start: NDArray[np.float64], end: NDArray[np.float64], color: int) -> Segments:
    ends = np.stack([start, end])
    return Segments(ends[np.newaxis], np.array([color], np.uint32)) if np.isfinite(ends).all() else NO_SEGMENTS
