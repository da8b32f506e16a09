"""Two runs over the same images in one recording: both maps, both decisions, and where they differ.

It is made of the tables alone. Nodes of the second run have the colours of those nodes of the first with which they
share the most images.
"""

from __future__ import annotations

import uuid
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from omnieval.errors import ResultError
from omnieval.explain.decision import Decision
from omnieval.explain.run import RunExplainer
from omnieval.mapping.config import MapperConfig
from omnieval.mapping.partition import Partition
from omnieval.mapping.step import Step
from omnieval.recording import layout
from omnieval.recording.blueprint import lanes, map_view, name_parts, whole_run
from omnieval.recording.evidence import numbered, why_rows
from omnieval.recording.overview import Overview
from omnieval.recording.rows import Row, Scalar, State, Words
from omnieval.recording.stream import Stream
from omnieval.recording.styles import lane_state, room_states, styles
from omnieval.recording.window import Extent, extent_of
from omnieval.results.compare import Agreement, matched_nodes
from omnieval.results.run_folder import Run

APPLICATION_ID = "omnieval-diff"

_ROOTS = ("/a", "/b")
_LANES = (f"{layout.LANES}/a", f"{layout.LANES}/b")
_LANE_AGREEMENT = f"{layout.LANES}/difference"
_SERIES = (
    ("a", "A", 0x4CA3FFFF),
    ("b", "B", 0xFFD166FF),
)
_STATES = {
    (True, True): ("same", 0x2B3138FF),
    (True, False): ("other partition", 0xC4B56CFF),
    (False, True): ("other verdict", 0xFF9F40FF),
    (False, False): ("other verdict and partition", 0xFFEA46FF),
}
"""What the lane of differences shows, by whether verdict and partition are the same."""


def record_pair(path: Path, one: Run, other: Run, agreement: Agreement) -> Path:
    """Write one recording of two runs, over the steps that both have, and return where it is.

    Raises
    ------
    ResultError
        If the recording cannot be written.
    """
    runs = (one, other)
    count = len(agreement.verdicts)
    extent = extent_of(one.steps.select("x", "y").to_numpy())
    stream = Stream(
        path,
        recording_id=str(uuid.uuid4()),
        blueprint=_blueprint(count, runs, extent),
        application_id=APPLICATION_ID,
    )
    try:
        stream.name(f"{one.folder.name} | {other.folder.name}", {"a": str(one.folder), "b": str(other.folder)})
        sides = _record_steps(stream, runs, agreement)
        rooms = one.steps["room"].drop_nulls().unique(maintain_order=True).to_list()
        stream.static(layout.LANE_ROOM, lambda: room_states(rooms))
        _log_styles(stream, count, extent, matched_nodes(*(side.labels for side in sides)))
    finally:
        stream.close()
    if stream.failure:
        raise ResultError(f"cannot write {path}: {stream.failure}")
    return path


class _Side:
    """One of the two runs, followed step by step."""

    def __init__(self, root: str, lane: str, config: MapperConfig) -> None:
        self._root = root
        self._lane = lane
        self._config = config
        self._partition = Partition()
        self._overview = Overview()
        self._state: str | None = None

    @property
    def labels(self) -> NDArray[np.int64]:
        """Node of every image so far."""
        return self._partition.labels

    def rows(self, step: Step, decided: Decision) -> list[tuple[str, Row]]:
        """Return what the map, the page and the lane of this run show at a step."""
        self._partition.apply(step)
        rows = [*self._overview.rows(decided, self._partition), *why_rows(decided, self._config)]
        found = [(self._root + entity, row) for entity, row in rows if entity != layout.GRAPH]
        state = lane_state(step.node)
        if state != self._state:
            self._state = state
            found.append((self._lane, State(state)))
        return found


def _record_steps(stream: Stream, runs: tuple[Run, Run], agreement: Agreement) -> list[_Side]:
    explainers = [RunExplainer(run) for run in runs]
    sides = [
        _Side(root, lane, explainer.config) for root, lane, explainer in zip(_ROOTS, _LANES, explainers, strict=True)
    ]
    before: tuple[bool, bool] | None = None
    room: str | None = None
    decided_alike = zip(agreement.verdicts.tolist(), agreement.partitions.tolist(), strict=True)
    # The longer run goes on alone after the last shared step.
    for same, both in zip(decided_alike, zip(*(one.decisions() for one in explainers), strict=False), strict=False):
        decisions = [decided for _, decided in both]
        capture = decisions[0].capture
        stream.begin(capture.frame, capture.time_ns)
        for side, (step, decided) in zip(sides, both, strict=True):
            stream.add(side.rows(step, decided))
        stream.add([(layout.LOG_DECISION, _words(decisions, same=all(same))), *_plot_rows(decisions, sides)])
        if same != before:
            before = same
            stream.add([(_LANE_AGREEMENT, State(_STATES[same][0]))])
        if capture.room != room:
            room = capture.room
            stream.add([(layout.LANE_ROOM, State(room or ""))])
    return sides


