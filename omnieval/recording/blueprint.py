"""How a recording is shown: one layout for all, made for a 1600 x 1000 screen."""

from __future__ import annotations

import uuid
from typing import Literal

import rerun as rr
import rerun.blueprint as rrb

from omnieval.recording import layout

_NAMESPACE = uuid.uuid5(uuid.NAMESPACE_OID, layout.APPLICATION_ID)
_Corner = Literal["LeftTop", "LeftBottom"]

_MAP_ASPECT = 1.7
"""Width over height of the map view."""


def build_blueprint(
    steps: int,
    gamma: float,
    extent: tuple[float, float, float, float] | None = None,
    *,
    play: Literal["paused", "following"] = "paused",
) -> rrb.Blueprint:
    """Return the blueprint of a recording.

    Parameters
    ----------
    steps
        Number of images, the length of every plot over time.
    gamma
        The prominence condition's factor; sets the scale of its plot.
    extent
        (x min, y min, x max, y max) of the capture positions, metres; None without poses.
    play
        ``paused`` for a file; ``following`` for a replay that is watched while it runs.
    """
    root = rrb.Vertical(
        rrb.Horizontal(_pictures(), _places(extent), _curves(), column_shares=[0.36, 0.36, 0.28]),
        rrb.Horizontal(*_plots(steps, gamma)),
        rrb.Horizontal(_lanes(steps), _words(), column_shares=[0.55, 0.45]),
        row_shares=[0.60, 0.20, 0.20],
    )
    _name(root, "root")
    return rrb.Blueprint(
        root,
        rrb.BlueprintPanel(state="hidden"),
        rrb.SelectionPanel(state="hidden"),
        rrb.TimePanel(timeline=layout.STEP, play_state=play, state="collapsed"),
        auto_views=False,
        auto_layout=False,
    )


def _pictures() -> rrb.Container:
    return rrb.Vertical(
        rrb.Spatial2DView(origin=layout.PANORAMA, name="Panorama"),
        rrb.Spatial2DView(origin=layout.BEST_MATCH, name="Best match, turned by the shift"),
        rrb.Horizontal(
            rrb.Spatial2DView(origin=layout.OMNIDIRECTIONAL, name="Omnidirectional image"),
            _bars(layout.GATE, "Node gates against x"),
        ),
        row_shares=[0.29, 0.29, 0.42],
    )


def _places(extent: tuple[float, float, float, float] | None) -> rrb.Container:
    trail = rrb.VisibleTimeRanges(
        timeline=layout.STEP,
        start=rrb.TimeRangeBoundary.cursor_relative(seq=-layout.TRAIL_STEPS),
        end=rrb.TimeRangeBoundary.cursor_relative(),
    )
    view = rrb.Spatial2DView(
        origin=layout.MAP,
        name="Cluster map (pending nodes in brackets)",
        overrides={layout.MAP_TRAIL: [trail]},
        visual_bounds=_bounds(extent),
    )
    graph = rrb.GraphView(
        origin=layout.GRAPH,
        name="Topological graph",
        force_link=rrb.archetypes.ForceLink(distance=48.0),
        force_many_body=rrb.archetypes.ForceManyBody(strength=-60.0),
        force_collision_radius=rrb.archetypes.ForceCollisionRadius(enabled=True, strength=1.0),
        force_position=rrb.archetypes.ForcePosition(enabled=True, strength=0.03, position=(0.0, 0.0)),
    )
    return rrb.Vertical(view, graph, row_shares=[0.62, 0.38])


def _curves() -> rrb.Container:
    return rrb.Vertical(
        _bars(layout.SIMILARITY, "Similarity over the map: the peak must pass the band"),
        _bars(layout.POSITION, "Position similarity"),
        _bars(layout.ORIENTATION, "Orientation similarity"),
        row_shares=[0.44, 0.28, 0.28],
    )


def _plots(steps: int, gamma: float) -> list[rrb.View | rrb.Container]:
    prominence = rrb.ScalarAxis(range=(0.0, max(4.0 * gamma, 1.0)))
    margin = _plot(layout.PLOT_MARGIN, "Margin", steps, rrb.ScalarAxis(range=(0.0, 0.5)))
    gate = _plot(layout.PLOT_GATE, "Nearest gate against x", steps, rrb.ScalarAxis(range=(0.0, 6.0)))
    cost = _plot(layout.PLOT_COST, "Cost", steps)
    return [
        _plot(layout.PLOT_PROMINENCE, "Prominence against gamma", steps, prominence),
        _plot(layout.PLOT_CENTROID, "Centroid shift against bound", steps),
        rrb.Tabs(margin, gate, cost, active_tab=0),
        _plot(layout.PLOT_NODES, "Nodes", steps, legend="LeftTop"),
        _plot(layout.PLOT_QUALITY, "Quality so far", steps, rrb.ScalarAxis(range=(-1.0, 1.0)), legend="LeftBottom"),
    ]


def _lanes(steps: int) -> rrb.View:
    return rrb.StateTimelineView(
        origin=layout.LANES, name="Node as decided, in the final map, and room", time_view=_whole_run(steps)
    )


def _words() -> rrb.Container:
    columns = rrb.TextLogColumns(timeline_columns=[layout.STEP], text_log_columns=["LogLevel", "Body"])
    log = rrb.TextLogView(origin=layout.LOG, name="Decisions and events", columns=columns)
    page = rrb.TextDocumentView(origin=layout.PAGE, name="Configuration and metrics")
    return rrb.Tabs(log, page, active_tab=0)


def _bars(origin: str, name: str) -> rrb.View:
    return rrb.BarChartView(origin=origin, name=name, plot_legend=rrb.PlotLegend(visible=False))


def _plot(
    origin: str, name: str, steps: int, axis: rrb.ScalarAxis | None = None, *, legend: _Corner | None = None
) -> rrb.View:
    return rrb.TimeSeriesView(
        origin=origin,
        name=name,
        axis_x=_whole_run(steps),
        axis_y=axis,
        plot_legend=rrb.PlotLegend(legend, visible=legend is not None),
    )


def _whole_run(steps: int) -> rrb.TimeAxis:
    return rrb.TimeAxis(
        view_range=rr.TimeRange(
            start=rr.TimeRangeBoundary.absolute(seq=0), end=rr.TimeRangeBoundary.absolute(seq=steps)
        )
    )


def _bounds(extent: tuple[float, float, float, float] | None) -> rrb.VisualBounds2D | None:
    """Return where the map view looks: all capture positions with a margin; y grows downwards on the screen."""
    if extent is None:
        return None
    x_min, y_min, x_max, y_max = extent
    height = 1.1 * max(y_max - y_min, (x_max - x_min) / _MAP_ASPECT, 1.0)
    x, y, width = (x_min + x_max) / 2, -(y_min + y_max) / 2, height * _MAP_ASPECT
    return rrb.VisualBounds2D(x_range=(x - width / 2, x + width / 2), y_range=(y - height / 2, y + height / 2))


def _name(part: rrb.Container | rrb.View, path: str) -> None:
    """Give every part an id that depends on its place alone, so that equal runs have equal blueprints."""
    part.id = uuid.uuid5(_NAMESPACE, path)
    for index, child in enumerate(getattr(part, "contents", ()) if isinstance(part, rrb.Container) else ()):
        _name(child, f"{path}/{index}")
