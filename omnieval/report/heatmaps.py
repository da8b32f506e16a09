"""Nodes and silhouette over the two parameters of a sweep (the paper's Figs 9 and 10)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import altair as alt
import polars as pl

from omnieval.palette import BATCH, CIVIDIS, GRID, INK, OURS, VIRIDIS, ink_on, shade
from omnieval.report.figure import Chart, Figure, Skipped
from omnieval.report.sources import GROUP, Sweep
from omnieval.wording import counted, decimals, sentences, value_text

PREFERRED = ("merge_y", "omega")
"""The paper's own axes, x and y, when both are varied."""
NAMES = {
    "merge_y": "merging threshold y",
    "omega": "gate floor Ω",
    "gamma": "prominence factor γ",
    "n_new": "images that make a new node, n_new",
    "n_init": "images of the first node, n_init",
}
_CELL_WIDTH, _CELL_HEIGHT = 44, 32
_MEASURES = {"nodes": ("number of nodes", VIRIDIS, ".0f"), "silhouette": ("silhouette", CIVIDIS, ".3f")}


def sweep_figures(sweep: Sweep) -> list[Figure | Skipped]:
    """Return one figure for each dataset and descriptor: heat maps over two parameters, or lines over one."""
    varied = [name for name, values in sweep.axes.items() if name not in GROUP and len(values) > 1]
    if not varied:
        return [Skipped("Nodes and silhouette over the parameters", "no parameter of this sweep has several values")]
    figures: list[Figure | Skipped] = []
    for (dataset, _, mapper, descriptor), rows in sweep.table.group_by(GROUP, maintain_order=True):
        axes = chosen_axes({name: sweep.axes[name] for name in varied if rows[name].null_count() < len(rows)})
        rest = [name for name in varied if name not in axes]
        if not axes:
            figures.append(
                Skipped(f"Sweep of {dataset}, {descriptor}, {mapper}", "no parameter of it has several values")
            )
            continue
        cells = best_over_the_rest(rows, axes)
        subject = f"{dataset}, {descriptor}, {mapper}"
        if cells["nodes"].null_count() == len(cells):
            figures.append(Skipped(f"Sweep of {subject}", "every run failed; the table of the sweep says why"))
        elif len(axes) == 1:
            figures.append(_lines(cells, axes[0], sweep.axes[axes[0]], subject, str(descriptor)))
        else:
            figures.append(_heat_maps(cells, axes, sweep.axes, subject, str(descriptor), rest))
    return figures


def chosen_axes(varied: Mapping[str, Sequence[Any]]) -> tuple[str, ...]:
    """Return the one or two parameters to draw over: the paper's, else numbers before choices, longer axes first."""
    if all(name in varied for name in PREFERRED):
        return PREFERRED
    ranked = sorted(varied, key=lambda name: (isinstance(varied[name][0], str), -len(varied[name])))
    return tuple(ranked[:2])


def best_over_the_rest(rows: pl.DataFrame, axes: Sequence[str]) -> pl.DataFrame:
    """Return one row per cell: the run with the highest silhouette over all other parameters, the first of equals."""
    ordered = rows.sort("silhouette", descending=True, nulls_last=True, maintain_order=True)
    best = ordered.group_by(axes, maintain_order=True).agg(
        pl.col("job", "nodes", "silhouette", "error").first(),
        pl.len().alias("runs"),
        pl.col("job").min().alias("place"),
    )
    return best.sort("place").drop("place")


def _heat_maps(
    cells: pl.DataFrame,
    axes: tuple[str, ...],
    values: Mapping[str, Sequence[Any]],
    subject: str,
    descriptor: str,
    rest: Sequence[str],
) -> Figure:
    measures = [name for name in _MEASURES if cells[name].null_count() < len(cells)]
    charts = [_heat_map(cells, axes, values, name) for name in measures]
    chart = alt.hconcat(*charts, spacing=36).resolve_scale(fill="independent")
    return Figure(
        key=f"sweep-{descriptor}",
        title=f"{_sentence(measures)} over {axes[0]} and {axes[1]}: {subject}",
        caption=sentences(
            [
                f"Each cell is a replay of {subject}; the number in it is what its colour stands for.",
                _best_words(cells, axes),
                _rest_words(rest),
                _missing_words(cells, measures),
                f"Corresponds to Fig. {'10' if descriptor == 'gist' else '9'} of the paper."
                if axes == PREFERRED
                else "",
            ]
        ),
        alt=f"Heat maps of {' and '.join(_MEASURES[name][0] for name in measures)} over {_name(axes[0])} (horizontal, "
        f"{len(values[axes[0]])} values) and {_name(axes[1])} (vertical, {len(values[axes[1]])} values). "
        + " ".join(_range_words(cells, name) for name in measures),
        chart=chart,
        data=cells.select(*axes, "runs", "nodes", "silhouette", "error"),
    )


