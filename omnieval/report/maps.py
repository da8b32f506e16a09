"""The bird's-eye map at ten moments (the paper's Figs 13 to 15), and how nodes and silhouette went meanwhile."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import altair as alt
import numpy as np
import polars as pl
from numpy.typing import NDArray

from omnieval.metrics.silhouette import posed
from omnieval.palette import BATCH, INK, PAPER, node_color, node_shape
from omnieval.report.evidence import Moment, moments, positions_of, silhouette_or_none
from omnieval.report.figure import Chart, Figure, Skipped
from omnieval.report.published import is_papers
from omnieval.report.sources import Replay
from omnieval.wording import counted, decimals, ordinal, sentences

MOMENTS = 10
_MOST_IMAGES = 240
"""Images drawn in one panel; of more, every n-th."""
_PAGE_WIDTH = 940
_TALLEST = 260
_SAMPLES = 60
"""Moments at which the silhouette on the way is computed."""


def map_figure(replay: Replay) -> Figure | Skipped:
    """Return the map at ten moments."""
    title = "The map at ten moments"
    if not replay.posed:
        return Skipped(title, "the sequence has no poses, so there is no bird's-eye view")
    shown = _ten_moments(replay)
    positions = positions_of(replay.steps)
    located = int(posed(positions).sum())
    stride = -(-located // _MOST_IMAGES)
    panel = _Panel(positions, stride)
    charts = [
        panel.chart(moment, _panel_title(moment, len(positions), last), place, len(shown))
        for place, (moment, last) in enumerate(shown)
    ]
    final = shown[-1][0]
    nodes = np.unique(final.labels[final.labels > 0])
    return Figure(
        key="map",
        title=title,
        caption=sentences(
            [
                "Where the images were taken, in metres, coloured by the node they were in at that moment; nodes keep "
                "colour, shape and number throughout, and the number stands at the middle image of the node.",
                "Grey crosses belong to no node yet.",
                f"{located} of {len(positions)} images have a position." if located < len(positions) else "",
                f"Every {ordinal(stride)} image is drawn." if stride > 1 else "",
                _last_words(replay),
                "Corresponds to Figs 13 to 15 of the paper." if is_papers(replay) else "",
            ]
        ),
        alt=f"{len(charts)} maps of the same building, from {shown[0][0].frame + 1} to {len(positions)} images. "
        f"The number of nodes goes {', '.join(str(_nodes(moment)) for moment, _ in shown)}; "
        f"the last map has {counted(len(nodes), 'node')}.",
        chart=alt.concat(*charts, columns=panel.columns, spacing={"row": 14, "column": 18}),
        data=_node_rows(shown, positions),
    )


def progress_figure(replay: Replay) -> Figure:
    """Return the number of nodes, and the silhouette where there are positions, while the map grows."""
    frames = sorted(set(np.linspace(0, len(replay.steps) - 1, _SAMPLES).astype(int).tolist()))
    positions = positions_of(replay.steps) if replay.posed else None
    chosen = [moment for moment in moments(replay) if moment.frame in frames]
    data = pl.DataFrame(
        {
            "image": [moment.frame for moment in chosen],
            "nodes": [_nodes(moment) for moment in chosen],
            "active": [len(moment.active) for moment in chosen],
            "silhouette": [_silhouette(moment, positions) for moment in chosen],
        },
        schema={"image": pl.Int64, "nodes": pl.Int64, "active": pl.Int64, "silhouette": pl.Float64},
    )
    base = alt.Chart(alt.InlineData(values=data.to_dicts())).encode(
        x=alt.X("image:Q", title="image").scale(domain=[0, len(replay.steps)], nice=False).axis(tickCount=10)
    )
    count = base.mark_line(interpolate="step-after", color=BATCH, strokeWidth=2)
    panels = [count.encode(y=alt.Y("nodes:Q", title="nodes").axis(tickMinStep=1)).properties(width=760, height=130)]
    known = data["silhouette"].null_count() < len(data)
    if known:
        line = base.mark_line(color=INK, strokeWidth=1.5).encode(y=alt.Y("silhouette:Q", title="silhouette"))
        panels.append(line.properties(width=760, height=130))
    return Figure(
        key="progress",
        title=f"Number of nodes{' and silhouette' if known else ''} while the map grows",
        caption=sentences(
            [
                "Above: nodes of the map after each image, active and pending.",
                "Below: the silhouette of the images placed so far, over their true positions." if known else "",
                "Leftover images are not placed before the end, so the last value is not that of the final map.",
                "The paper has no such figure.",
            ]
        ),
        alt=f"Step line of the number of nodes over the image, ending at {data['nodes'][-1]}"
        + (f", and a line of the silhouette, ending at {decimals(data['silhouette'][-1] or 0)}." if known else "."),
        chart=alt.vconcat(*panels),
        data=data,
    )


class _Panel:
    """One small map; all have the same metres for a pixel in both directions."""

    def __init__(self, positions: NDArray[np.float64], stride: int) -> None:
        self._positions = positions
        self._drawn = np.flatnonzero(posed(positions))[::stride]
        low, high = np.nanmin(positions, axis=0), np.nanmax(positions, axis=0)
        margin = 0.04 * max(float((high - low).max()), 1.0)
        self._low, self._high = low - margin, high + margin
        across, up = (self._high - self._low).tolist()
        self.columns = 2 if across > up else 5
        scale = min((_PAGE_WIDTH / self.columns - 60) / across, _TALLEST / up)
        self._width, self._height = scale * across, scale * up

    def chart(self, moment: Moment, title: str, place: int, places: int) -> Chart:
        """Return the map at a moment; axes have their titles at the left and at the bottom only."""
        x_title = "x (m)" if place >= places - self.columns else None
        y_title = "y (m)" if place % self.columns == 0 else None
        until = self._drawn[self._drawn < len(moment.labels)].tolist()
        rows = [self._row(frame, int(moment.labels[frame])) for frame in until]
        middles = [
            self._row(_middle(frames, self._positions), node)
            for node, frames in _members(moment.labels, self._positions)
            if node
        ]
        images = self._encoded(rows, x_title, y_title).mark_point(filled=True, size=30, opacity=0.9)
        images = images.encode(
            color=alt.Color("color:N", scale=None), shape=alt.Shape("shape:N", scale=None, legend=None)
        )
        numbers = self._encoded(middles, x_title, y_title).encode(text="node:N")
        halo = numbers.mark_text(fontSize=13, fontWeight="bold", stroke=PAPER, strokeWidth=4, fill=PAPER)
        ink = numbers.mark_text(fontSize=13, fontWeight="bold", fill=INK)
        return alt.layer(images, halo, ink).properties(title=title, width=self._width, height=self._height)

    def _encoded(self, rows: Sequence[dict[str, Any]], x_title: str | None, y_title: str | None) -> alt.Chart:
        domains = zip(self._low.tolist(), self._high.tolist(), strict=True)
        x, y = (alt.Scale(domain=list(domain), nice=False, zero=False) for domain in domains)
        return alt.Chart(alt.InlineData(values=list(rows))).encode(
            x=alt.X("x:Q", title=x_title, scale=x).axis(tickCount=5, grid=False),
            y=alt.Y("y:Q", title=y_title, scale=y).axis(tickCount=4, grid=False),
        )

    def _row(self, frame: int, node: int) -> dict[str, Any]:
        x, y = self._positions[frame].tolist()
        return {
            "frame": frame,
            "x": round(x, 3),
            "y": round(y, 3),
            "node": node,
            "color": node_color(node),
            "shape": node_shape(node),
        }


def _ten_moments(replay: Replay) -> list[tuple[Moment, bool]]:
    """Return ten moments evenly over the sequence, and whether each is the final map."""
    count = len(replay.steps)
    frames = {max(1, round(count * part / MOMENTS)) - 1 for part in range(1, MOMENTS + 1)}
    chosen = [moment for moment in moments(replay) if moment.frame in frames]
    if not replay.finished:
        return [(moment, False) for moment in chosen]
    final = replay.steps["node_final"].fill_null(0).cast(pl.Int64).to_numpy()
    return [*((moment, False) for moment in chosen[:-1]), (Moment(count - 1, final, chosen[-1].active), True)]


def _panel_title(moment: Moment, images: int, last: bool) -> str:
    when = "final map" if last else f"{round(100 * (moment.frame + 1) / images)} %"
    return f"{when}: {moment.frame + 1} images, {counted(_nodes(moment), 'node')}"


def _last_words(replay: Replay) -> str:
    if replay.finished:
        return "The last is the final map, with the leftover images of broken runs placed as the replay ends."
    return f"The replay is {replay.status}, so there is no final map."


def _nodes(moment: Moment) -> int:
    return len(np.unique(moment.labels[moment.labels > 0]))


def _silhouette(moment: Moment, positions: NDArray[np.float64] | None) -> float | None:
    return None if positions is None else silhouette_or_none(positions[: len(moment.labels)], moment.labels)


def _members(labels: NDArray[np.int64], positions: NDArray[np.float64]) -> Iterator[tuple[int, NDArray[np.int64]]]:
    """Yield every node, 0 for none, that has images with a position, and these."""
    known = posed(positions[: len(labels)])
    for node in np.unique(labels[known]).tolist():
        yield node, np.flatnonzero(known & (labels == node))


def _middle(frames: NDArray[np.int64], positions: NDArray[np.float64]) -> int:
    """Return the one of some images that is nearest to the median of their positions."""
    center = np.median(positions[frames], axis=0)
    return int(frames[np.argmin(np.linalg.norm(positions[frames] - center, axis=1))])


def _node_rows(shown: Sequence[tuple[Moment, bool]], positions: NDArray[np.float64]) -> pl.DataFrame:
    rows = []
    for moment, last in shown:
        for node, frames in _members(moment.labels, positions):
            x, y = np.median(positions[frames], axis=0).tolist()
            rows.append(
                {
                    "after image": moment.frame,
                    "map": "final" if last else "so far",
                    "node": node or None,
                    "images": int((moment.labels == node).sum()),
                    "median x (m)": x,
                    "median y (m)": y,
                }
            )
    return pl.DataFrame(rows, infer_schema_length=None)