def _words(decisions: list[Decision], *, same: bool) -> Words:
    """Say in short what both decided; the pages say why."""
    texts = [_in_short(decided) for decided in decisions]
    both = f"both {texts[0]}" if same and texts[0] == texts[1] else " | ".join(texts)
    level, color = ("INFO", layout.GREY_TEXT_COLOR) if same else ("WARN", layout.REFUSED_COLOR)
    return Words(numbered(decisions[0].capture.frame, both), level, color)


def _in_short(decided: Decision) -> str:
    return decided.verdict.value if decided.node is None else f"{decided.verdict.value}, node {decided.node}"


def _plot_rows(decisions: list[Decision], sides: list[_Side]) -> list[tuple[str, Row]]:
    rows: list[tuple[str, Row]] = []
    for (name, _, _), decided, side in zip(_SERIES, decisions, sides, strict=True):
        match = decided.match
        ratio = match.prominence_ratio if match is not None and np.isfinite(match.prominence_ratio) else np.nan
        rows.append((f"{layout.PLOT_PROMINENCE}/{name}", Scalar(ratio)))
        rows.append((f"{layout.PLOT_NODES}/{name}", Scalar(float(decided.active + decided.pending))))
        rows.append((f"{layout.PLOT_QUALITY}/{name}", Scalar(float((side.labels == 0).mean()))))
    return rows


def _log_styles(stream: Stream, count: int, extent: Extent | None, partners: Mapping[int, int]) -> None:
    """Log how everything is drawn; the nodes of the second run as their partners in the first."""
    nodes = range(layout.most_nodes(count) + 1)
    own = [layout.node_color(node) for node in nodes]
    partnered = [layout.node_color(partners.get(node, node + len(nodes) if node else 0)) for node in nodes]
    for root, lane, colors in zip(_ROOTS, _LANES, (own, partnered), strict=True):
        for entity, value in styles(count, extent):
            if entity.startswith(f"{layout.MAP}/") or entity == layout.WHY:
                stream.static(root + entity, value)
        states = [lane_state(node) for node in nodes]
        stream.static(root + layout.MAP, _annotations(states, colors))
        stream.static(lane, rr.StateConfiguration(values=states, colors=np.array(colors, np.uint32)))
    shown = rr.StateConfiguration(
        values=[name for name, _ in _STATES.values()],
        colors=np.array([color for _, color in _STATES.values()], np.uint32),
    )
    stream.static(_LANE_AGREEMENT, shown)
    for plot in (layout.PLOT_PROMINENCE, layout.PLOT_NODES, layout.PLOT_QUALITY):
        for name, label, color in _SERIES:
            stream.static(f"{plot}/{name}", rr.SeriesLines(colors=color, names=label, widths=1.2))


def _annotations(states: list[str], colors: list[int]) -> rr.AnnotationContext:
    numbered = enumerate(zip(states, colors, strict=True))
    return rr.AnnotationContext(
        [rr.AnnotationInfo(id=node, label=label, color=color) for node, (label, color) in numbered]
    )


def _blueprint(steps: int, runs: tuple[Run, Run], extent: Extent | None) -> rrb.Blueprint:
    names = [f"{letter}: {run.folder.name}" for letter, run in zip("AB", runs, strict=True)]
    maps = [map_view(f"{name} (pending in brackets)", extent, root) for name, root in zip(names, _ROOTS, strict=True)]
    pages = [
        rrb.TextDocumentView(origin=root + layout.WHY, name=f"Why, {name}")
        for name, root in zip(names, _ROOTS, strict=True)
    ]
    plots = [
        rrb.TimeSeriesView(origin=origin, name=name, axis_x=whole_run(steps), plot_legend=rrb.PlotLegend("LeftTop"))
        for origin, name in (
            (layout.PLOT_PROMINENCE, "Prominence / mean"),
            (layout.PLOT_NODES, "Nodes"),
            (layout.PLOT_QUALITY, "Share unassigned"),
        )
    ]
    columns = rrb.TextLogColumns(timeline_columns=[layout.STEP], text_log_columns=["LogLevel", "Body"])
    root = rrb.Vertical(
        rrb.Horizontal(*maps),
        rrb.Horizontal(*pages),
        rrb.Horizontal(*plots),
        rrb.Horizontal(
            lanes(steps, names=("Nodes and differences near the step", "Whole run"), first=1),
            rrb.TextLogView(origin=layout.LOG, name="Decisions: A | B", columns=columns),
        ),
        row_shares=[0.38, 0.20, 0.14, 0.28],
    )
    name_parts(root, "diff")
    return rrb.Blueprint(
        root,
        rrb.BlueprintPanel(state="hidden"),
        rrb.SelectionPanel(state="hidden"),
        rrb.TimePanel(timeline=layout.STEP, play_state="paused", state="collapsed"),
        auto_views=False,
        auto_layout=False,
    )
