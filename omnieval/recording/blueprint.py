"""How a recording is shown: one layout for all, made for a 1600 x 1000 screen."""

from __future__ import annotations

import uuid
from typing import Literal

import rerun as rr
import rerun.blueprint as rrb

from omnieval.mapping.interface import Method
from omnieval.recording import entities
from omnieval.recording.entities import capital, gate_plot, plotted_gates
from omnieval.recording.node_places import GRAPH_BORDER, GRAPH_SIZE
from omnieval.recording.styles import BACKGROUND_COLOR
from omnieval.recording.viewport import Extent, map_window

Play = Literal["paused", "following"]
"""Whether the viewer waits to be led through a file, or goes along with a replay."""

_LANES = ("Lanes near the step", "Whole run")
_NAMESPACE = uuid.uuid5(uuid.NAMESPACE_OID, entities.APPLICATION)


def build_blueprint(
    method: Method, steps: int, extent: Extent | None = None, *, play: Play = "paused"
) -> rrb.Blueprint:
    """Return the blueprint of a recording.

    Parameters
    ----------
    method
        The mapper; its gates, columns and curves are shown.
    steps
        Number of images, the length of every plot over time.
    extent
        (x min, y min, x max, y max) of the capture positions, metres; None without poses.
    play
        ``paused`` for a file; ``following`` for a replay that is watched while it runs.
    """
    root = rrb.Vertical(
        rrb.Horizontal(_pictures(), _places(extent), _reasons(method), column_shares=[0.32, 0.38, 0.30]),
        _plots(method, steps),
        rrb.Horizontal(lanes(steps, play, names=_LANES), _words(), column_shares=[0.55, 0.45]),
        row_shares=[0.55, 0.16, 0.29],
    )
    return whole_window(root, "root", play)


def whole_window(root: rrb.Container, name: str, play: Play = "paused") -> rrb.Blueprint:
    """Return a blueprint that shows these views and no panels; `name` tells it from blueprints of another kind."""
    _name_parts(root, name)
    return rrb.Blueprint(
        root,
        rrb.BlueprintPanel(state="hidden"),
        rrb.SelectionPanel(state="hidden"),
        rrb.TimePanel(timeline=entities.STEP, play_state=play, state="collapsed"),
        auto_views=False,
        auto_layout=False,
    )


def _pictures() -> rrb.Container:
    return rrb.Vertical(
        rrb.Spatial2DView(origin=entities.PANORAMA, name="Panorama"),
        rrb.Spatial2DView(origin=entities.BEST_MATCH, name="Best match, turned; blank without candidate"),
        rrb.Spatial2DView(origin=entities.OMNIDIRECTIONAL, name="Omnidirectional image"),
        row_shares=[0.31, 0.31, 0.38],
    )


def map_view(name: str, extent: Extent | None, root: str = "") -> rrb.View:
    """Return the view of a map whose entities stand under `root`: the trail, and all loop closures so far."""
    trail = rrb.VisibleTimeRanges(
        timeline=entities.STEP,
        start=rrb.TimeRangeBoundary.cursor_relative(seq=-entities.TRAIL_STEPS),
        end=rrb.TimeRangeBoundary.cursor_relative(),
    )
    so_far = rrb.VisibleTimeRanges(
        timeline=entities.STEP,
        start=rrb.TimeRangeBoundary.infinite(),
        end=rrb.TimeRangeBoundary.cursor_relative(),
    )
    return rrb.Spatial2DView(
        origin=root + entities.MAP,
        name=name,
        overrides={
            root + entities.MAP_TRAIL: [trail],
            root + entities.MAP_ACCEPTED: [so_far],
            root + entities.MAP_REFUSED: [so_far, rrb.EntityBehavior(visible=False)],
        },
        background=rrb.Background(color=BACKGROUND_COLOR),
        visual_bounds=_bounds(extent),
    )


def _places(extent: Extent | None) -> rrb.Container:
    half_width, half_height = (size / 2 + GRAPH_BORDER for size in GRAPH_SIZE)
    graph = rrb.GraphView(
        origin=entities.GRAPH,
        name="Topological graph",
        visual_bounds=rrb.VisualBounds2D(x_range=(-half_width, half_width), y_range=(-half_height, half_height)),
    )
    return rrb.Vertical(map_view("Map (pending nodes in brackets)", extent), graph, row_shares=[0.64, 0.36])


def _reasons(method: Method) -> rrb.Container:
    """Return what was decided and why: in words, and as the curves and bars behind them."""
    parts: list[tuple[rrb.Container | rrb.View, float]] = [(rrb.TextDocumentView(origin=entities.WHY, name="Why"), 0.5)]
    if method.curves:
        curves = [_bars(entities.curve(name), capital(name)) for name in method.curves]
        parts.append((rrb.Tabs(*curves, active_tab=0), 0.25))
    if (gate := entities.bar_gate(method)) is not None:
        title = f"{capital(gate.value)} of each node; {gate.threshold} is the band"
        parts.append((_bars(entities.BARS, title), 0.25))
    return rrb.Vertical(*(part for part, _ in parts), row_shares=[share for _, share in parts])


