"""How a recording is shown: one layout for all, made for a 1600 x 1000 screen."""

from __future__ import annotations

import uuid
from typing import Literal

import rerun as rr
import rerun.blueprint as rrb

from omnieval.recording import layout
from omnieval.recording.window import Extent, map_window

Play = Literal["paused", "following"]
"""Whether the viewer waits to be led through a file, or goes along with a replay."""

_LANES = ("Lanes near the step", "Whole run")
_NAMESPACE = uuid.uuid5(uuid.NAMESPACE_OID, layout.APPLICATION_ID)


def build_blueprint(
    steps: int,
    gamma: float,
    extent: Extent | None = None,
    *,
    play: Play = "paused",
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
        rrb.Horizontal(_pictures(), _places(extent), _reasons(), column_shares=[0.32, 0.38, 0.30]),
        _plots(steps, gamma),
        rrb.Horizontal(lanes(steps, play, names=_LANES), _words(), column_shares=[0.55, 0.45]),
        row_shares=[0.55, 0.16, 0.29],
    )
    name_parts(root, "root")
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
        rrb.Spatial2DView(origin=layout.BEST_MATCH, name="Best match, turned; blank without candidate"),
        rrb.Spatial2DView(origin=layout.OMNIDIRECTIONAL, name="Omnidirectional image"),
        row_shares=[0.31, 0.31, 0.38],
    )


def map_view(name: str, extent: Extent | None, root: str = "") -> rrb.View:
    """Return the view of a map whose entities stand under `root`: the trail, and all loop closures so far."""
    trail = rrb.VisibleTimeRanges(
        timeline=layout.STEP,
        start=rrb.TimeRangeBoundary.cursor_relative(seq=-layout.TRAIL_STEPS),
        end=rrb.TimeRangeBoundary.cursor_relative(),
    )
    so_far = rrb.VisibleTimeRanges(
        timeline=layout.STEP,
        start=rrb.TimeRangeBoundary.infinite(),
        end=rrb.TimeRangeBoundary.cursor_relative(),
    )
    return rrb.Spatial2DView(
        origin=root + layout.MAP,
        name=name,
        overrides={
            root + layout.MAP_TRAIL: [trail],
            root + layout.MAP_ACCEPTED: [so_far],
            root + layout.MAP_REFUSED: [so_far, rrb.EntityBehavior(visible=False)],
        },
        background=rrb.Background(color=layout.BACKGROUND_COLOR),
        visual_bounds=_bounds(extent),
    )


def _places(extent: Extent | None) -> rrb.Container:
    graph = rrb.GraphView(
        origin=layout.GRAPH,
        name="Topological graph",
        force_link=rrb.archetypes.ForceLink(distance=48.0),
        force_many_body=rrb.archetypes.ForceManyBody(strength=-60.0),
        force_collision_radius=rrb.archetypes.ForceCollisionRadius(enabled=True, strength=1.0),
        force_position=rrb.archetypes.ForcePosition(enabled=True, strength=0.03, position=(0.0, 0.0)),
    )
    return rrb.Vertical(map_view("Map (pending nodes in brackets)", extent), graph, row_shares=[0.64, 0.36])


def _reasons() -> rrb.Container:
    """Return what was decided and why: in words, and as the curves and gates behind them."""
    return rrb.Vertical(
        rrb.TextDocumentView(origin=layout.WHY, name="Why"),
        rrb.Tabs(
            _bars(layout.SIMILARITY, "Similarity"),
            _bars(layout.POSITION, "Position"),
            _bars(layout.ORIENTATION, "Orientation"),
            active_tab=0,
        ),
        _bars(layout.GATE, "Gate ratio of each node; x is the band"),
        row_shares=[0.50, 0.25, 0.25],
    )


