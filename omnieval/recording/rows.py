"""Rows of a recording, and how many of one kind become Arrow columns at once.

Logging row by row costs milliseconds a step; a column of fifty rows costs little more than one row. Each kind
therefore knows how to turn a list of itself into columns. An empty row clears what was shown.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol, Self

import numpy as np
import pyarrow as pa
import rerun as rr
from numpy.typing import NDArray
from rerun import ComponentBatchLike

Columns = list[rr.ComponentColumn]


class Row(Protocol):
    """Something one entity shows at one step."""

    @classmethod
    def columns(cls, rows: Sequence[Self]) -> Columns:
        """Return the columns that hold these rows, in their order."""
        ...


@dataclass(frozen=True)
class Scalar:
    """A point of a plot over time; NaN interrupts the line."""

    value: float

    @classmethod
    def columns(cls, rows: Sequence[Self]) -> Columns:
        """See `Row.columns`."""
        return [*rr.Scalars.columns(scalars=np.array([row.value for row in rows]))]


@dataclass(frozen=True)
class Words:
    """A line of the log."""

    text: str
    level: str
    color: int

    @classmethod
    def columns(cls, rows: Sequence[Self]) -> Columns:
        """See `Row.columns`."""
        return [
            *rr.TextLog.columns(
                text=[row.text for row in rows],
                level=[row.level for row in rows],
                color=np.array([row.color for row in rows], np.uint32),
            )
        ]


@dataclass(frozen=True)
class Page:
    """A page of Markdown."""

    text: str

    @classmethod
    def columns(cls, rows: Sequence[Self]) -> Columns:
        """See `Row.columns`. That it is Markdown is said once, with the styles."""
        return [*rr.TextDocument.columns(text=[row.text for row in rows])]


@dataclass(frozen=True)
class State:
    """The state a coloured lane enters."""

    state: str

    @classmethod
    def columns(cls, rows: Sequence[Self]) -> Columns:
        """See `Row.columns`."""
        return [*rr.StateChange.columns(state=[row.state for row in rows])]


@dataclass(frozen=True)
class Picture:
    """A JPEG image; None clears."""

    jpeg: bytes | None

    @classmethod
    def columns(cls, rows: Sequence[Self]) -> Columns:
        """See `Row.columns`."""
        lengths = [int(row.jpeg is not None) for row in rows]
        if not any(lengths):
            return [_cleared(rr.EncodedImage.descriptor_blob(), rr.components.BlobBatch, len(rows))]
        blobs = [row.jpeg for row in rows if row.jpeg is not None]
        return [*rr.EncodedImage.columns(blob=blobs).partition(lengths)]


@dataclass(frozen=True)
class Bars:
    """Bars of a chart: heights, left edges and widths, each of shape (n,)."""

    heights: NDArray[np.floating]
    left: NDArray[np.floating]
    width: NDArray[np.floating]

    @classmethod
    def columns(cls, rows: Sequence[Self]) -> Columns:
        """See `Row.columns`. Half precision is enough for the height of a bar on a screen."""
        chart = rr.BarChart
        widths = np.concatenate([row.width for row in rows]).astype(np.float32)
        return [
            _tensors(chart.descriptor_values(), [row.heights.astype(np.float16) for row in rows], "F16"),
            _tensors(chart.descriptor_abscissa(), [row.left.astype(np.float32) for row in rows], "F32"),
            rr.ComponentColumn(
                chart.descriptor_widths(),
                rr.components.LengthBatch(widths),
                lengths=[len(row.width) for row in rows],
            ),
        ]


NO_BARS = Bars(np.zeros(0), np.zeros(0), np.zeros(0))


@dataclass(frozen=True)
class Points:
    """Points of the map: positions (n, 2), metres, y up; classes (n,) are the nodes that colour them.

    `facts` are shown of a point that is selected, by their names, one for each point.
    """

    positions: NDArray[np.floating]
    classes: NDArray[np.integer]
    labels: tuple[str, ...] | None = None
    facts: Mapping[str, Sequence[str]] = field(default_factory=dict)

    @classmethod
    def columns(cls, rows: Sequence[Self]) -> Columns:
        """See `Row.columns`."""
        lengths = [len(row.classes) for row in rows]
        columns = rr.Points2D.columns(
            positions=_screen(np.concatenate([row.positions for row in rows])),
            class_ids=np.concatenate([row.classes for row in rows]).astype(np.uint16),
        )
        result = [*columns.partition(lengths)]
        if rows[0].labels is not None:
            labels = [label for row in rows for label in row.labels or ()]
            batch = rr.components.TextBatch(labels)
            result.append(rr.ComponentColumn(rr.Points2D.descriptor_labels(), batch, lengths=lengths))
        return [*result, *_fact_columns([row.facts for row in rows])]


@dataclass(frozen=True)
class Facts:
    """What is shown of the points of an entity that are selected, by name, one value for each point."""

    values: Mapping[str, Sequence[str]]

    @classmethod
    def columns(cls, rows: Sequence[Self]) -> Columns:
        """See `Row.columns`. All rows have facts of the same names."""
        return _fact_columns([row.values for row in rows])


@dataclass(frozen=True)
class Segments:
    """Straight lines on the map: ends (n, 2, 2), metres, y up; colours (n,) 0xRRGGBBAA; widths (n,), ui points.

    Without widths they are as wide as their style says.
    """

    ends: NDArray[np.floating]
    colors: NDArray[np.integer]
    widths: NDArray[np.floating] | None = None

    @classmethod
    def columns(cls, rows: Sequence[Self]) -> Columns:
        """See `Row.columns`."""
        ends = _screen(np.concatenate([row.ends for row in rows]).reshape(-1, 2))
        lengths = [len(row.colors) for row in rows]
        strip_type = rr.components.LineStrip2DBatch._ARROW_DATATYPE
        strips = pa.ListArray.from_arrays(
            pa.array(np.arange(0, len(ends) + 1, 2, dtype=np.int32)),
            pa.FixedSizeListArray.from_arrays(pa.array(ends.ravel()), type=strip_type.value_type),
            type=strip_type,
        )
        colors = np.concatenate([row.colors for row in rows]).astype(np.uint32)
        lines = rr.LineStrips2D
        columns = [
            rr.ComponentColumn(lines.descriptor_strips(), rr.components.LineStrip2DBatch(strips), lengths=lengths),
            rr.ComponentColumn(lines.descriptor_colors(), rr.components.ColorBatch(colors), lengths=lengths),
        ]
        if rows[0].widths is not None:
            # Negative radii are in ui points: the line is as wide whatever the zoom.
            radii = -np.concatenate([row.widths for row in rows if row.widths is not None]) / 2
            batch = rr.components.RadiusBatch(radii.astype(np.float32))
            columns.append(rr.ComponentColumn(lines.descriptor_radii(), batch, lengths=lengths))
        return columns


NO_SEGMENTS = Segments(np.zeros((0, 2, 2)), np.zeros(0, np.uint32))


@dataclass(frozen=True)
class Arrow:
    """An arrow on the map: from `origin` along `vector`, both (2,), metres, y up."""

    origin: NDArray[np.floating]
    vector: NDArray[np.floating]

    @classmethod
    def columns(cls, rows: Sequence[Self]) -> Columns:
        """See `Row.columns`."""
        return [
            *rr.Arrows2D.columns(
                origins=_screen(np.stack([row.origin for row in rows])),
                vectors=_screen(np.stack([row.vector for row in rows])),
            )
        ]


@dataclass(frozen=True)
class Graph:
    """The topological graph: nodes with label, colour and place, undirected edges between node ids."""

    nodes: tuple[str, ...]
    labels: tuple[str, ...]
    colors: tuple[int, ...]
    places: tuple[tuple[float, float], ...]
    edges: tuple[tuple[str, str], ...] = field(default=())

    @classmethod
    def columns(cls, rows: Sequence[Self]) -> Columns:
        """See `Row.columns`."""
        lengths = [len(row.nodes) for row in rows]
        nodes = rr.GraphNodes.columns(
            node_ids=[node for row in rows for node in row.nodes],
            labels=[label for row in rows for label in row.labels],
            colors=np.array([color for row in rows for color in row.colors], np.uint32),
            positions=np.array([place for row in rows for place in row.places], np.float32).reshape(-1, 2),
        ).partition(lengths)
        edges = [edge for row in rows for edge in row.edges]
        counts = [len(row.edges) for row in rows]
        descriptor, batch = rr.GraphEdges.descriptor_edges(), rr.components.GraphEdgeBatch
        if not edges:
            return [*nodes, _cleared(descriptor, batch, len(rows))]
        return [*nodes, rr.ComponentColumn(descriptor, batch(edges), lengths=counts)]


def _fact_columns(facts: Sequence[Mapping[str, Sequence[str]]]) -> Columns:
    columns: Columns = []
    for name in facts[0]:
        values: dict[str, Any] = {name: [value for fact in facts for value in fact[name]]}
        columns += rr.AnyValues.columns(**values).partition([len(fact[name]) for fact in facts])
    return columns


def _screen(points: NDArray[np.floating]) -> NDArray[np.float32]:
    """Return map coordinates as the 2D view wants them: y grows downwards there."""
    return np.asarray(points * np.array([1.0, -1.0]), np.float32)


def _cleared(
    descriptor: rr.ComponentDescriptor, batch: Callable[[None], ComponentBatchLike], rows: int
) -> rr.ComponentColumn:
    return rr.ComponentColumn(descriptor, batch(None), lengths=np.zeros(rows, np.int32))


def _tensors(
    descriptor: rr.ComponentDescriptor, vectors: Sequence[NDArray[np.floating]], kind: str
) -> rr.ComponentColumn:
    """Return a column of one-dimensional tensors, assembled as Arrow.

    Rerun's own conversion takes a millisecond a tensor, and silently drops columns of differing lengths.
    """
    batch = rr.components.TensorDataBatch
    struct = batch._ARROW_DATATYPE
    rows = len(vectors)
    shape_type, union = struct.field("shape").type, struct.field("buffer").type
    shapes = pa.ListArray.from_arrays(
        pa.array(np.arange(rows + 1, dtype=np.int32)),
        pa.array([len(vector) for vector in vectors], pa.uint64()),
        type=shape_type,
    )
    ends = np.cumsum([0, *map(len, vectors)], dtype=np.int32)
    code = next(index for index in range(union.num_fields) if union.field(index).name == kind)
    children = [pa.nulls(0, union.field(index).type) for index in range(union.num_fields)]
    children[code] = pa.ListArray.from_arrays(
        pa.array(ends), pa.array(np.concatenate(vectors)), type=union.field(code).type
    )
    types = pa.array(np.full(rows, code, np.int8))
    offsets = pa.array(np.arange(rows, dtype=np.int32))
    buffers = [None, types.buffers()[1], offsets.buffers()[1]]
    buffer = pa.Array.from_buffers(union, rows, buffers, children=children)
    names = pa.nulls(rows, struct.field("names").type)
    tensors = pa.StructArray.from_arrays([shapes, names, buffer], fields=list(struct))
    return rr.ComponentColumn(descriptor, batch(tensors))