def _plots(method: Method, steps: int) -> rrb.Container:
    """Return the numbers over the whole run; what has to be reached is orange, what was missed yellow.

    Two gates have room of their own.
    """
    gates = [
        plot(
            gate_plot(gate),
            f"{capital(gate.value)}, {gate.threshold}{'' if number else ', missed'}",
            steps,
            rrb.ScalarAxis(range=(0.0, gate.plot_to)) if gate.plot_to else None,
        )
        for number, gate in enumerate(plotted_gates(method))
    ]
    columns = [
        plot(entities.column_plot(one.name), f"{capital(one.meaning)}{one.unit and f', {one.unit}'}", steps)
        for one in method.columns
        if one.plotted
    ]
    margin = plot(entities.PLOT_MARGIN, "Relative margin", steps, rrb.ScalarAxis(range=(0.0, 0.5)))
    quality = plot(entities.PLOT_QUALITY, "Quality", steps, rrb.ScalarAxis(range=(-1.0, 1.0)), legend="LeftBottom")
    nodes = plot(entities.PLOT_NODES, "Nodes", steps, legend="LeftBottom")
    return rrb.Horizontal(
        *gates[:2],
        rrb.Tabs(margin, *gates[2:], *columns, active_tab=0),
        rrb.Tabs(quality, nodes, plot(entities.PLOT_COST, "Cost, ms", steps), active_tab=0),
        column_shares=[*(0.28, 0.22)[: len(gates)], 0.24, 0.26],
    )


def lanes(steps: int, play: Play = "paused", *, names: tuple[str, str], first: int = 0) -> rrb.Container:
    """Return the lanes twice, under `names`: near the step, to be read, and of the whole run, as a pattern.

    The one of number `first` is shown until the other is chosen.
    """
    near = rrb.StateTimelineView(origin=entities.LANES, name=names[0], time_view=_near_the_step(play))
    run = rrb.StateTimelineView(origin=entities.LANES, name=names[1], time_view=_whole_run(steps))
    return rrb.Tabs(near, run, active_tab=first)


def _words() -> rrb.Container:
    log = log_view("Decisions and events")
    page = rrb.TextDocumentView(origin=entities.PAGE, name="Configuration and metrics")
    return rrb.Tabs(log, page, active_tab=0)


def log_view(name: str) -> rrb.View:
    """Return the view of what was said at each step."""
    columns = rrb.TextLogColumns(timeline_columns=[entities.STEP], text_log_columns=["LogLevel", "Body"])
    return rrb.TextLogView(origin=entities.LOG, name=name, columns=columns)


def _bars(origin: str, name: str) -> rrb.View:
    return rrb.BarChartView(origin=origin, name=name, plot_legend=rrb.PlotLegend(visible=False))


def plot(
    origin: str,
    name: str,
    steps: int,
    axis: rrb.ScalarAxis | None = None,
    *,
    legend: Literal["LeftBottom", "LeftTop"] | None = None,
) -> rrb.View:
    """Return the view of lines over the whole run."""
    return rrb.TimeSeriesView(
        origin=origin,
        name=name,
        axis_x=_whole_run(steps),
        axis_y=axis,
        plot_legend=rrb.PlotLegend(legend or "LeftBottom", visible=legend is not None),
    )


def _whole_run(steps: int) -> rrb.TimeAxis:
    """Return the time axis that shows all steps of a run."""
    return rrb.TimeAxis(
        view_range=rr.TimeRange(
            start=rr.TimeRangeBoundary.absolute(seq=0), end=rr.TimeRangeBoundary.absolute(seq=steps)
        )
    )


def _near_the_step(play: Play) -> rrb.TimeAxis:
    """Return the time axis that moves with the step; ahead of a replay that is followed there is nothing yet."""
    ahead = 2 if play == "following" else entities.NEAR_STEPS
    return rrb.TimeAxis(
        view_range=rr.TimeRange(
            start=rr.TimeRangeBoundary.cursor_relative(seq=ahead - 2 * entities.NEAR_STEPS),
            end=rr.TimeRangeBoundary.cursor_relative(seq=ahead),
        )
    )


def _bounds(extent: Extent | None) -> rrb.VisualBounds2D | None:
    """Return where the map view looks: all capture positions and the legend; y grows downwards on the screen."""
    if extent is None:
        return None
    window = map_window(extent)
    return rrb.VisualBounds2D(x_range=(window.x_min, window.x_max), y_range=(-window.y_max, -window.y_min))


def _name_parts(part: rrb.Container | rrb.View, path: str) -> None:
    """Give every part an id that depends on its place alone, so that equal runs have equal blueprints."""
    part.id = uuid.uuid5(_NAMESPACE, path)
    for index, child in enumerate(getattr(part, "contents", ()) if isinstance(part, rrb.Container) else ()):
        _name_parts(child, f"{path}/{index}")
