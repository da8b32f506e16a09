"""Nodes and silhouette over all values of one parameter, from a sweep that splits an interval exactly into pieces."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import cycle, islice
from typing import Any

import altair as alt
import polars as pl

from omnieval.palette import NODE_COLORS
from omnieval.report.figure import Chart, Figure, Skipped
from omnieval.report.sources import GROUP, Sweep
from omnieval.wording import counted, decimals, sentences, value_text

_MEASURES = {"nodes": "number of nodes", "silhouette": "silhouette"}


def pieces_figures(sweep: Sweep) -> list[Figure | Skipped]:
    """Return one figure for each dataset and descriptor."""
    figures: list[Figure | Skipped] = []
    for (dataset, _, mapper, descriptor), rows in sweep.table.group_by(GROUP, maintain_order=True):
        subject = f"{dataset}, {descriptor}, {mapper}"
        pieces = rows.drop_nulls("exact_from").sort("job", "exact_from")
        if pieces["nodes"].null_count() == len(pieces):
            figures.append(Skipped(f"Sweep of {subject}", "every run failed; the table of the sweep says why"))
        else:
            figures.append(_figure(pieces, [name for name in sweep.axes if name not in GROUP], subject))
    return figures


def _figure(pieces: pl.DataFrame, axes: Sequence[str], subject: str) -> Figure:
    name = str(pieces["exact"][0])
    measures = [measure for measure in _MEASURES if pieces[measure].null_count() < len(pieces)]
    others = [axis for axis in axes if axis != name]
    return Figure(
        key="pieces",
        title=f"{' and '.join(measures).capitalize()} over all values of {name}: {subject}",
        caption=sentences(
            [
                f"Thick lines: the pieces of the interval of {name} on which the map of {subject} is the same, found "
                "exactly and not by trial.",
                f"One line for each combination of {', '.join(others)}." if others else "",
                _best_words(pieces, name),
                "The paper has no such figure; its Figs 9 and 10 are samples of it.",
            ]
        ),
        alt=f"Step lines of {' and '.join(_MEASURES[measure] for measure in measures)} over {name} from "
        f"{value_text(min(pieces['exact_from'].to_list()))} to {value_text(max(pieces['exact_to'].to_list()))}, in "
        f"{counted(len(pieces), 'piece')}.",
        chart=alt.hconcat(*(_panel(pieces, name, others, measure) for measure in measures), spacing=36),
        data=pieces.select(*others, "exact_from", "exact_to", "nodes", "silhouette"),
    )


def _panel(pieces: pl.DataFrame, name: str, others: Sequence[str], measure: str) -> Chart:
    rows = [
        {
            "line": ", ".join(f"{other} = {value_text(row[other])}" for other in others),
            "from": row["exact_from"],
            "to": row["exact_to"],
            "value": row[measure],
        }
        for row in pieces.drop_nulls(measure).iter_rows(named=True)
    ]
    lines = list(dict.fromkeys(row["line"] for row in rows))
    legend = alt.Legend(orient="bottom", symbolType="stroke", symbolSize=700, symbolStrokeWidth=3) if others else None
    colors = list(islice(cycle(NODE_COLORS), len(lines)))
    low, high = min(pieces["exact_from"].to_list()), max(pieces["exact_to"].to_list())
    base = alt.Chart(alt.InlineData(values=rows)).encode(
        x=alt.X("from:Q", title=name).scale(domain=[low, high], nice=False),
        y=alt.Y("value:Q", title=_MEASURES[measure]).scale(zero=measure == "nodes", padding=8),
        color=alt.Color("line:N", title=None, legend=legend).scale(domain=lines, range=colors),
    )
    steps = base.mark_line(interpolate="step-after", strokeWidth=0.8)
    held = base.mark_rule(strokeWidth=3.5, strokeCap="butt").encode(x2="to:Q")
    return alt.layer(steps, held).properties(width=370, height=240)


def _best_words(pieces: pl.DataFrame, name: str) -> str:
    scored = pieces.drop_nulls("silhouette").sort("silhouette", descending=True, maintain_order=True)
    if scored.is_empty():
        return ""
    best: Mapping[str, Any] = scored.row(0, named=True)
    found = f"{decimals(best['silhouette'])} with {counted(best['nodes'], 'node')}"
    return (
        f"The highest silhouette is {found}, for {name} from "
        f"{value_text(best['exact_from'])} to {value_text(best['exact_to'])}; it is picked with the ground truth."
    )