def _plots(steps: int, gamma: float) -> rrb.Container:
    """Return the numbers over the whole run; what has to be reached is orange, what was missed yellow."""
    prominence = rrb.ScalarAxis(range=(0.0, max(4.0 * gamma, 1.0)))
    margin = _plot(layout.PLOT_MARGIN, "Relative margin", steps, rrb.ScalarAxis(range=(0.0, 0.5)))
    gate = _plot(layout.PLOT_GATE, "Gate ratio", steps, rrb.ScalarAxis(range=(0.0, 6.0)))
    quality = _plot(layout.PLOT_QUALITY, "Quality", steps, rrb.ScalarAxis(range=(-1.0, 1.0)), legend=True)
    nodes = _plot(layout.PLOT_NODES, "Nodes", steps, legend=True)
    return rrb.Horizontal(
        _plot(layout.PLOT_PROMINENCE, "Prominence / mean, gamma, missed", steps, prominence),
        _plot(layout.PLOT_CENTROID, "Centroid shift, bound", steps),
        rrb.Tabs(margin, gate, active_tab=0),
        rrb.Tabs(quality, nodes, _plot(layout.PLOT_COST, "Cost, ms", steps), active_tab=0),
        column_shares=[0.28, 0.22, 0.24, 0.26],
    )


def lanes(steps: int, play: Play = "paused", *, names: tuple[str, str], first: int = 0) -> rrb.Container:
    """Return the lanes twice, under `names`: near the step, to be read, and of the whole run, as a pattern.

    The one of number `first` is shown until the other is chosen.
    """
    near = rrb.StateTimelineView(origin=layout.LANES, name=names[0], time_view=_near_the_step(play))
    run = rrb.StateTimelineView(origin=layout.LANES, name=names[1], time_view=whole_run(steps))
    return rrb.Tabs(near, run, active_tab=first)


def _words() -> rrb.Container:
    columns = rrb.TextLogColumns(timeline_columns=[layout.STEP], text_log_columns=["LogLevel", "Body"])
    log = rrb.TextLogView(origin=layout.LOG, name="Decisions and events", columns=columns)
    page = rrb.TextDocumentView(origin=layout.PAGE, name="Configuration and metrics")
    return rrb.Tabs(log, page, active_tab=0)


def _bars(origin: str, name: str) -> rrb.View:
    return rrb.BarChartView(origin=origin, name=name, plot_legend=rrb.PlotLegend(visible=False))


def _plot(origin: str, name: str, steps: int, axis: rrb.ScalarAxis | None = None, *, legend: bool = False) -> rrb.View:
    return rrb.TimeSeriesView(
        origin=origin,
        name=name,
        axis_x=whole_run(steps),
        axis_y=axis,
        plot_legend=rrb.PlotLegend("LeftBottom", visible=legend),
    )


def whole_run(steps: int) -> rrb.TimeAxis:
    """Return the time axis that shows all steps of a run."""
    return rrb.TimeAxis(
        view_range=rr.TimeRange(
            start=rr.TimeRangeBoundary.absolute(seq=0), end=rr.TimeRangeBoundary.absolute(seq=steps)
        )
    )


def _near_the_step(play: Play) -> rrb.TimeAxis:
    """Return the time axis that moves with the step; ahead of a replay that is followed there is nothing yet."""
    ahead = 2 if play == "following" else layout.NEAR_STEPS
    return rrb.TimeAxis(
        view_range=rr.TimeRange(
            start=rr.TimeRangeBoundary.cursor_relative(seq=ahead - 2 * layout.NEAR_STEPS),
            end=rr.TimeRangeBoundary.cursor_relative(seq=ahead),
        )
    )


def _bounds(extent: Extent | None) -> rrb.VisualBounds2D | None:
    """Return where the map view looks: all capture positions and the legend; y grows downwards on the screen."""
    if extent is None:
        return None
    window = map_window(extent)
    return rrb.VisualBounds2D(x_range=(window.x_min, window.x_max), y_range=(-window.y_max, -window.y_min))


def name_parts(part: rrb.Container | rrb.View, path: str) -> None:
    """Give every part an id that depends on its place alone, so that equal runs have equal blueprints."""
    part.id = uuid.uuid5(_NAMESPACE, path)
    for index, child in enumerate(getattr(part, "contents", ()) if isinstance(part, rrb.Container) else ()):
        name_parts(child, f"{path}/{index}")
