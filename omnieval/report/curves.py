"""The similarity curves of one step (the paper's Fig. 6)."""

from __future__ import annotations

from typing import Any

import altair as alt
import numpy as np
import polars as pl
from numpy.typing import NDArray
from scipy.signal import find_peaks

from omnieval.explain.words import decision_text
from omnieval.mapping.step import Curves, Step
from omnieval.palette import BATCH, INK, MUTED, OURS
from omnieval.report.figure import Chart, Figure
from omnieval.report.published import is_papers
from omnieval.report.sources import Replay
from omnieval.wording import counted, sentences

_WIDTH, _HEIGHT = 800, 120


def curves_figure(replay: Replay, step: Step, labels: NDArray[np.int64], *, chosen: bool) -> Figure:
    """Return the similarity curves of a step over all images of the map.

    Parameters
    ----------
    replay
        The replay.
    step, labels
        The step with its curves, and the labels it saw, shape (step,).
    chosen
        Whether the reader asked for this step.
    """
    curves, match = step.curves, step.match
    assert curves is not None
    assert match is not None
    data = curve_rows(curves, labels)
    borders = node_borders(labels)
    # What the best image is chosen by stands below what it is made of.
    names = [*list(curves.values)[1:], *list(curves.values)[:1]]
    panels = [_panel(data, borders, name, top=name == names[0], bottom=name == names[-1]) for name in names]
    peaks = int(data["peak"].sum())
    return Figure(
        key="similarity",
        title=f"Similarity curves of step {step.frame}",
        caption=sentences(
            [
                f"How similar image {step.frame} is to each image of the map, in the order of nodes and then time; "
                "vertical lines separate the nodes, whose numbers stand above.",
                f"Images of nodes that refused it ({_refused_words(curves, labels, borders)}) have similarity 0.",
                f"The diamond is the best match, image {match.frame} of node {match.node}; dots are the "
                f"{counted(peaks, 'peak')} of {names[-1]}.",
                f"Decision: {decision_text(step, replay.method)}.",
                "" if chosen else "This step was chosen because it is the loop closure with the most candidate images.",
                "Corresponds to Fig. 6 of the paper." if is_papers(replay) else "",
            ]
        ),
        alt=f"{len(names)} curves over {curves.size} images of the map in {counted(len(borders), 'node')}: "
        f"{', '.join(names)}. The last has {counted(peaks, 'peak')}; the highest is at image {match.frame} of node "
        f"{match.node}.",
        chart=alt.vconcat(*panels, spacing=8),
        data=data,
    )


def curve_rows(curves: Curves, labels: NDArray[np.int64]) -> pl.DataFrame:
    """Return one row per image of the map, in the order of the curve: where it stands, its node and similarities."""
    order = np.argsort(labels, kind="stable")
    order = order[labels[order] > 0]
    values = {name: _spread(curves, one) for name, one in curves.values.items()}
    peaks = np.zeros(curves.size, bool)
    peaks[find_peaks(np.pad(next(iter(values.values())), 1))[0] - 1] = True
    best = np.zeros(curves.size, bool)
    best[curves.slots[curves.best]] = True
    return pl.DataFrame(
        {"place": np.arange(curves.size), "node": labels[order], "image": order, **values, "peak": peaks, "best": best}
    )


def node_borders(labels: NDArray[np.int64]) -> list[dict[str, Any]]:
    """Return where each node begins and ends on the curve: node, start, end, middle."""
    nodes, sizes = np.unique(labels[labels > 0], return_counts=True)
    ends = np.cumsum(sizes)
    return [
        {"node": int(node), "start": int(end - size), "end": int(end), "middle": float(end - size / 2)}
        for node, size, end in zip(nodes, sizes, ends, strict=True)
    ]


def _panel(data: pl.DataFrame, borders: list[dict[str, Any]], name: str, *, top: bool, bottom: bool) -> Chart:
    rows = data.select("place", pl.col(name).alias("value"), "peak", "best").to_dicts()
    axis = alt.Axis(grid=False) if bottom else alt.Axis(grid=False, labels=False, title=None)
    x = alt.X("place:Q", title="image of the map, ordered by node, then time")
    x = x.scale(domain=[0, len(data)], nice=False).axis(axis)
    base = alt.Chart(alt.InlineData(values=rows)).encode(x=x, y=alt.Y("value:Q", title=name).axis(tickCount=3))
    lines = alt.Chart(alt.InlineData(values=borders)).mark_rule(color=MUTED, strokeWidth=0.7, strokeDash=[2, 2])
    layers: list[Any] = [lines.encode(x="start:Q"), base.mark_line(color=BATCH, strokeWidth=1.1)]
    if bottom:
        layers.append(base.mark_point(filled=True, color=INK, size=14, opacity=1).transform_filter("datum.peak"))
    best = base.mark_point(filled=True, color=OURS, size=110, shape="diamond", opacity=1)
    layers.append(best.transform_filter("datum.best"))
    if top:
        numbers = alt.Chart(alt.InlineData(values=borders)).encode(x="middle:Q", text="node:N", y=alt.value(-9))
        layers.append(numbers.mark_text(fontSize=11))
    return alt.layer(*layers).properties(width=_WIDTH, height=_HEIGHT)


def _spread(curves: Curves, values: NDArray[np.float64]) -> NDArray[np.float64]:
    curve = np.zeros(curves.size)
    curve[curves.slots] = values
    return curve


def _refused_words(curves: Curves, labels: NDArray[np.int64], borders: list[dict[str, Any]]) -> str:
    let_in = set(labels[curves.frames].tolist())
    refused = [str(border["node"]) for border in borders if border["node"] not in let_in]
    return f"here: {', '.join(refused)}" if refused else "here there are none"
