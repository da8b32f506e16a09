"""How everything in a recording is drawn: colours, and static data that is logged once."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import rerun as rr

from omnieval import palette
from omnieval.mapping.interface import Method
from omnieval.mapping.step import Role
from omnieval.recording import entities
from omnieval.recording.entities import gate_plot, plotted_gates
from omnieval.recording.viewport import Extent, map_window

Style = rr.AsComponents | list[rr.DescribedComponentBatch]

UNASSIGNED = "unassigned"
MARKDOWN = rr.TextDocument.from_fields(media_type=rr.MediaType.MARKDOWN)
"""Of pages whose text comes step by step."""

WHITE = 0xFFFFFFFF
BACKGROUND_COLOR = 0x0D1011FF
"""Of the map, whose colours are made for it: the viewer is bright where the desktop is."""
GREY_TEXT_COLOR = 0x8B949EFF
"""To be read on a dark and on a bright ground."""
UNASSIGNED_COLOR = 0x8B949EFF
ACCEPTED_COLOR = 0x5CCB7AFF
REFUSED_COLOR = 0xFF9F40FF
MISSED_COLOR = 0xFFEA46FF
PENDING_COLOR = 0xE5D352FF
EVENT_COLOR = 0x4CA3FFFF
FAINT_COLOR = 0xB9C2CC60
CURVE_COLOR = 0x6FA8DCFF
BEST_COLOR = 0xFF5A5AFF
BAND_COLOR = 0xFF9F4048

CLOSURES: tuple[tuple[float, str, int, float], ...] = (
    (0.5, "closure < 0.5 m", 0x5B77B8FF, 1.0),
    (1.0, "< 1 m", 0x8C8F99FF, 1.5),
    (3.0, "< 3 m", 0xC4B56CFF, 2.0),
    (float("inf"), "> 3 m: wrong", 0xFFEA46FF, 2.5),
)
"""How a loop closure is drawn by the true distance between its two images: up to this many metres, what the legend
says, colour, line width. The colours are cividis, which people of any colour vision see as a scale from dark to bright;
the darkest is lighter than there, to stand out from a black background."""

ROOM_COLORS = (
    0x88CCEEFF,
    0xCC6677FF,
    0x44AA99FF,
    0xDDCC77FF,
    0xAA4499FF,
    0x117733FF,
    0x6656B5FF,
    0x999933FF,
    0x882255FF,
)
"""Colours of the first rooms, as they come: Paul Tol's muted scheme, distinguished by people of any colour vision, with
its indigo made lighter for the black ground."""

VALUE_COLOR = 0x4CA3FFFF
MEASURED_COLOR = 0xC792EAFF

ROLE_COLORS = {
    Role.FOUNDING: GREY_TEXT_COLOR,
    Role.JOINED: ACCEPTED_COLOR,
    Role.PENDING: PENDING_COLOR,
    Role.REFUSED: REFUSED_COLOR,
    Role.UNASSIGNED: REFUSED_COLOR,
}
"""Colours of decisions, in the log and on the map."""

OUTCOME_COLORS = {
    "founding": 0x4A5058FF,
    "closed": 0x5B77B8FF,
    "pending": 0x7F7A4AFF,
    "refused": 0x2B3138FF,
    "unassigned": 0x3A4048FF,
    "missed": MISSED_COLOR,
}
"""Colours of the lane of decisions, dark to bright by how much they ask to be looked at."""

SERIES = {
    f"{entities.PLOT_MARGIN}/value": ("margin", MEASURED_COLOR),
    f"{entities.PLOT_NODES}/active": ("active nodes", ACCEPTED_COLOR),
    f"{entities.PLOT_NODES}/pending": ("pending nodes", REFUSED_COLOR),
    f"{entities.PLOT_QUALITY}/silhouette": ("silhouette so far", ACCEPTED_COLOR),
    f"{entities.PLOT_QUALITY}/unassigned": ("share unassigned", REFUSED_COLOR),
    f"{entities.PLOT_COST}/milliseconds": ("ms a step", 0x9AA4AEFF),
}
"""The lines of the plots over the run that every mapper has: label and colour (0xRRGGBBAA)."""


def series(method: Method) -> dict[str, tuple[str, int]]:
    """Return the lines of all plots over the run: those that the mapper declares, and those that every mapper has."""
    lines: dict[str, tuple[str, int]] = {}
    for gate in plotted_gates(method):
        lines[f"{gate_plot(gate)}/value"] = (gate.value, VALUE_COLOR)
        lines[f"{gate_plot(gate)}/threshold"] = (gate.threshold, REFUSED_COLOR)
    for column in method.columns:
        if column.plotted:
            lines[entities.column_plot(column.name)] = (column.meaning, MEASURED_COLOR)
    return lines | SERIES


def node_color(node: int) -> int:
    """Return the colour of a node, 0xRRGGBBAA, which it has in reports as well; 0 stands for unassigned images."""
    return int(palette.node_color(node)[1:] + "FF", 16)


def room_color(index: int) -> int:
    """Return the colour of the room that comes as number `index`, 0xRRGGBBAA."""
    return ROOM_COLORS[index] if index < len(ROOM_COLORS) else node_color(index)


def most_nodes(steps: int) -> int:
    """Return a number of nodes that a replay of `steps` images cannot exceed; classes have 16 bits."""
    return min(1 + steps, 0xFFFF)


def lane_state(node: int | None) -> str:
    """Return what a lane of nodes shows for a node, or for none (None or 0)."""
    return str(node) if node else UNASSIGNED


def styles(method: Method, steps: int, extent: Extent | None = None) -> Iterator[tuple[str, Style]]:
    """Yield how every entity of a recording of `steps` images is drawn; static data.

    With the `extent` of the capture positions the map has a legend and a scale.
    """
    yield from map_styles(steps, extent)
    nodes = range(most_nodes(steps) + 1)
    lane = state_style([lane_state(node) for node in nodes], [node_color(node) for node in nodes])
    yield entities.LANE_DECISION, state_style(list(OUTCOME_COLORS), list(OUTCOME_COLORS.values()))
    yield entities.LANE_NODE, lane
    yield entities.LANE_FINAL, lane
    yield entities.WHY, MARKDOWN
    bars = {entities.PASSING: ACCEPTED_COLOR, entities.REFUSED: UNASSIGNED_COLOR, entities.BAND: BAND_COLOR}
    for curve in map(entities.curve, method.curves):
        bars |= {f"{curve}/curve": CURVE_COLOR, f"{curve}/best": BEST_COLOR, f"{curve}/threshold": BAND_COLOR}
    for entity, color in bars.items():
        yield entity, _bar_color(color)
    for gate in plotted_gates(method)[:1]:
        marks = rr.SeriesPoints(colors=MISSED_COLOR, names="missed loop closure", marker_sizes=2.5)
        yield f"{gate_plot(gate)}/missed", marks
    for entity, (label, color) in series(method).items():
        yield entity, line_style(label, color)


def map_styles(steps: int, extent: Extent | None) -> Iterator[tuple[str, Style]]:
    """Yield how the map of a recording is drawn; see `styles`."""
    ui = rr.Radius.ui_points
    yield entities.MAP, node_classes([node_color(node) for node in range(most_nodes(steps) + 1)])
    yield entities.MAP_IMAGES, rr.Points2D.from_fields(radii=ui(3.0), show_labels=False, draw_order=10.0)
    yield entities.MAP_RECENT, rr.Points2D.from_fields(radii=ui(3.0), show_labels=False, draw_order=11.0)
    yield entities.MAP_TRANSITIONS, rr.LineStrips2D.from_fields(radii=ui(1.0), draw_order=20.0)
    yield entities.MAP_ACCEPTED, rr.LineStrips2D.from_fields(draw_order=25.0)
    yield entities.MAP_REFUSED, rr.LineStrips2D.from_fields(draw_order=24.0)
    yield entities.MAP_TRAIL, rr.LineStrips2D.from_fields(radii=ui(1.0), draw_order=30.0)
    yield entities.MAP_MATCH, rr.LineStrips2D.from_fields(radii=ui(1.5), draw_order=31.0)
    yield entities.MAP_NODES, rr.Points2D.from_fields(radii=ui(7.0), show_labels=False, draw_order=40.0)
    yield entities.MAP_NUMBERS, rr.Points2D.from_fields(radii=ui(0.5), colors=WHITE, show_labels=True, draw_order=41.0)
    yield entities.MAP_HEADING, rr.Arrows2D.from_fields(radii=ui(2.0), colors=WHITE, draw_order=50.0)
    robot = rr.Points2D.from_fields(radii=ui(5.0), colors=WHITE, show_labels=False, draw_order=51.0)
    yield entities.MAP_ROBOT, robot
    if extent is not None:
        yield entities.MAP_LEGEND, _legend(extent)
        yield entities.MAP_SCALE, _scale(extent)


def node_classes(colors: Sequence[int]) -> rr.AnnotationContext:
    """Return the colours of nodes on a map, by their numbers; 0 stands for unassigned images."""
    return rr.AnnotationContext(
        [rr.AnnotationInfo(id=node, label=lane_state(node), color=color) for node, color in enumerate(colors)]
    )


def state_style(states: Sequence[str], colors: Sequence[int]) -> rr.StateConfiguration:
    """Return the colours of the states of a lane."""
    return rr.StateConfiguration(values=list(states), colors=np.array(colors, np.uint32))


def line_style(label: str, color: int) -> rr.SeriesLines:
    """Return how a line of a plot is drawn."""
    return rr.SeriesLines(colors=color, names=label, widths=1.2)


def room_states(rooms: Sequence[str]) -> rr.StateConfiguration:
    """Return how the lane of rooms is drawn, each in a colour of its own."""
    return state_style(rooms, [room_color(index) for index in range(len(rooms))])


def _legend(extent: Extent) -> Style:
    """Return the legend of the loop closures' colours, in a row below the building."""
    return rr.Points2D(
        map_window(extent).legend(len(CLOSURES)) * (1.0, -1.0),
        labels=[label for _, label, _, _ in CLOSURES],
        colors=np.array([color for _, _, color, _ in CLOSURES], np.uint32),
        radii=rr.Radius.ui_points(5.0),
        show_labels=True,
    )


def _scale(extent: Extent) -> Style:
    """Return a line that is a round number of metres long."""
    length, ends = map_window(extent).scale()
    return rr.LineStrips2D(
        [ends * (1.0, -1.0)],
        labels=[f"{length:g} m"],
        colors=WHITE,
        radii=rr.Radius.ui_points(1.0),
        show_labels=True,
    )


def _bar_color(color: int) -> Style:
    """Return the colour of a chart by itself; `rr.BarChart.from_fields` wants values as well."""
    batch = rr.components.ColorBatch([color])
    return [rr.DescribedComponentBatch(batch, rr.BarChart.descriptor_color())]
