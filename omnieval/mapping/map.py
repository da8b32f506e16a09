"""The map as an artefact: nodes, the images they hold, and the descriptions by which an image finds itself in it.

Arrays only, none of which can be changed: no query changes a map.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, fields
from functools import cached_property
from html import escape
from typing import Any

import numpy as np
from numpy.typing import NDArray

from omnieval.descriptors.description import Description
from omnieval.mapping.partition import count_transitions
from omnieval.mapping.representative import representative_frames
from omnieval.mapping.step import FinalMap

_NODES_SHOWN = 12
"""Nodes that a notebook shows of a map."""


@dataclass(frozen=True)
class TopologicalMap:
    """Nodes and edges over n images, with all that localisation needs of the images.

    Attributes
    ----------
    files
        Names of the images, shape (n,), text.
    times
        When they were taken, nanoseconds since the epoch, shape (n,), int64; the smallest integer where unknown.
    xy
        Where they were taken, metres, shape (n, 2), NaN where unknown.
    yaws
        Headings, radians, shape (n,), NaN where unknown.
    rooms
        Their rooms, shape (n,), text; empty where unknown.
    positions
        Position descriptors, shape (n, d), float32.
    orientations
        Orientation descriptors, shape (n, cells, bins), float32.
    labels
        Node of every image, shape (n,), int64; 0 where it belongs to none.
    nodes
        Ids of the nodes, ascending, shape (m,), int64.
    active
        Which of them are active, shape (m,).
    representatives
        Mean position descriptor of every node, shape (m, d), float64.
    representative_frames
        Its image nearest to that, shape (m,), int64.
    edges
        Pairs of nodes that the robot went between and how often, shape (e, 3), int64.
    about
        What made it: descriptor, mapper and camera with their settings and identities, source and cut.
    """

    files: NDArray[np.str_]
    times: NDArray[np.int64]
    xy: NDArray[np.float64]
    yaws: NDArray[np.float64]
    rooms: NDArray[np.str_]
    positions: NDArray[np.float32]
    orientations: NDArray[np.float32]
    labels: NDArray[np.int64]
    nodes: NDArray[np.int64]
    active: NDArray[np.bool_]
    representatives: NDArray[np.float64]
    representative_frames: NDArray[np.int64]
    edges: NDArray[np.int64]
    about: dict[str, Any]

    def __post_init__(self) -> None:
        for name in ARRAYS:
            getattr(self, name).flags.writeable = False

    def __len__(self) -> int:
        return len(self.labels)

    def __repr__(self) -> str:
        of = f" of {sequence}" if (sequence := self.about.get("sequence")) else ""
        return f"TopologicalMap({len(self.nodes)} nodes over {len(self)} images{of})"

    def _repr_html_(self) -> str:
        """Return what a notebook shows: the map in a line, and its largest nodes with their rooms."""
        sizes = {int(node): len(self.images_of(int(node))) for node in self.nodes}
        largest = sorted(sizes, key=lambda node: (-sizes[node], node))[:_NODES_SHOWN]
        active = set(self.nodes[self.active].tolist())
        rows = "".join(
            f"<tr><td>{node}</td><td>{'active' if node in active else 'pending'}</td><td>{sizes[node]}</td>"
            f"<td>{escape(self._rooms_of(node))}</td></tr>"
            for node in largest
        )
        rest = len(sizes) - len(largest)
        more = f"<p>and {rest} smaller ones</p>" if rest else ""
        heads = "".join(f"<th>{head}</th>" for head in ("node", "state", "images", "rooms"))
        said = f"<p><strong>{escape(repr(self))}</strong>, {len(self.edges)} edges</p>"
        return f"{said}<table><tr>{heads}</tr>{rows}</table>{more}"

    def _rooms_of(self, node: int) -> str:
        """Return the rooms of the images of a node, the commonest first."""
        names, counts = np.unique(self.rooms[self.images_of(node)], return_counts=True)
        ranked = sorted(zip(counts.tolist(), names.tolist(), strict=True), key=lambda one: (-one[0], one[1]))
        return ", ".join(f"{name} {count}" for count, name in ranked if name)

    @property
    def cells(self) -> int:
        """Cells of the orientation descriptor."""
        return int(self.orientations.shape[1])

    @property
    def is_posed(self) -> bool:
        """Whether it is known of any image where it was taken."""
        return bool(np.isfinite(self.xy).all(axis=1).any())

    @cached_property
    def digest(self) -> str:
        """Digest of all arrays, BLAKE2b, 16 bytes, hexadecimal: equal maps have equal ones."""
        return digest_of({name: getattr(self, name) for name in ARRAYS})

    def description(self, frame: int) -> Description:
        """Return what an image looks like to the descriptor."""
        return Description(self.positions[frame], self.orientations[frame])

    def descriptions(self) -> Iterator[Description]:
        """Yield what every image looks like to the descriptor, in the order in which they were mapped."""
        return map(self.description, range(len(self)))

    def images_of(self, node: int) -> NDArray[np.int64]:
        """Return the images of a node, ascending."""
        return np.flatnonzero(self.labels == node)


@dataclass(frozen=True)
class StreamedArray:
    """An array that comes in parts, so that it never is in memory whole.

    Attributes
    ----------
    dtype, shape
        As of an array.
    chunks
        Gives its bytes, from the first, each time it is called.
    """

    dtype: np.dtype[Any]
    shape: tuple[int, ...]
    chunks: Callable[[], Iterator[bytes]]


def digest_of(arrays: Mapping[str, NDArray[Any] | StreamedArray]) -> str:
    """Return the digest of the arrays of a map; see `TopologicalMap.digest`."""
    digest = hashlib.blake2b(digest_size=16)
    for name in ARRAYS:
        array = arrays[name]
        digest.update(f"{name} {array.dtype.str} {array.shape}\n".encode())
        if isinstance(array, StreamedArray):
            for chunk in array.chunks():
                digest.update(chunk)
            continue
        array = np.ascontiguousarray(array)
        digest.update(array.tobytes() if array.dtype.kind == "U" else array.data)  # text has no buffer
    return digest.hexdigest()


def arrays_of(final: FinalMap, positions: NDArray[np.float32]) -> dict[str, NDArray[Any]]:
    """Return the arrays of a map that follow from a partition and the position descriptors, shape (n, d), by name."""
    edges = [(one, other, count) for (one, other), count in count_transitions(final.labels).items()]
    frames = representative_frames(final.labels, final.nodes, final.representatives, positions)
    return {
        "positions": positions,
        "labels": final.labels,
        "nodes": np.array(final.nodes, np.int64),
        "active": np.array([node in final.active for node in final.nodes], np.bool_),
        "representatives": final.representatives,
        "representative_frames": np.array([frames[node] for node in final.nodes], np.int64),
        "edges": np.array(edges, np.int64).reshape(-1, 3),
    }


ARRAYS = tuple(field.name for field in fields(TopologicalMap) if field.name != "about")
"""The arrays of a map, in their order in its digest."""
