"""The cluster map from above and the topological graph, as rows that follow the replay."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from omnieval.explain.scene import Scene
from omnieval.mapping.partition import Partition, count_transitions
from omnieval.mapping.step import Role
from omnieval.recording import entities
from omnieval.recording.node_places import GraphLayout, apart, below, number_size
from omnieval.recording.rows import NO_SEGMENTS, Arrow, Graph, Points, Row, Segments
from omnieval.recording.styles import CLOSURES, FAINT_COLOR, ROLE_COLORS, WHITE, node_color
from omnieval.recording.viewport import Extent, Origin, map_window

_CLOSURES = {Role.JOINED: entities.MAP_ACCEPTED, Role.REFUSED: entities.MAP_REFUSED}
"""Where the line to the best match of an image goes, by what became of it."""

Edges = Sequence[tuple[int, int]]

_NUDGE = 0.2
"""Numbers move when a node has moved by so much of a number."""

HEADING_METRES = 0.6
"""Length of the robot's arrow."""


class Overview:
    """Draws the map step by step.

    All images with their colours are drawn again only when labels have changed or after some sqrt(n) steps; in
    between, only the images since then. So a recording does not grow with the square of its steps.

    Parameters
    ----------
    origin
        What is subtracted from positions (`viewport.origin_of`), metres.
    extent
        That of the capture positions, seen from `origin`; None without poses.
    """

    def __init__(self, origin: Origin = (0.0, 0.0), extent: Extent | None = None) -> None:
        self._origin = origin
        self._width = None if extent is None else map_window(extent).width
        self._numbers: Points | None = None
        self._numbered_at: NDArray[np.float64] = np.zeros((0, 2))
        self._layout = GraphLayout()
        self._places: tuple[tuple[float, float], ...] = ()
        self._positions = np.full((64, 2), np.nan)
        self._rooms = Rooms()
        self._last_drawn = 0
        self._drawn = {0: 0}
        self._graph: Graph | None = None

    @property
    def drawn(self) -> dict[int, int]:
        """At which steps how many images were drawn at once, ascending; the later ones are recent from there on."""
        return dict(self._drawn)

    def rows(self, scene: Scene, partition: Partition) -> list[tuple[str, Row]]:
        """Return what changes at this step, which `partition` has already taken in."""
        frame, pose = scene.step.frame, scene.image.pose
        if frame == len(self._positions):
            self._positions = np.concatenate([self._positions, np.full_like(self._positions, np.nan)])
        if pose is not None:
            self._positions[frame] = pose.x - self._origin[0], pose.y - self._origin[1]
        self._rooms.add(scene.image.room)
        labels = partition.labels
        rows = self._image_rows(frame, labels, relabelled=bool(scene.step.events))
        edges = tuple(count_transitions(labels))
        nodes = node_rows(labels, self._positions[: frame + 1], partition.active, edges, self._rooms)
        rows += [*nodes, *self._number_rows(nodes)]
        rows += self._robot_rows(scene)
        rows += self._closure_rows(scene)
        graph = self._placed(topological_graph(labels, partition.active, edges))
        if graph != self._graph:
            self._graph = graph
            rows.append((entities.GRAPH, graph))
        return rows

    def _placed(self, graph: Graph) -> Graph:
        """Return the graph with the places of its nodes, which move only when it has other nodes or edges."""
        drawn = self._graph
        if drawn is None or (graph.nodes, graph.edges) != (drawn.nodes, drawn.edges):
            edges = [(int(a), int(b)) for a, b in graph.edges]
            places = self._layout.place([int(node) for node in graph.nodes], edges)
            self._places = tuple((x, y) for x, y in places.tolist())
        return replace(graph, places=self._places)

    def _number_rows(self, nodes: Sequence[tuple[str, Row]]) -> list[tuple[str, Row]]:
        """Return the numbers of nodes, beside each other, when nodes have come, gone or moved by much of a number."""
        points = next((row for _, row in nodes if isinstance(row, Points)), None)
        if points is None or self._width is None:
            return []
        size = number_size(self._width)
        shown, still = self._numbers, False
        if shown is not None and shown.labels == points.labels:
            still = bool((np.abs(points.positions - self._numbered_at) < _NUDGE * np.array(size)).all())
        if still:
            return []
        at = points.positions.astype(np.float64)
        places = apart(below(at, self._width), size)
        self._numbers, self._numbered_at = Points(places, points.classes, points.labels), at
        return [(entities.MAP_NUMBERS, self._numbers)]

    def final_rows(self, labels: NDArray[np.int64], active: frozenset[int]) -> list[tuple[str, Row]]:
        """Return the map as it is when the leftovers have been placed."""
        edges = tuple(count_transitions(labels))
        nodes = node_rows(labels, self._positions[: len(labels)], active, edges, self._rooms)
        return [
            *self._image_rows(len(labels), labels, relabelled=True),
            *nodes,
            *self._number_rows(nodes),
            (entities.GRAPH, self._placed(topological_graph(labels, active, edges))),
        ]

    def _image_rows(self, frame: int, labels: NDArray[np.int64], *, relabelled: bool) -> list[tuple[str, Row]]:
        rows: list[tuple[str, Row]] = []
        count = len(labels)
        if relabelled or count - self._last_drawn > math.isqrt(2 * count) + 8:
            rows.append((entities.MAP_IMAGES, self._points(labels, 0)))
            self._last_drawn = self._drawn[frame] = count
        return [*rows, (entities.MAP_RECENT, self._points(labels, self._last_drawn))]

    def _points(self, labels: NDArray[np.int64], first: int) -> Points:
        known = first + np.flatnonzero(np.isfinite(self._positions[first : len(labels), 0]))
        return Points(self._positions[known], labels[known])

    def _robot_rows(self, scene: Scene) -> list[tuple[str, Row]]:
        frame, pose, match = scene.step.frame, scene.image.pose, scene.step.match
        here = self._positions[frame]
        if pose is None or not np.isfinite(here).all():
            return []
        rows: list[tuple[str, Row]] = [(entities.MAP_ROBOT, Points(here[np.newaxis], np.zeros(1, np.int64)))]
        if math.isfinite(pose.yaw):
            heading = HEADING_METRES * np.array([math.cos(pose.yaw), math.sin(pose.yaw)])
            rows.append((entities.MAP_HEADING, Arrow(here, heading)))
        before = self._positions[frame - 1] if frame else np.full(2, np.nan)
        rows.append((entities.MAP_TRAIL, _segment(before, here, WHITE)))
        there = self._positions[match.frame] if match is not None else np.full(2, np.nan)
        rows.append((entities.MAP_MATCH, _segment(here, there, ROLE_COLORS[scene.step.role])))
        return rows

    def _closure_rows(self, scene: Scene) -> list[tuple[str, Row]]:
        """Return the line of a loop closure between its two capture points; the view gathers those of all steps."""
        step, metres = scene.step, scene.metres
        if step.match is None or metres is None or step.role not in _CLOSURES:
            return []
        ends = self._positions[[step.frame, step.match.frame]]
        _, _, color, width = next(drawn for drawn in CLOSURES if metres <= drawn[0])
        line = Segments(ends[np.newaxis], np.array([color], np.uint32), np.array([width]))
        return [(_CLOSURES[step.role], line)]


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
    segments = Segments(ends, np.full(len(ends), FAINT_COLOR, np.uint32)) if len(ends) else NO_SEGMENTS
    names = tuple(_node_label(node, active) for node in nodes.tolist())
    facts = {
        "state": ["active" if node in active else "pending" for node in nodes.tolist()],
        "images": [str(total) for total in np.bincount(labels)[nodes].tolist()],
        "rooms": rooms.shares(labels, nodes),
    }
    return [(entities.MAP_NODES, Points(means, nodes, names, facts)), (entities.MAP_TRANSITIONS, segments)]


