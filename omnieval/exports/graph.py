"""The topological map of a complete run as a graph: nodes with their places, edges with their counts and lengths.

The place of a node is the true capture position of its representative image, in metres, in the dataset's own frame.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import polars as pl

from omnieval.errors import ResultError
from omnieval.results.run_folder import Run


@dataclass(frozen=True)
class Place:
    """Where a node is.

    x and y in metres, yaw in radians, counter-clockwise; `yaw` is None where the heading is not known.
    """

    x: float
    y: float
    yaw: float | None


@dataclass(frozen=True)
class Node:
    """A node of the final map.

    Attributes
    ----------
    id
        Its number in every table of the run.
    active
        Whether the mapper holds it for a place of its own; else it is pending.
    created
        The step at which it was made.
    frames
        Its images, by frame number, ascending.
    representative_frame, representative_file
        The image that stands for it.
    place
        Where that was taken; None if that is not known.
    rooms
        (label, share of its images), the largest share first.
    extent
        Diagonal of the bounding box of its images, metres; None if their positions are not known.
    """

    id: int
    active: bool
    created: int | None
    frames: tuple[int, ...]
    representative_frame: int
    representative_file: str
    place: Place | None
    rooms: tuple[tuple[str, float], ...]
    extent: float | None


@dataclass(frozen=True)
class Edge:
    """An undirected edge: the robot went `count` times between two nodes, ``a < b``.

    `length` is the straight line between their places, metres; None where one of them is not known.
    """

    a: int
    b: int
    count: int
    length: float | None


@dataclass(frozen=True)
class MapGraph:
    """A map, and what it was made of: name of the run, source, and names and identities of its components."""

    about: Mapping[str, Any]
    nodes: tuple[Node, ...]
    edges: tuple[Edge, ...]

    @property
    def unplaced(self) -> tuple[int, ...]:
        """The nodes of which no place is known."""
        return tuple(node.id for node in self.nodes if node.place is None)


def map_graph(run: Run) -> MapGraph:
    """Return the final map of a run.

    Raises
    ------
    ResultError
        If the run has none, or its tables cannot be read.
    """
    if run.status != "complete":
        raise ResultError(f"{run.folder} has no final map: the replay is {run.status}; replay the sequence to its end")
    steps = run.steps
    frames = {
        node: tuple(found)
        for node, found in steps.drop_nulls("node_final").group_by("node_final").agg("frame").sort("node_final").rows()
    }
    present = run.nodes.filter(pl.col("merged").is_null() & pl.col("representative_frame").is_not_null())
    nodes = tuple(_node(row, steps, frames) for row in present.sort("id").iter_rows(named=True))
    places = {node.id: node.place for node in nodes}
    edges = tuple(Edge(a, b, count, _length(places[a], places[b])) for a, b, count in run.transitions.iter_rows())
    manifest = run.manifest
    about = {
        "run": run.folder.resolve().name,
        "source": manifest["source"],
        "sequence": manifest["sequence"],
        "mapper": run.config.mapper.name,
        "descriptor": run.config.descriptor.name,
        "identity": manifest.get("identity"),
        "dataset_fingerprint": manifest.get("dataset_fingerprint"),
        "frames": len(steps),
    }
    return MapGraph(about, nodes, edges)


def _node(row: Mapping[str, Any], steps: pl.DataFrame, frames: Mapping[int, tuple[int, ...]]) -> Node:
    frame = row["representative_frame"]
    image = steps.row(frame, named=True)
    known = image["x"] is not None and image["y"] is not None
    return Node(
        id=row["id"],
        active=row["active"],
        created=row["created"],
        frames=frames.get(row["id"], ()),
        representative_frame=frame,
        representative_file=image["file"],
        place=Place(image["x"], image["y"], image["yaw"]) if known else None,
        rooms=tuple((room["room"], room["share"]) for room in row["rooms"] or ()),
        extent=row["extent"],
    )


def _length(one: Place | None, other: Place | None) -> float | None:
    return None if one is None or other is None else math.hypot(one.x - other.x, one.y - other.y)
