"""The columns of every table of a run. A change here is a new `SCHEMA_VERSION`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import get_args

import polars as pl
from pydantic.fields import FieldInfo

from omnieval.mapping.interface import Column
from omnieval.mapping.step import EventKind, Placement, Role
from omnieval.metrics.catalogue import CATALOGUE

SCHEMA_VERSION = 3


def table_schema(columns: Mapping[str, pl.DataType | type[pl.DataType]]) -> pl.Schema:
    """Return the columns of a table, by name."""
    return pl.Schema(columns)


ROLE = pl.Enum([role.value for role in Role])
PLACEMENT = pl.Enum([placement.value for placement in Placement])
EVENT = pl.Struct(
    {
        "kind": pl.Enum([kind.value for kind in EventKind]),
        "node": pl.Int32,
        "into": pl.Int32,
        "frames": pl.List(pl.Int32),
    }
)
COMPARISON = pl.Struct(
    {
        "gate": pl.String,
        "values": pl.List(pl.Float64),
        "of": pl.List(pl.Int32),
        "threshold": pl.Float64,
        "reaches": pl.Boolean,
        "low": pl.Float64,
        "high": pl.Float64,
        "parameter": pl.String,
        "floor": pl.Float64,
        "counts": pl.Boolean,
    }
)
"""What was compared (`mapping.step.Comparison`)."""

STEPS = table_schema(
    {
        "frame": pl.Int32,
        "file": pl.String,
        "time": pl.Datetime("ns"),
        "x": pl.Float64,
        "y": pl.Float64,
        "yaw": pl.Float64,
        "room": pl.String,
        "verdict": pl.String,
        "role": ROLE,
        "node": pl.Int32,
        "node_final": pl.Int32,
        "placement": PLACEMENT,
        "forced": pl.Boolean,
        "best_frame": pl.Int32,
        "best_node": pl.Int32,
        "shift": pl.Int32,
        "comparisons": pl.List(COMPARISON),
        "event": pl.List(EVENT),
        "active": pl.Int32,
        "pending": pl.Int32,
        "margin": pl.Float64,
        "margin_gate": pl.String,
        "milliseconds": pl.Float64,
    }
)
"""One row per frame: what every mapper says. All but `node_final`, `placement`, `forced` is known at the step itself.
The columns that the mapper declares (`Column`) come before `milliseconds`."""

_COLUMN_TYPES: dict[str, type[pl.DataType]] = {"float": pl.Float64, "int": pl.Int32}


def steps_schema(columns: Iterable[Column]) -> pl.Schema:
    """Return the columns of the steps of a mapper that declares some of its own."""
    own = {column.name: _COLUMN_TYPES[column.type] for column in columns}
    common = {name: kind for name, kind in STEPS.items() if name != "milliseconds"}
    return table_schema({**common, **own, "milliseconds": STEPS["milliseconds"]})


NODES = table_schema(
    {
        "id": pl.Int32,
        "images": pl.Int32,
        "active": pl.Boolean,
        "created": pl.Int32,
        "activated": pl.Int32,
        "merged": pl.Int32,
        "merged_into": pl.Int32,
        "rooms": pl.List(pl.Struct({"room": pl.String, "share": pl.Float64})),
        "center_x": pl.Float64,
        "center_y": pl.Float64,
        "extent": pl.Float64,
        "representative_frame": pl.Int32,
        "representative": pl.List(pl.Float32),
    }
)
"""One row per node that ever was. `created`, `activated`, `merged` are frames, `extent` the diagonal of the bounding
box of those of its images that have a position (metres), `representative` the mean position descriptor,
`representative_frame` the image nearest to it; null for nodes that merged into another."""

TRANSITIONS = table_schema({"node_a": pl.Int32, "node_b": pl.Int32, "count": pl.Int32})
"""The edges of the topological map: how often the robot went between two nodes, node_a < node_b."""

QUALITY = table_schema(
    {
        "metric": pl.String,
        "theta": pl.Float64,
        "value": pl.Float64,
        "count": pl.Int64,
        "low": pl.Float64,
        "high": pl.Float64,
        "reason": pl.String,
    }
)
"""One row per metric and distance (`metrics.quality.Measure`)."""

_METRICS: dict[str, type[pl.DataType]] = {
    metric.name: pl.Float64 if not metric.whole else pl.Int64 if metric.unit == "bytes" else pl.Int32
    for metric in CATALOGUE
}

PARTITIONS = table_schema(
    {
        "dataset": pl.String,
        "descriptor": pl.String,
        "method": pl.String,
        "similarity": pl.String,
        "k": pl.Int32,
        **_METRICS,
        "seconds": pl.Float64,
    }
)
"""One row per baseline partition: what made it, the metrics of a run, and the seconds it takes on its own, i.e. with
the work that the rows of one table share. `k` is the number of clusters asked for, null where the method finds it
itself; `similarity` is null where none is used."""


FOUND: dict[str, type[pl.DataType]] = {
    "error_mean": pl.Float64,
    "error_median": pl.Float64,
    "error_p95": pl.Float64,
    "reachable_mean": pl.Float64,
    "recall@1": pl.Float64,
    "recall@5": pl.Float64,
    "refused": pl.Int32,
    "node_accuracy": pl.Float64,
    "room_accuracy": pl.Float64,
    "heading_error_median": pl.Float64,
}
"""The metrics of localisation in an ablation, by the names that `localization.measures` gives."""

_PARAMETER_TYPES: dict[str, type[pl.DataType]] = {"float": pl.Float64, "int": pl.Int64, "text": pl.String}


def parameter_type(field: FieldInfo) -> str:
    """Return the name of the type of a parameter's column; choices and names are text."""
    types = set(get_args(field.annotation)) | {field.annotation}
    return "float" if float in types else "int" if int in types else "text"


def ablation_schema(parameters: Mapping[str, str]) -> pl.Schema:
    """Return the columns of an ablation whose components have these parameters, by name, with their types in words.

    One row per run, in the order of its grid (`job`): the source, what was perturbed of it and as which replicate (null
    if nothing was), mapper and descriptor, every parameter (null where the row's components have none of that name),
    the metrics of a run, those of looking for its images in the map of another sequence (`map`, by `strategy`; null
    where that was not asked for), the silhouette of batch spectral clustering with as many clusters as the map has
    nodes, the smallest margin, where it was, the seconds of mapping, and the error of a run that failed (its other
    results are null). What runs have in common is computed once, and its seconds are divided among them. With
    `exact`, the name of a parameter, a row holds for all its values from `exact_from` up to below `exact_to` (the
    last row of an interval up to and with it); else these are null.
    """
    return table_schema(
        {
            "job": pl.Int32,
            "dataset": pl.String,
            "source": pl.String,
            "perturbation": pl.String,
            "replicate": pl.Int32,
            "mapper": pl.String,
            "descriptor": pl.String,
            **{name: _PARAMETER_TYPES[kind] for name, kind in parameters.items()},
            **_METRICS,
            "map": pl.String,
            "strategy": pl.String,
            **FOUND,
            "batch_silhouette": pl.Float64,
            "smallest_margin": pl.Float64,
            "smallest_margin_frame": pl.Int32,
            "smallest_margin_gate": pl.String,
            "exact": pl.String,
            "exact_from": pl.Float64,
            "exact_to": pl.Float64,
            "seconds": pl.Float64,
            "error": pl.String,
        }
    )
