"""The methods of a sweep beside each other: all runs, the mean with its interval, and what cannot be distinguished."""

from __future__ import annotations

from collections.abc import Sequence

import altair as alt
import polars as pl

from omnieval.comparison.methods import METRICS, Comparison, GroupRanks, compare_methods
from omnieval.comparison.records import ablation_records
from omnieval.comparison.tables import estimate_table
from omnieval.palette import BATCH, INK, OURS
from omnieval.report.figure import Chart, Figure
from omnieval.report.sources import Sweep
from omnieval.wording import counted, sentences

_ROW = 24
_WIDTH = 360


def methods_figures(sweep: Sweep) -> list[Figure]:
    """Return the intervals of every mapper with every descriptor, and their critical-difference diagram.

    None where the sweep has a single one, or each ran on a single case, so that nothing is spread.
    """
    table = sweep.table
    metrics = [name for name in METRICS if name in table.columns and table[name].null_count() < len(table)]
    if sweep.exact or not metrics or table.select("mapper", "descriptor").n_unique() < 2:
        return []
    if table["source"].n_unique() < 2:
        return []
    found = compare_methods(ablation_records(table, list(sweep.axes)), metrics=metrics)
    ranked = [one for one in found.ranks if len(one.groups) > 2]
    return [_intervals(found, metrics), *([_ranks(ranked)] if ranked else [])]


def _intervals(found: Comparison, metrics: Sequence[str]) -> Figure:
    data = estimate_table(found)
    charts = [_panel(found, metric) for metric in metrics]
    return Figure(
        key="methods",
        title="Every method with its interval",
        caption=sentences(
            [
                "Each tick is a sequence or a replicate of one, each point their mean, and the line its 95 % interval "
                "(percentile bootstrap over them).",
                "Without a line there are too few cases for an interval.",
                "The paper has no such figure.",
            ]
        ),
        alt=f"Points with intervals of {counted(len(data) // len(metrics), 'method')}, one panel for each of "
        f"{', '.join(metrics)}.",
        chart=alt.concat(*charts, columns=2, spacing=28),
        data=data,
    )


def _panel(found: Comparison, metric: str) -> Chart:
    own = [one for one in found.estimates if one.metric == metric]
    names = [one.group.name for one in own]
    means = [
        {"method": one.group.name, "value": one.estimate.value, "low": one.estimate.low, "high": one.estimate.high}
        for one in own
        if one.estimate.value is not None
    ]
    cases = [{"method": one.group.name, "value": value} for one in own for value in one.group.values(metric).values()]
    y = alt.Y("method:N", title=None, sort=names).scale(domain=names)
    x = alt.X("value:Q", title=metric).scale(zero=False, padding=8)
    ticks = alt.Chart(alt.InlineData(values=cases)).mark_tick(color=BATCH, thickness=1.5, height=10, opacity=0.7)
    base = alt.Chart(alt.InlineData(values=means))
    rule = base.transform_filter("isValid(datum.low)").mark_rule(color=OURS, strokeWidth=3)
    point = base.mark_point(color=OURS, filled=True, size=70, opacity=1)
    layers = (
        ticks.encode(x=x, y=y),
        rule.encode(x=alt.X("low:Q", title=metric), x2="high:Q", y=y),
        point.encode(x=x, y=y),
    )
    return alt.layer(*layers).properties(width=_WIDTH, height=_ROW * len(names))


def _ranks(ranked: Sequence[GroupRanks]) -> Figure:
    rows = [
        {"metric": one.metric, "method": group.name, "mean_rank": rank, "cases": one.ranking.cases}
        for one in ranked
        for group, rank in zip(one.groups, one.ranking.ranks, strict=True)
    ]
    return Figure(
        key="ranks",
        title="Mean ranks, and which methods cannot be distinguished",
        caption="Critical-difference diagrams: each point is the mean rank of a method over the cases that all "
        "finished, 1 the best. A bar joins neighbours of which no two differ significantly (Wilcoxon's test, "
        "corrected by Holm, 0.05). The paper has no such figure.",
        alt=" ".join(
            f"{one.metric}: "
            + ", ".join(
                f"{one.groups[place].name} {one.ranking.ranks[place]:.2f}"
                for place in sorted(range(len(one.groups)), key=one.ranking.ranks.__getitem__)
            )
            + "."
            for one in ranked
        ),
        chart=alt.vconcat(*map(_diagram, ranked), spacing=28),
        data=pl.DataFrame(rows),
    )


def _diagram(one: GroupRanks) -> Chart:
    order = sorted(range(len(one.groups)), key=one.ranking.ranks.__getitem__)
    points = [
        {"rank": one.ranking.ranks[place], "row": float(row), "method": one.groups[place].name}
        for row, place in enumerate(order)
    ]
    bars = [
        {
            "first": min(one.ranking.ranks[place] for place in some),
            "last": max(one.ranking.ranks[place] for place in some),
            "row": -1.0 - number,
        }
        for number, some in enumerate(one.alike)
    ]
    # Beyond the last rank there is room for its name.
    x = alt.X("rank:Q", title=f"mean rank by {one.metric}").scale(domain=[0.8, 1.2 * len(order)], nice=False)
    x = x.axis(values=list(range(1, len(order) + 1)), format="d")
    y = alt.Y("row:Q", axis=None).scale(domain=[-1.6 - len(bars), len(order) - 0.4], reverse=True, nice=False)
    base = alt.Chart(alt.InlineData(values=points)).encode(x=x, y=y)
    layers = [
        base.mark_point(color=OURS, filled=True, size=70, opacity=1),
        base.mark_text(align="left", dx=9, color=INK).encode(text="method:N"),
    ]
    if bars:
        joined = alt.Chart(alt.InlineData(values=bars)).mark_rule(color=BATCH, strokeWidth=5)
        layers.append(joined.encode(x=alt.X("first:Q", title=f"mean rank by {one.metric}"), x2="last:Q", y=y))
    return alt.layer(*layers).properties(width=2 * _WIDTH, height=_ROW * (len(order) + len(bars) + 1))
