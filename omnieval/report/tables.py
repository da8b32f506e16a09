"""The tables of a report: what was run, and the paper's Tables 2 and 3 beside our own rows."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from decimal import Decimal
from typing import Any

import polars as pl

from omnieval.report.batch import SPECTRAL, method_name
from omnieval.report.figure import Table
from omnieval.report.published import DOI, MAPPER, PAPER, PUBLISHED, Published, is_papers, route_of
from omnieval.report.sources import GROUP, Baseline, Replay, Sources, Sweep, best_rows
from omnieval.text_table import Cell
from omnieval.wording import value_text

_PICKED = "The best run of a sweep is picked with the ground truth; the median says what to expect without it."
_PICKED_PIECE = "The best piece of an interval is picked with the ground truth."
_PIECES = (
    "A piece is an interval of values at which the map is the same. The medians count each once, however wide it is."
)
_GARBLED = "y and Ω of Freiburg with gist are hard to read in the printed text."
_SUMMARY = {
    "posed": "with position",
    "silhouette": "silhouette",
    "silhouette_time_slices": "of time slices",
    "silhouette_positions": "of true positions",
    "pair_f1": "pair F1",
    "reentry_f1": "re-entry F1",
    "false_merge_share": "false merges",
    "rooms_ari": "rooms ARI",
    "share_assigned": "closed loops",
}
"""Metrics and how the summary calls them."""


def summary_table(sources: Sources) -> Table:
    """Return one row per replay, a best run of a sweep, and a baseline at its best k."""
    rows: list[tuple[Cell, ...]] = [
        (replay.title, replay.dataset, replay.mapper, replay.descriptor, len(replay.steps), *_measured(replay.metrics))
        for replay in sources.replays
    ]
    for sweep in sources.sweeps:
        rows += [
            (f"{sweep.name}, best", row["dataset"], row["mapper"], row["descriptor"], None, *_measured(row))
            for row in best_rows(sweep.table).iter_rows(named=True)
        ]
    for baseline in sources.baselines:
        best = baseline.table.sort("silhouette", descending=True, nulls_last=True, maintain_order=True)
        row = best.row(0, named=True)
        title = f"{baseline.name}, best: {method_name(baseline)}"
        rows.append((title, row["dataset"], row["method"], row["descriptor"], None, *_measured(row)))
    notes = [
        "Silhouette over the images with a true position, beside that of equal time slices and of k-means on the true "
        "positions, both with as many clusters; F1 of pairs of images and of returns to a known place, and nodes in "
        "two places, at 2 m; agreement of nodes and rooms (adjusted Rand index); share of images placed by a loop "
        "closure."
    ]
    if not sources.sweeps and any(map(is_papers, sources.replays)):
        notes.append("Figs 9 and 10 and Table 2 of the paper need a sweep: omnieval ablate --preset figures-9-10.")
    if sources.sweeps or sources.baselines:
        notes.append("The best run of a sweep and the best k of a baseline are picked with the ground truth.")
    return Table(
        "summary",
        "Summary",
        ("what", "dataset", "mapper", "descriptor", "images", "nodes", *_SUMMARY.values()),
        (("", tuple(rows)),),
        tuple(notes),
    )


def best_table(sweep: Sweep) -> Table:
    """Return the paper's Table 2: best and median of the sweep; beside the paper's method, the published best."""
    others = [name for name in sweep.axes if name not in {*GROUP, "merge_y", "omega"}]
    blank = [None for _ in others]
    rows: list[tuple[Cell, ...]] = []
    medians = {
        row[:4]: row[4:]
        for row in sweep.table.group_by(GROUP, maintain_order=True)
        .agg(pl.col("silhouette").median(), pl.col("nodes").median().alias("n"), pl.len(), pl.col("error").count())
        .iter_rows()
    }
    best = {tuple(row[name] for name in GROUP): row for row in best_rows(sweep.table).iter_rows(named=True)}
    for group, (silhouette, nodes, runs, failed) in medians.items():
        row = best.get(group, {})
        found = (row.get("silhouette"), row.get("nodes"), _set(row, "merge_y"), _set(row, "omega"))
        rows.append(
            (
                group[0],
                f"{group[3]}, {group[2]}",
                *found,
                *(_set(row, name) for name in others),
                silhouette,
                _short(nodes),
                runs - failed,
            )
        )
    theirs = tuple(
        (one.route, one.descriptor, one.silhouette, one.nodes, one.merge_y, one.omega, *blank, None, None, None)
        for one in PUBLISHED
    )
    papers = any(group[2] == MAPPER for group in medians)
    sources = [str(group[1]) for group in medians]
    return Table(
        "table-2",
        "Table 2: best of the sweep",
        (
            "dataset",
            "descriptor, mapper",
            "best silhouette",
            "nodes",
            "y",
            "Ω",
            *others,
            "median silhouette",
            "median nodes",
            "pieces" if sweep.exact else "runs",
        ),
        (("This sweep", tuple(rows)), *([(theirs_heading(sources), theirs)] if papers else [])),
        (
            *((_PICKED_PIECE, _PIECES) if sweep.exact else (_PICKED,)),
            *([_relation(sources), _GARBLED] if papers else []),
        ),
    )


def batch_table(sweeps: Sequence[Sweep], replays: Sequence[tuple[Replay, float | None]]) -> Table | None:
    """Return the paper's Table 3: the incremental map against batch clustering with as many clusters.

    The published rows stand beside rows of the paper's method only.

    Parameters
    ----------
    sweeps
        Their best runs are rows.
    replays
        Finished replays, with the silhouette of batch spectral clustering at their number of nodes.

    Returns
    -------
    None if there is no row.
    """
    rows: list[tuple[Cell, ...]] = []
    mappers: set[str] = set()
    sources: list[str] = []
    for sweep in sweeps:
        for row in best_rows(sweep.table).iter_rows(named=True):
            what = f"best of {sweep.name}"
            components = f"{row['descriptor']}, {row['mapper']}"
            rows.append((row["dataset"], components, what, row["nodes"], *_gain(row, row["batch_silhouette"])))
            mappers.add(row["mapper"])
            sources.append(row["source"])
    for replay, batch in replays:
        components = f"{replay.descriptor}, {replay.mapper}"
        gain = _gain(replay.metrics, batch)
        rows.append((replay.dataset, components, replay.title, replay.metrics["nodes"], *gain))
        mappers.add(replay.mapper)
        sources.append(replay.source)
    if not rows:
        return None
    theirs = tuple(_published_gain(one) for one in PUBLISHED)
    return Table(
        "table-3",
        "Table 3: incremental against batch",
        (
            "dataset",
            "descriptor, mapper",
            "map",
            "k",
            "incremental silhouette",
            f"{SPECTRAL} silhouette",
            "difference",
        ),
        (("Here", tuple(rows)), *([(theirs_heading(sources), theirs)] if MAPPER in mappers else [])),
        (
            "Batch clustering sees all images at once, and is given the number of nodes as the number of clusters.",
            *([_relation(sources)] if MAPPER in mappers else []),
        ),
    )


def partitions_table(baseline: Baseline) -> Table:
    """Return the rows of a baseline."""
    names = ("k", "nodes", "silhouette", "silhouette_time_slices", "silhouette_positions", "rooms_ari", "rooms_nmi")
    rows = tuple(baseline.table.select(names).iter_rows())
    columns = tuple(name.replace("_", " ") for name in names)
    return Table("partitions", "Partitions", columns, (("", rows),))


def theirs_heading(sources: Iterable[str]) -> str:
    """Return what stands over the rows of the paper."""
    same = {route for source in sources if (route := route_of(source))}
    if same:
        return f"Published, {PAPER} (probably the same sequence: {', '.join(sorted(same))}; else other datasets)"
    return f"Published, {PAPER}: other datasets, not comparable in value"


def _relation(sources: Iterable[str]) -> str:
    words = f"Published numbers are maxima over the sweep, from {DOI}."
    same = {route for source in sources if (route := route_of(source))}
    if not same:
        return f"{words} Ours are of other image sequences: compare the trend, not the values."
    return f"{words} Of these, only {' and '.join(sorted(same))} can be compared with rows above."


def _measured(values: Mapping[str, Any]) -> tuple[Cell, ...]:
    return tuple(values.get(name) for name in ("nodes", *_SUMMARY))


def _short(value: float | None) -> Decimal | None:
    """Return a parameter without meaningless decimals."""
    return None if value is None else Decimal(f"{value:g}")


def _set(row: Mapping[str, Any], name: str) -> Cell:
    """Return the value of a parameter of a run, or the interval that a row of an exact sweep holds for."""
    if row.get("exact") == name:
        return f"{value_text(row['exact_from'])} to {value_text(row['exact_to'])}"
    value = row.get(name)
    return _short(value) if isinstance(value, float) else value


def _gain(values: Mapping[str, Any], batch: float | None) -> tuple[Cell, ...]:
    silhouette = values.get("silhouette")
    return silhouette, batch, None if silhouette is None or batch is None else silhouette - batch


def _published_gain(one: Published) -> tuple[Cell, ...]:
    difference = round(one.silhouette - one.batch_silhouette, 2)  # the batch silhouettes were printed with two
    return one.route, one.descriptor, "best of the sweep", one.nodes, one.silhouette, one.batch_silhouette, difference
