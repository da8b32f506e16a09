"""Two runs over the same images in one recording: both maps, both decisions, and where they differ.

It is made of the tables alone. Nodes of the second run have the colours of those nodes of the first with which they
share the most images.
"""

from __future__ import annotations

import uuid
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import rerun.blueprint as rrb
from numpy.typing import NDArray

from omnieval.errors import ResultError
from omnieval.explain.run import RunExplainer
from omnieval.explain.scene import Scene
from omnieval.mapping.interface import Gate, Method
from omnieval.mapping.partition import Partition
from omnieval.recording import entities
from omnieval.recording.blueprint import lanes, log_view, map_view, plot, whole_window
from omnieval.recording.charts import subject_value
from omnieval.recording.entities import plotted_gates
from omnieval.recording.overview import Overview
from omnieval.recording.pages import numbered, why_row
from omnieval.recording.rerun_stream import Stream
from omnieval.recording.rows import Row, Scalar, State, Words
from omnieval.recording.styles import (
    GREY_TEXT_COLOR,
    MARKDOWN,
    REFUSED_COLOR,
    lane_state,
    line_style,
    map_styles,
    most_nodes,
    node_classes,
    node_color,
    room_states,
    state_style,
)
from omnieval.recording.viewport import Extent, Origin, around, extent_of, origin_of
from omnieval.results.atomic import replacing
from omnieval.results.compare import Agreement, matched_nodes
from omnieval.results.run_folder import Run

APPLICATION_ID = "omnieval-diff"

