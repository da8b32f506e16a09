"""The gate over the number of nodes (the paper's Fig. 5), and the time of every step (its Figs S1 and S2)."""

from __future__ import annotations

import altair as alt
import numpy as np
import polars as pl

from omnieval.mapping.roman2020.conditions import gate_threshold
from omnieval.palette import BATCH, CONTROL, OURS
from omnieval.report.figure import Figure, Skipped
from omnieval.report.published import is_papers
from omnieval.report.sources import Replay
from omnieval.results.tables import read_steps
from omnieval.wording import counted, sentences

_MOST_NODES = 14
"""How far the gate is drawn at least; the paper's figure ends there."""
_WINDOW = 51
"""Steps of the running median."""


def gate_figure(replay: Replay) -> Figure | Skipped:
    """Return x(C) over the number C of active nodes, with the steps the replay spent at each."""
    visited = visited_gates(replay)
    if visited.is_empty():
        return Skipped("The gate x over the number of nodes", "no step of this replay compared an image with a node")
    omega = float(replay.config.mapper.settings["omega"])
    last = max(_MOST_NODES, *visited["nodes"].to_list())
    line = [{"nodes": count, "x": gate_threshold(omega, count)} for count in range(1, last + 1)]
    scale = alt.Scale(zero=False, padding=12)
    curve = alt.Chart(alt.InlineData(values=line)).mark_line(color=BATCH, strokeWidth=2)
    curve = curve.encode(
        x=alt.X("nodes:Q", title="active nodes C").axis(tickMinStep=1), y=alt.Y("x:Q", title="x", scale=scale)
    )
    points = alt.Chart(alt.InlineData(values=visited.to_dicts())).encode(x="nodes:Q", y="x:Q")
    dots = points.mark_point(filled=True, color=OURS, opacity=1, shape="diamond")
    dots = dots.encode(size=alt.Size("steps:Q", title="steps").scale(range=[60, 420], domainMin=0))
    numbers = points.mark_text(dy=-18, fontSize=11).encode(text="steps:Q")
    return Figure(
        key="gate",
        title="The gate x over the number of nodes",
        caption=sentences(
            [
                f"Line: x(C) = max(Ω, 3.05 − 0.15 C) with Ω = {omega:g}; larger closes loops more easily.",
                "Diamonds: where this replay was, with the number of steps it spent there.",
                "Corresponds to Fig. 5 of the paper.",
            ]
        ),
        alt=f"Falling line of the gate x over the number of active nodes, level at {omega:g}. The replay was at "
        + ", ".join(f"{row['nodes']} ({counted(row['steps'], 'step')})" for row in visited.iter_rows(named=True))
        + ".",
        chart=alt.layer(curve, dots, numbers).properties(width=640, height=240),
        data=visited,
    )


def visited_gates(replay: Replay) -> pl.DataFrame:
    """Return how many steps met each number of active nodes, and the x they had: nodes, x, steps."""
    asked = [one for step, _ in read_steps(replay.steps, ()) if (one := step.compared("node"))]
    rows = pl.DataFrame(
        {"nodes": [len(one.of) for one in asked], "x": [one.threshold for one in asked]},
        schema={"nodes": pl.Int64, "x": pl.Float64},
    )
    return rows.group_by("nodes").agg(pl.col("x").first(), pl.len().alias("steps")).sort("nodes")


def time_figure(replay: Replay) -> Figure | Skipped:
    """Return the time of every step and its running median."""
    title = "Time per step"
    data = step_times(replay.steps)
    if data.is_empty():
        return Skipped(title, "no times were recorded")
    times = data["ms"].to_numpy()
    top = float(np.quantile(times, 0.995)) * 1.1
    outside = int((times > top).sum())
    base = alt.Chart(alt.InlineData(values=data.select("image", "ms", "median").to_dicts())).encode(
        x=alt.X("image:Q", title="image").scale(domain=[0, len(data)], nice=False).axis(tickCount=10)
    )
    y = alt.Scale(domain=[0, top], nice=False)
    raw = base.mark_line(color=CONTROL, strokeWidth=0.6, clip=True).encode(y=alt.Y("ms:Q", title="time (ms)", scale=y))
    median = base.mark_line(color=OURS, strokeWidth=2.2, clip=True).encode(y="median:Q")
    return Figure(
        key="time",
        title=title,
        caption=sentences(
            [
                "Thin: how long the mapper took for each image, without reading and describing it.",
                f"Thick: the median of the {_WINDOW} steps around.",
                f"Median {np.median(times):.2f} ms, slowest {times.max():.1f} ms.",
                f"{counted(outside, 'step')} beyond the upper edge." if outside else "",
                "The replay records the time of the whole step, not of its parts.",
                "Corresponds to Figs S1 and S2 of the paper; its times are of another computer."
                if is_papers(replay)
                else "",
            ]
        ),
        alt=f"Line of the time per step over {counted(len(data), 'image')} with its running median, which goes from "
        f"{data['median'][0]:.2f} to {data['median'][-1]:.2f} milliseconds.",
        chart=alt.layer(raw, median).properties(width=800, height=220),
        data=data,
    )


def step_times(steps: pl.DataFrame) -> pl.DataFrame:
    """Return image, ms and running median (ms) of the steps whose time is known."""
    median = pl.col("milliseconds").rolling_median(_WINDOW, center=True, min_samples=1)
    known = steps.drop_nulls("milliseconds")
    return known.select(
        pl.col("frame").cast(pl.Int64).alias("image"),
        pl.col("milliseconds").round(4).alias("ms"),
        median.round(4).alias("median"),
    )
