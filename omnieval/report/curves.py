"""The similarity curves of one step (the paper's Fig. 6)."""

from __future__ import annotations

from typing import Any

import altair as alt
import numpy as np
import polars as pl
from numpy.typing import NDArray
from scipy.signal import find_peaks

from omnieval.mapping.step import Match
from omnieval.palette import BATCH, INK, MUTED, OURS
from omnieval.report.figure import Chart, Figure
from omnieval.report.sources import Replay
from omnieval.wording import counted, sentences

_WIDTH, _HEIGHT = 800, 120
_PANELS = {
    "position": "position similarity",
    "orientation": "orientation similarity",
    "product": "product",
}


def curves_figure(replay: Replay, step: int, match: Match, labels: NDArray[np.int64], *, chosen: bool) -> Figure:
    """Return position, orientation and product of the similarities over all images of the map.

    Parameters
    ----------
    replay
        The replay.
    step, match, labels
        The step, its image-level loop closure, and the labels it saw, shape (step,).
    chosen
        Whether the reader asked for this step.
    """
    row = replay.steps.row(step, named=True)
    data = curve_rows(match, labels)
    borders = node_borders(labels)
    panels = [_panel(data, borders, name, top=name == "position") for name in _PANELS]
    peaks = int(data["peak"].sum())
    return Figure(
        key="similarity",
        title=f"Similarity curves of step {step}",
        caption=sentences(
            [
                f"How similar image {step} is to each image of the map, in the order of nodes and then time; vertical "
                "lines part the nodes, whose numbers stand above.",
                f"Images of nodes that are no candidates ({_refused_words(row, borders)}) have similarity 0.",
                f"The diamond is the best match, image {match.best_frame} of node {match.node}; dots are the "
                f"{counted(peaks, 'peak')} of the product, against whose mean its prominence is measured: "
                f"{match.prominence_ratio:.2f} times the mean, γ = {replay.config.mapper.gamma:g}.",
                f"Verdict: {row['verdict']}.",
                "" if chosen else "This step was chosen because it is the loop closure with the most candidate images.",
                "Corresponds to Fig. 6 of the paper.",
            ]
        ),
        alt=f"Three curves over {match.map_size} images of the map in {counted(len(borders), 'node')}: position "
        f"similarity, orientation similarity and their product. The product has {counted(peaks, 'peak')}; the "
        f"highest is at image {match.best_frame} of node {match.node}.",
        chart=alt.vconcat(*panels, spacing=8),
        data=data,
    )


def curve_rows(match: Match, labels: NDArray[np.int64]) -> pl.DataFrame:
    """Return one row an image of the map, in the order of the curve: where it stands, its node and similarities."""
    order = np.argsort(labels, kind="stable")
    order = order[labels[order] > 0]
    product = _spread(match, match.similarity)
    peaks = np.zeros(match.map_size, bool)
    peaks[find_peaks(np.pad(product, 1))[0] - 1] = True
    best = np.zeros(match.map_size, bool)
    best[match.slots[match.best]] = True
    return pl.DataFrame(
        {
            "place": np.arange(match.map_size),
            "node": labels[order],
            "image": order,
            "position": _spread(match, match.position),
            "orientation": _spread(match, match.orientation),
            "product": product,
            "peak": peaks,
            "best": best,
        }
    )


def node_borders(labels: NDArray[np.int64]) -> list[dict[str, Any]]:
    """Return where each node begins and ends on the curve: node, start, end, middle."""
    nodes, sizes = np.unique(labels[labels > 0], return_counts=True)
    ends = np.cumsum(sizes)
    return [
        {"node": int(node), "start": int(end - size), "end": int(end), "middle": float(end - size / 2)}
        for node, size, end in zip(nodes, sizes, ends, strict=True)
    ]


def _panel(data: pl.DataFrame, borders: list[dict[str, Any]], name: str, *, top: bool) -> Chart:
    rows = data.select("place", pl.col(name).alias("value"), "peak", "best").to_dicts()
    bottom = name == "product"
    axis = alt.Axis(grid=False) if bottom else alt.Axis(grid=False, labels=False, title=None)
    x = alt.X("place:Q", title="image of the map, ordered by node, then time")
    x = x.scale(domain=[0, len(data)], nice=False).axis(axis)
    base = alt.Chart(alt.InlineData(values=rows)).encode(x=x, y=alt.Y("value:Q", title=_PANELS[name]).axis(tickCount=3))
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


def _spread(match: Match, values: NDArray[np.float64]) -> NDArray[np.float64]:
    curve = np.zeros(match.map_size)
    curve[match.slots] = values
    return curve


def _refused_words(row: dict[str, Any], borders: list[dict[str, Any]]) -> str:
    refused = [str(border["node"]) for border in borders if border["node"] not in row["candidates"]]
    return f"here: {', '.join(refused)}" if refused else "here there are none"
