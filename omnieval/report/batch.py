"""Batch clustering over the number of clusters, beside the incremental map (the paper's Figs 11 and 12)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import cycle, islice
from typing import Any

import altair as alt
import polars as pl

from omnieval.palette import BATCH, CONTROL, INK, OURS
from omnieval.report.figure import Chart, Figure
from omnieval.report.sources import Baseline, Replay
from omnieval.wording import decimals, sentences

KS = tuple(range(2, 41))
"""The paper's numbers of clusters."""
SPECTRAL = "batch spectral"
SLICES = "equal time slices"
_DASHES = ([1, 0], [6, 3], [2, 2], [8, 3, 2, 3], [4, 4])
_COLORS = (BATCH, CONTROL, INK, "#009e73", "#a0522d")


@dataclass(frozen=True)
class Curves:
    """Silhouettes over the number of clusters, and where they come from.

    Attributes
    ----------
    table
        One row per method and number of clusters: method, k, silhouette (null where there is none).
    origin
        A sentence.
    """

    table: pl.DataFrame
    origin: str


def computed(curve: pl.DataFrame) -> Curves:
    """Return what `evidence.batch_curve` found."""
    spectral = curve.select(pl.lit(SPECTRAL).alias("method"), "k", "silhouette")
    slices = curve.select(pl.lit(SLICES).alias("method"), "k", pl.col("time_slices").alias("silhouette"))
    return Curves(
        pl.concat([spectral, slices]), "Computed for this report from the position descriptors of the replay."
    )


def recorded(baselines: Sequence[Baseline]) -> Curves:
    """Return what baseline folders hold."""
    tables = [
        baseline.table.drop_nulls("k").select(
            pl.lit(method_name(baseline)).alias("method"), pl.col("k").cast(pl.Int64), "silhouette"
        )
        for baseline in baselines
    ]
    names = ", ".join(baseline.name for baseline in baselines)
    return Curves(pl.concat(tables).unique(["method", "k"], keep="first", maintain_order=True), f"Taken from {names}.")


def method_name(baseline: Baseline) -> str:
    """Return how a baseline is called in figures and tables."""
    method, similarity = baseline.table.select("method", "similarity").row(0)
    name = SPECTRAL if method == "spectral" else SLICES if method == "time-slices" else str(method)
    return name if similarity in {None, "gaussian-median"} else f"{name}, {similarity}"


def batch_figure(curves: Curves, replays: Sequence[Replay], subject: str) -> Figure:
    """Return silhouettes over k with each replay at its number of nodes.

    Parameters
    ----------
    curves
        The batch methods.
    replays
        Finished replays of the same images; those without silhouette are left out.
    subject
        Dataset and descriptor, in words.
    """
    methods = curves.table["method"].unique(maintain_order=True).to_list()
    data = curves.table.drop_nulls("silhouette")
    ks = data["k"].to_list()
    marks: list[dict[str, Any]] = [
        {"method": "incremental", "k": replay.nodes, "silhouette": silhouette}
        for replay in replays
        if (silhouette := replay.metrics.get("silhouette")) is not None
    ]
    return Figure(
        key="batch",
        title=f"Batch clustering over the number of clusters: {subject}",
        caption=sentences(
            [
                f"Lines: {', '.join(methods)}, which see all images at once or none.",
                _mark_words(marks, curves),
                curves.origin,
                "Corresponds to Figs 11 and 12 of the paper.",
            ]
        ),
        alt=f"Lines of the silhouette over the number of clusters for {', '.join(methods)}, k from "
        f"{min(ks)} to {max(ks)}. "
        + " ".join(f"The incremental map lies at {mark['k']}, {decimals(mark['silhouette'])}." for mark in marks),
        chart=_chart(data, methods, marks),
        data=pl.concat([data, pl.DataFrame(marks, schema=data.schema)]) if marks else data,
    )


def batch_at(curves: Curves, nodes: int) -> float | None:
    """Return the silhouette of batch spectral clustering with this many clusters, None if it was not computed."""
    found = curves.table.filter((pl.col("method") == SPECTRAL) & (pl.col("k") == nodes))
    return None if found.is_empty() else found["silhouette"][0]


def _chart(data: pl.DataFrame, methods: Sequence[str], marks: Sequence[dict[str, Any]]) -> Chart:
    legend = alt.Legend(orient="bottom", symbolType="stroke", symbolSize=700, symbolStrokeWidth=2)
    dashes = list(islice(cycle(_DASHES), len(methods)))
    colors = list(islice(cycle(_COLORS), len(methods)))
    base = alt.Chart(alt.InlineData(values=data.to_dicts())).encode(
        x=alt.X("k:Q", title="number of clusters k").scale(zero=False, nice=False, padding=14).axis(tickMinStep=1),
        y=alt.Y("silhouette:Q", title="silhouette").scale(zero=False, padding=24),
        color=alt.Color("method:N", title=None).scale(domain=methods, range=colors).legend(legend),
        strokeDash=alt.StrokeDash("method:N", title=None).scale(domain=methods, range=dashes).legend(legend),
    )
    own = alt.Chart(alt.InlineData(values=list(marks))).encode(x="k:Q", y="silhouette:Q")
    layers = [
        base.mark_line(strokeWidth=1.8),
        base.mark_point(filled=True, size=14, opacity=1),
        own.mark_point(filled=True, shape="diamond", size=190, color=OURS, opacity=1),
        own.mark_text(align="left", dx=12, fontSize=12, fontWeight="bold").encode(text="method:N"),
    ]
    return alt.layer(*layers).properties(width=720, height=300)


def _mark_words(marks: Sequence[dict[str, Any]], curves: Curves) -> str:
    if not marks:
        return ""
    (first, *_) = marks
    beside = batch_at(curves, first["k"])
    other = "" if beside is None else f"; batch spectral clustering has {decimals(beside)} there"
    return f"Diamond: the incremental map, {decimals(first['silhouette'])} with {first['k']} nodes{other}."