_ROOTS = ("/a", "/b")
_LANES = (f"{entities.LANES}/a", f"{entities.LANES}/b")
_PLOT_VALUE = "/plot/value"
_LANE_AGREEMENT = f"{entities.LANES}/difference"
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

    A file that is there is replaced when the new one is whole.

    Raises
    ------
    ResultError
        If the recording cannot be written.
    """
    runs = (one, other)
    count = len(agreement.verdicts)
    whole = extent_of(one.steps.select("x", "y").to_numpy())
    origin = origin_of(whole)
    extent = around(whole, origin)
    shown = next((gate for gate in plotted_gates(one.method) if gate in plotted_gates(other.method)), None)
    with replacing(path) as temporary:
        stream = Stream(
            temporary,
            application_id=APPLICATION_ID,
            recording_id=str(uuid.uuid4()),
            blueprint=_blueprint(count, runs, extent, shown),
        )
        try:
            stream.name(f"{one.folder.name} | {other.folder.name}", {"a": str(one.folder), "b": str(other.folder)})
            sides = _record_steps(stream, runs, agreement, shown, origin, extent)
            rooms = one.steps["room"].drop_nulls().unique(maintain_order=True).to_list()
            stream.static(entities.LANE_ROOM, lambda: room_states(rooms))
            _log_styles(stream, count, extent, matched_nodes(*(side.labels for side in sides)))
        finally:
            stream.close()
        if stream.failure:
            raise ResultError(f"cannot write {path}: {stream.failure}")
    return path


class _Side:
    """One of the two runs, followed step by step."""

    def __init__(self, root: str, lane: str, method: Method, origin: Origin, extent: Extent | None) -> None:
        self._root = root
        self._lane = lane
        self._method = method
        self._overview = Overview(origin, extent)
        self._state: str | None = None
        self.partition = Partition()

    @property
    def labels(self) -> NDArray[np.int64]:
        """Node of every image so far."""
        return self.partition.labels

    def rows(self, scene: Scene) -> list[tuple[str, Row]]:
        """Return what the map, the page and the lane of this run show at a step."""
        self.partition.apply(scene.step)
        rows = [*self._overview.rows(scene, self.partition), why_row(scene, self._method)]
        found = [(self._root + entity, row) for entity, row in rows if entity != entities.GRAPH]
        state = lane_state(scene.step.node)
        if state != self._state:
            self._state = state
            found.append((self._lane, State(state)))
        return found


def _record_steps(
    stream: Stream,
    runs: tuple[Run, Run],
    agreement: Agreement,
    shown: Gate | None,
    origin: Origin,
    extent: Extent | None,
) -> list[_Side]:
    explainers = [RunExplainer(run) for run in runs]
    sides = [
        _Side(root, lane, explainer.method, origin, extent)
        for root, lane, explainer in zip(_ROOTS, _LANES, explainers, strict=True)
    ]
    before: tuple[bool, bool] | None = None
    room: str | None = None
    decided_alike = zip(agreement.verdicts.tolist(), agreement.partitions.tolist(), strict=True)
    # The longer run goes on alone after the last shared step.
    for same, both in zip(decided_alike, zip(*(one.scenes() for one in explainers), strict=False), strict=False):
        image = both[0].image
        stream.begin(both[0].step.frame, image.time_ns)
        for side, scene in zip(sides, both, strict=True):
            stream.add(side.rows(scene))
        stream.add([(entities.LOG_DECISION, _words(both, same=all(same))), *_plot_rows(both, sides, shown)])
        if same != before:
            before = same
            stream.add([(_LANE_AGREEMENT, State(_STATES[same][0]))])
        if image.room != room:
            room = image.room
            stream.add([(entities.LANE_ROOM, State(room or ""))])
    return sides


def _words(both: Sequence[Scene], *, same: bool) -> Words:
    """Say in short what both decided; the pages say why."""
    texts = [_in_short(scene) for scene in both]
    said = f"both {texts[0]}" if same and texts[0] == texts[1] else " | ".join(texts)
    level, color = ("INFO", GREY_TEXT_COLOR) if same else ("WARN", REFUSED_COLOR)
    return Words(numbered(both[0].step.frame, said), level, color)


def _in_short(scene: Scene) -> str:
    step = scene.step
    return step.verdict if step.node is None else f"{step.verdict}, node {step.node}"


def _plot_rows(both: Sequence[Scene], sides: list[_Side], shown: Gate | None) -> list[tuple[str, Row]]:
    rows: list[tuple[str, Row]] = []
    for (name, _, _), scene, side in zip(_SERIES, both, sides, strict=True):
        values = {_PLOT_VALUE: _value(scene, shown), entities.PLOT_NODES: float(side.partition.count)}
        values[entities.PLOT_QUALITY] = side.partition.unassigned
        rows += [(f"{plot}/{name}", Scalar(value)) for plot, value in values.items()]
    return rows


def _value(scene: Scene, shown: Gate | None) -> float:
    """Return what a gate compared at a step, or without a gate the margin; NaN where there is none."""
    step = scene.step
    if shown is None:
        return np.nan if step.margin is None else step.margin.value
    one = step.compared(shown.name)
    value = np.nan if one is None else subject_value(step, one)
    return value if np.isfinite(value) else np.nan


def _log_styles(stream: Stream, count: int, extent: Extent | None, partners: Mapping[int, int]) -> None:
    """Log how everything is drawn; the nodes of the second run as their partners in the first."""
    nodes = range(most_nodes(count) + 1)
    own = [node_color(node) for node in nodes]
    partnered = [node_color(partners.get(node, node + len(nodes) if node else 0)) for node in nodes]
    for root, lane, colors in zip(_ROOTS, _LANES, (own, partnered), strict=True):
        for entity, value in map_styles(count, extent):
            stream.static(root + entity, node_classes(colors) if entity == entities.MAP else value)
        stream.static(root + entities.WHY, MARKDOWN)
        stream.static(lane, state_style([lane_state(node) for node in nodes], colors))
    names, shades = zip(*_STATES.values(), strict=True)
    stream.static(_LANE_AGREEMENT, state_style(names, shades))
    for plotted in (_PLOT_VALUE, entities.PLOT_NODES, entities.PLOT_QUALITY):
        for name, label, color in _SERIES:
            stream.static(f"{plotted}/{name}", line_style(label, color))


def _blueprint(steps: int, runs: tuple[Run, Run], extent: Extent | None, shown: Gate | None) -> rrb.Blueprint:
    names = [f"{letter}: {run.folder.name}" for letter, run in zip("AB", runs, strict=True)]
    maps = [map_view(f"{name} (pending in brackets)", extent, root) for name, root in zip(names, _ROOTS, strict=True)]
    pages = [
        rrb.TextDocumentView(origin=root + entities.WHY, name=f"Why, {name}")
        for name, root in zip(names, _ROOTS, strict=True)
    ]
    titles = {
        _PLOT_VALUE: "Relative margin" if shown is None else entities.capital(shown.value),
        entities.PLOT_NODES: "Nodes",
        entities.PLOT_QUALITY: "Share unassigned",
    }
    root = rrb.Vertical(
        rrb.Horizontal(*maps),
        rrb.Horizontal(*pages),
        rrb.Horizontal(*(plot(origin, title, steps, legend="LeftTop") for origin, title in titles.items())),
        rrb.Horizontal(
            lanes(steps, names=("Nodes and differences near the step", "Whole run"), first=1),
            log_view("Decisions: A | B"),
        ),
        row_shares=[0.38, 0.20, 0.14, 0.28],
    )
    return whole_window(root, "diff")