def topological_graph(labels: NDArray[np.int64], active: frozenset[int], edges: Edges) -> Graph:
    """Return the nodes of the map and the transitions between them, not placed yet; needs no positions."""
    nodes = [node for node in np.unique(labels).tolist() if node > 0]
    return Graph(
        nodes=tuple(str(node) for node in nodes),
        labels=tuple(_node_label(node, active) for node in nodes),
        colors=tuple(node_color(node) for node in nodes),
        places=((0.0, 0.0),) * len(nodes),
        edges=tuple((str(a), str(b)) for a, b in edges),
    )


def _node_label(node: int, active: frozenset[int]) -> str:
    return f"{node}" if node in active else f"({node})"


def _segment(start: NDArray[np.float64], end: NDArray[np.float64], color: int) -> Segments:
    ends = np.stack([start, end])
    return Segments(ends[np.newaxis], np.array([color], np.uint32)) if np.isfinite(ends).all() else NO_SEGMENTS


NO_LABEL = "no label"


class Rooms:
    """The room of every image, as they come."""

    def __init__(self) -> None:
        self._names: list[str] = []
        self._codes = np.zeros(64, np.int64)
        self._count = 0

    def add(self, room: str | None) -> None:
        """Take in the room of the next image; None where it is unknown."""
        name = room or NO_LABEL
        if name not in self._names:
            self._names.append(name)
        if self._count == len(self._codes):
            self._codes = np.concatenate([self._codes, np.zeros_like(self._codes)])
        self._codes[self._count] = self._names.index(name)
        self._count += 1

    def shares(self, labels: NDArray[np.int64], nodes: NDArray[np.int64]) -> list[str]:
        """Return for each node in which rooms its images lie, the commonest first, e.g. ``KT 61 %, LR 39 %``.

        Parameters
        ----------
        labels
            Node of every image so far, shape (n,).
        nodes
            The nodes that are asked for.
        """
        names = tuple(self._names)
        pairs = labels * len(names) + self._codes[: len(labels)]
        counts = np.bincount(pairs, minlength=(int(labels.max()) + 1) * len(names)).reshape(-1, len(names))
        return [_in_words(names, tuple(row)) for row in counts[nodes].tolist()]


@lru_cache(maxsize=256)
def _in_words(names: tuple[str, ...], counts: tuple[int, ...]) -> str:
    """Write shares; a step changes those of one node, if any, so most have been written before."""
    total = sum(counts)
    order = sorted(range(len(names)), key=lambda index: -counts[index])
    return ", ".join(f"{names[index]} {100 * counts[index] / total:.0f} %" for index in order if counts[index])