def _heat_map(cells: pl.DataFrame, axes: Sequence[str], values: Mapping[str, Sequence[Any]], measure: str) -> Chart:
    name, colors, form = _MEASURES[measure]
    low, high = _domain(cells, measure)
    best = _best(cells)
    rows = [
        {
            "x": value_text(row[axes[0]]),
            "y": value_text(row[axes[1]]),
            "value": row[measure],
            "text": "failed" if row["error"] else "–" if row[measure] is None else _shown(row[measure], form),
            "ink": INK if row[measure] is None else ink_on(shade(row[measure], low, high, colors)),
            "best": best is not None and row["job"] == best["job"],
        }
        for row in cells.iter_rows(named=True)
    ]
    base = alt.Chart(alt.InlineData(values=rows)).encode(
        x=alt.X("x:O", title=_name(axes[0]), sort=[value_text(one) for one in values[axes[0]]]).axis(labelAngle=0),
        y=alt.Y("y:O", title=_name(axes[1]), sort=[value_text(one) for one in reversed(values[axes[1]])]),
    )
    scale = alt.Scale(domain=[low, high], range=list(colors), interpolate="rgb")
    legend = alt.Legend(values=[low, high], format=form) if low < high else None
    cell = base.mark_rect(stroke=GRID, strokeWidth=0.5).encode(
        fill=alt.condition(
            "isValid(datum.value)",
            alt.Fill("value:Q", title=None, scale=scale, legend=legend),
            alt.value("transparent"),
        )
    )
    text = base.mark_text(fontSize=11).encode(text="text:N", color=alt.Color("ink:N", scale=None))
    frame = base.mark_rect(filled=False, stroke=OURS, strokeWidth=3).transform_filter("datum.best")
    return alt.layer(cell, text, frame).properties(
        title=name.capitalize(),
        width=_CELL_WIDTH * len(values[axes[0]]),
        height=_CELL_HEIGHT * len(values[axes[1]]),
    )


def _lines(cells: pl.DataFrame, axis: str, values: Sequence[Any], subject: str, descriptor: str) -> Figure:
    measures = [name for name in _MEASURES if cells[name].null_count() < len(cells)]
    ordinal = isinstance(values[0], str)
    x = alt.X(f"x:{'O' if ordinal else 'Q'}", title=_name(axis))
    if ordinal:
        x = x.sort(list(values)).axis(labelAngle=0)
    else:
        x = x.scale(domain=[min(values), max(values)], nice=False, padding=16).axis(values=list(values))
    charts = []
    for name in measures:
        rows = [{"x": row[axis], "value": row[name]} for row in cells.drop_nulls(name).iter_rows(named=True)]
        base = alt.Chart(alt.InlineData(values=rows)).encode(
            x=x, y=alt.Y("value:Q", title=_MEASURES[name][0]).scale(zero=name == "nodes")
        )
        marks = [base.mark_point(color=BATCH, filled=True, size=60, opacity=1)]
        marks += [] if ordinal else [base.mark_line(color=BATCH)]
        charts.append(alt.layer(*marks).properties(width=360, height=240))
    return Figure(
        key=f"sweep-{descriptor}",
        title=f"{_sentence(measures)} over {axis}: {subject}",
        caption=sentences(
            [
                f"Each point is a replay of {subject}.",
                _best_words(cells, (axis,)),
                _missing_words(cells, measures),
            ]
        ),
        alt=f"{'Points' if ordinal else 'Lines'} of {' and '.join(_MEASURES[name][0] for name in measures)} over "
        f"{_name(axis)}. " + " ".join(_range_words(cells, name) for name in measures),
        chart=alt.hconcat(*charts, spacing=36),
        data=cells.select(axis, "runs", "nodes", "silhouette", "error"),
    )


def _best(cells: pl.DataFrame) -> dict[str, Any] | None:
    scored = cells.drop_nulls("silhouette").sort("silhouette", descending=True, maintain_order=True)
    return None if scored.is_empty() else scored.row(0, named=True)


def _best_words(cells: pl.DataFrame, axes: Sequence[str]) -> str:
    best = _best(cells)
    if best is None:
        return ""
    place = ", ".join(f"{axis} = {value_text(best[axis])}" for axis in axes)
    equal = int((cells["silhouette"] == best["silhouette"]).sum())
    framed = " (framed)" if len(axes) == 2 else ""
    first = f", the first of {equal} equal ones" if equal > 1 else ""
    found = f"{decimals(best['silhouette'])} with {counted(best['nodes'], 'node')}"
    return f"The highest silhouette is {found} at {place}{first}{framed}; it is picked with the ground truth."


def _rest_words(rest: Sequence[str]) -> str:
    if not rest:
        return ""
    return f"Where {', '.join(rest)} {'varies' if len(rest) == 1 else 'vary'} too, a cell shows the best run over that."


def _missing_words(cells: pl.DataFrame, measures: Sequence[str]) -> str:
    if "silhouette" not in measures:
        return "There is no silhouette: the sequence has no poses, or every map has a single node."
    if cells["silhouette"].null_count():
        return "Where there is no silhouette the map has a single node, or the run failed."
    return ""


def _range_words(cells: pl.DataFrame, measure: str) -> str:
    low, high = _domain(cells, measure)
    form = _MEASURES[measure][2]
    return f"{_MEASURES[measure][0].capitalize()} from {_shown(low, form)} to {_shown(high, form)}."


def _domain(cells: pl.DataFrame, measure: str) -> tuple[float, float]:
    values = cells[measure].drop_nulls().to_list()
    return float(min(values)), float(max(values))


def _sentence(measures: Sequence[str]) -> str:
    return " and ".join(measures).capitalize()


def _name(axis: str) -> str:
    return NAMES.get(axis, axis)


def _shown(value: float, form: str) -> str:
    return format(value, form).replace("-", "−")
