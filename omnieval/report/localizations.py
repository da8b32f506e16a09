"""Localisations in a report: error over the route, cumulative errors, every light in the map of every light."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from decimal import Decimal
from itertools import cycle
from typing import Any

import altair as alt
import numpy as np
import polars as pl

from omnieval.localization.published import PUBLISHED
from omnieval.localization.run import Localization
from omnieval.mapping.step import Role
from omnieval.palette import BATCH, CONTROL, INK, NODE_COLORS, OURS
from omnieval.report.figure import Block, Chart, Figure, Skipped, Table
from omnieval.text_table import Cell
from omnieval.wording import counted, decimals, ordinal, sentences

_KNOWN = {"levels": OURS, "nearest": BATCH, "coarse": CONTROL}
_MOST = 1000
"""Queries drawn in a line; of more, every n-th."""
_SHARES = 101
"""Points of a cumulative curve."""
_COLUMNS = {
    "queries": "images",
    "refused": "refused",
    "error_mean": "mean error, m",
    "error_median": "median, m",
    "error_p95": "95 %, m",
    "reachable_mean": "reachable, m",
    "recall@1": "recall@1",
    "recall@5": "recall@5",
    "node_accuracy": "right node",
    "room_accuracy": "right room",
    "heading_error_median": "heading, deg",
    "compared_mean": "compared",
}
_PLACES = {
    **dict.fromkeys(("error_mean", "error_median", "error_p95", "reachable_mean"), 3),
    **dict.fromkeys(("heading_error_median", "compared_mean"), 1),
}
_OPEN = {"right": "right", "wrong": "wrong", "rightly_refused": "rightly refused", "wrongly_refused": "wrongly refused"}
_REFUSED = "refused"


def localization_blocks(found: Localization, *, figures: bool) -> Iterator[Block]:
    """Yield the figures and the table of a localisation."""
    if figures:
        posed = found.table.filter(pl.col("reachable").is_not_null())
        if posed.is_empty():
            reason = "the queries or the map have no true positions, so there are no errors"
            yield Skipped("Error over the route", reason)
            yield Skipped("Cumulative errors", reason)
        else:
            yield route_figure(found, posed)
            yield cumulative_figure(found, posed)
    yield _measures_table(found)


def route_figure(found: Localization, posed: pl.DataFrame) -> Figure:
    """Return the error of every query along the drive, a panel per sequence, a line per strategy."""
    sequences, strategies = _names(posed, "sequence"), _names(posed, "strategy")
    longest = max(len(posed.filter(sequence=one, strategy=strategies[0])) for one in sequences)
    stride = -(-longest // _MOST)
    drawn = posed.gather_every(1) if stride == 1 else posed.filter(pl.col("query") % stride == 0)
    data = drawn.select("sequence", "strategy", "query", "error", "reachable", "verdict", "role")
    panels = [_route_panel(data.filter(sequence=one), one, strategies) for one in sequences]
    worst = float(posed["error"].max() or 0.0)  # type: ignore[arg-type]
    return Figure(
        key="route",
        title="Error over the route",
        caption=sentences(
            [
                f"How far from the query the image was taken that was found in the map of {_map_name(found)}: metres, "
                "along the drive, on a scale of square roots. The nearest image of the map is the best that "
                "could be had.",
                "Marks above are queries that a strategy refused.",
                f"Every {ordinal(stride)} query is drawn." if stride > 1 else "",
            ]
        ),
        alt=f"{counted(len(sequences), 'panel')} of lines of the error over the query, one for each of "
        f"{', '.join(strategies)}. The largest error is {decimals(worst, 2)} m.",
        chart=alt.vconcat(*panels, spacing=14),
        data=data,
    )


def cumulative_figure(found: Localization, posed: pl.DataFrame) -> Figure:
    """Return the share of queries that were found within a distance, a panel per sequence, a line per strategy."""
    sequences, strategies = _names(posed, "sequence"), _names(posed, "strategy")
    farthest = max(1.0, float(np.percentile(posed["error"].drop_nulls().to_numpy(), 99))) if _any(posed) else 1.0
    limits = farthest * np.linspace(0.0, 1.0, _SHARES) ** 2
    rows = [
        {"sequence": sequence, "strategy": strategy, "within": float(limit), "share": share}
        for sequence in sequences
        for strategy in strategies
        for limit, share in zip(limits, _shares(posed, sequence, strategy, limits), strict=True)
    ]
    data = pl.DataFrame(rows)
    within = float(found.manifest["within"])
    panels = [_cumulative_panel(data.filter(sequence=one), one, strategies, within) for one in sequences]
    return Figure(
        key="cumulative",
        title="Cumulative errors",
        caption=sentences(
            [
                "Share of the queries that were found within a distance of where they were taken. A query that was "
                "refused is found at no distance, so a curve that ends below 1 refused the rest.",
                f"The vertical line is at {within:g} m, within which an answer counts as right.",
            ]
        ),
        alt=f"{counted(len(sequences), 'panel')} of rising curves, one for each of {', '.join(strategies)}.",
        chart=alt.concat(*panels, columns=2, spacing=28),
        data=data,
    )


def lights_table(localizations: Sequence[Localization]) -> Table:
    """Return the mean error of every query sequence in every map, a row per map, descriptor and strategy."""
    queries = sorted({name for one in localizations for name in one.manifest["metrics"]})
    cells: dict[tuple[str, str, str], dict[str, Mapping[str, Any]]] = {}
    for one in localizations:
        for sequence, by_strategy in one.manifest["metrics"].items():
            for strategy, values in by_strategy.items():
                row = cells.setdefault((_map_name(one), one.manifest["descriptor"]["name"], strategy), {})
                row[sequence] = values
    rows = tuple(
        (*key, *(cell for name in queries for cell in _error_and_refused(row.get(name)))) for key, row in cells.items()
    )
    columns = tuple(column for name in queries for column in (f"{name}, m", _REFUSED))
    return Table(
        "lights",
        "Every sequence in every map: mean error",
        ("map", "descriptor", "strategy", *columns),
        (("", rows),),
        ("Mean distance of the image that was found from where the query was taken, over the queries not refused.",),
    )


def published_table() -> Table:
    """Return the numbers that others published; none of them was computed here."""
    rows = tuple(
        (one.method, _as_published(one.cloudy), _as_published(one.night), _as_published(one.sunny)) for one in PUBLISHED
    )
    return Table(
        "published-localization",
        "Published: mean errors on COLD-Freiburg, part A",
        ("method", "cloudy, m", "night, m", "sunny, m"),
        (("Published by others, on the real images; none of it was run here", rows),),
        (
            "The map is seq2_cloudy3, the queries are seq2_cloudy2, seq2_night2 and seq2_sunny2.",
            "Sources: the READMEs of IndoorLocalizationSingleCNN and IndoorLocalizationSNN.",
            "Other images than those above, unless these are the same sequences: compare the trend, not the values.",
            "Cloudy values below 0.17 m look like another split, for a map of 588 images is 0.17 m apart.",
        ),
    )


def _measures_table(found: Localization) -> Table:
    part = found.manifest["map"]
    names = _COLUMNS | (_OPEN if part["limit"] is not None or part["without_rooms"] else {})
    groups: tuple[tuple[str, tuple[tuple[Cell, ...], ...]], ...] = tuple(
        (sequence, tuple(_measured(strategy, values, names) for strategy, values in by_strategy.items()))
        for sequence, by_strategy in found.manifest["metrics"].items()
    )
    notes = (
        "Errors are over the queries that were not refused; in recall, refusals count as misses. Reachable is the "
        f"nearest image of the map. Right is within {found.manifest['within']:g} m.",
    )
    return Table("measures", "Metrics", ("strategy", *names.values()), groups, notes)


def localization_facts(found: Localization) -> Mapping[str, str]:
    """Return what a localisation is of, as names and values."""
    about = found.manifest
    part = about["map"]
    left_out = [f"its first {part['limit']} images"] if part["limit"] is not None else []
    left_out += [f"without {', '.join(part['without_rooms'])}"] if part["without_rooms"] else []
    return {
        "folder": str(found.folder),
        "map": ", ".join([f"{_map_name(found)}, {counted(part['images'], 'image')}", *left_out]),
        "queries": ", ".join(query["source"] for query in about["queries"]),
        "mapper": about["mapper"]["name"],
        "descriptor": about["descriptor"]["name"],
        "digest of the map": part["digest"],
        "code": about["code"],
    }


def _as_published(error: float) -> Decimal:
    return Decimal(str(error))


def _measured(strategy: str, values: Mapping[str, Any], names: Iterable[str]) -> tuple[Cell, ...]:
    return (strategy, *(_cell(name, values[name]) for name in names))


def _error_and_refused(values: Mapping[str, Any] | None) -> tuple[Cell, Cell]:
    return (None, None) if values is None else (_cell("error_mean", values["error_mean"]), values["refused"])


def _cell(name: str, value: float | int | None) -> Cell:
    """Return a metric with as many decimals as mean something: millimetres, tenths of a degree or of an image."""
    places = _PLACES.get(name)
    return value if value is None or places is None else Decimal(f"{value:.{places}f}")


def _route_panel(rows: pl.DataFrame, sequence: str, strategies: Sequence[str]) -> Chart:
    colors = _colors(strategies)
    domain = [*colors, "nearest of the map"]
    scale = alt.Scale(domain=domain, range=[*colors.values(), INK])
    legend = alt.Legend(orient="bottom", symbolType="stroke", symbolSize=500, symbolStrokeWidth=3)
    first = rows.filter(strategy=strategies[0])
    best = [{"query": q, "error": r, "what": domain[-1]} for q, r in first.select("query", "reachable").iter_rows()]
    lines = [*rows.select("query", "error", what="strategy").iter_rows(named=True), *best]
    base = alt.Chart(alt.InlineData(values=lines)).encode(
        x=alt.X("query:Q", title="query").scale(nice=False),
        y=alt.Y("error:Q", title="error, m").scale(type="sqrt"),
        color=alt.Color("what:N", title=None, legend=legend).scale(scale),
    )
    refused = [
        {"query": query, "what": strategy}
        for query, strategy in rows.filter(pl.col("role") == Role.REFUSED.value).select("query", "strategy").iter_rows()
    ]
    layers: list[Any] = [base.mark_line(strokeWidth=1.1)]
    if refused:
        marks = alt.Chart(alt.InlineData(values=refused)).mark_tick(thickness=1, size=9, opacity=0.7)
        layers.append(marks.encode(x="query:Q", y=alt.value(3), color=alt.Color("what:N", legend=legend).scale(scale)))
    return alt.layer(*layers).properties(title=sequence, width=800, height=150)


def _cumulative_panel(rows: pl.DataFrame, sequence: str, strategies: Sequence[str], within: float) -> Chart:
    colors = _colors(strategies)
    legend = alt.Legend(orient="bottom", symbolType="stroke", symbolSize=500, symbolStrokeWidth=3)
    base = alt.Chart(alt.InlineData(values=rows.to_dicts())).encode(
        x=alt.X("within:Q", title="error of at most, m").scale(type="sqrt", nice=False),
        y=alt.Y("share:Q", title="share of queries").scale(domain=[0, 1]),
        color=alt.Color("strategy:N", title=None, legend=legend).scale(
            domain=list(colors), range=list(colors.values())
        ),
    )
    right = alt.Chart(alt.InlineData(values=[{"within": within}])).mark_rule(color=INK, strokeDash=[3, 3])
    lines = base.mark_line(strokeWidth=1.8, interpolate="step-after")
    return alt.layer(right.encode(x="within:Q"), lines).properties(title=sequence, width=370, height=220)


def _shares(posed: pl.DataFrame, sequence: str, strategy: str, limits: np.ndarray[Any, Any]) -> list[float]:
    errors = posed.filter(sequence=sequence, strategy=strategy)["error"]
    known = np.sort(errors.drop_nulls().to_numpy())
    shares: list[float] = (np.searchsorted(known, limits, side="right") / max(1, len(errors))).tolist()
    return shares


def _colors(strategies: Sequence[str]) -> dict[str, str]:
    others = cycle(NODE_COLORS)
    return {name: _KNOWN.get(name) or next(others) for name in strategies}


def _any(posed: pl.DataFrame) -> bool:
    return posed["error"].null_count() < len(posed)


def _names(table: pl.DataFrame, column: str) -> list[str]:
    names: list[str] = table[column].unique(maintain_order=True).to_list()
    return names


def _map_name(found: Localization) -> str:
    return str(found.manifest["map"]["sequence"])
