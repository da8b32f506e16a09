"""How everything in a recording is drawn: static data, logged once."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import rerun as rr

from omnieval.recording import layout
from omnieval.recording.evidence import DECISION_COLORS
from omnieval.recording.window import Extent, map_window

Style = rr.AsComponents | list[rr.DescribedComponentBatch]

UNASSIGNED = "unassigned"


def lane_state(node: int | None) -> str:
    """Return what a lane of nodes shows for a node, or for none (None or 0)."""
    return str(node) if node else UNASSIGNED


def styles(steps: int, extent: Extent | None = None) -> list[tuple[str, Style]]:
    """Return how every entity of a recording of `steps` images is drawn; static data.

    With the `extent` of the capture positions the map has a legend and a scale.
    """
    nodes = range(layout.most_nodes(steps) + 1)
    colors = np.array([layout.node_color(node) for node in nodes], np.uint32)
    infos = [
        rr.AnnotationInfo(id=node, label=lane_state(node), color=int(color))
        for node, color in zip(nodes, colors, strict=True)
    ]
    lane = rr.StateConfiguration(values=[lane_state(node) for node in nodes], colors=colors)
    fixed: list[tuple[str, Style]] = [
        (layout.MAP, rr.AnnotationContext(infos)),
        (
            layout.LANE_DECISION,
            rr.StateConfiguration(
                values=list(DECISION_COLORS), colors=np.array(list(DECISION_COLORS.values()), np.uint32)
            ),
        ),
        (layout.LANE_NODE, lane),
        (layout.LANE_FINAL, lane),
        (f"{layout.GATE}/{layout.CANDIDATES}", _bar_color(layout.ACCEPTED_COLOR)),
        (f"{layout.GATE}/{layout.REFUSED}", _bar_color(layout.UNASSIGNED_COLOR)),
        (f"{layout.GATE}/{layout.THRESHOLD}", _bar_color(layout.BAND_COLOR)),
        (f"{layout.SIMILARITY}/{layout.THRESHOLD}", _bar_color(layout.BAND_COLOR)),
        *_map_styles(),
        (layout.MISSED, rr.SeriesPoints(colors=layout.MISSED_COLOR, names="missed loop closure", marker_sizes=2.5)),
        (layout.WHY, rr.TextDocument.from_fields(media_type=rr.MediaType.MARKDOWN)),
    ]
    for curve in (layout.SIMILARITY, layout.POSITION, layout.ORIENTATION):
        fixed.append((f"{curve}/{layout.CURVE}", _bar_color(layout.CURVE_COLOR)))
        fixed.append((f"{curve}/{layout.BEST}", _bar_color(layout.BEST_COLOR)))
    if extent is not None:
        fixed += [(layout.MAP_LEGEND, _legend(extent)), (layout.MAP_SCALE, _scale(extent))]
    for entity, (label, color) in layout.SERIES.items():
        fixed.append((entity, rr.SeriesLines(colors=color, names=label, widths=1.2)))
    return fixed


def room_states(rooms: Sequence[str]) -> rr.StateConfiguration:
    """Return how the lane of rooms is drawn, each in a colour of its own."""
    colors = [layout.room_color(index) for index in range(len(rooms))]
    return rr.StateConfiguration(values=list(rooms), colors=np.array(colors, np.uint32))


def _map_styles() -> list[tuple[str, Style]]:
    ui = rr.Radius.ui_points
    return [
        (layout.MAP_IMAGES, rr.Points2D.from_fields(radii=ui(3.0), show_labels=False, draw_order=10.0)),
        (layout.MAP_RECENT, rr.Points2D.from_fields(radii=ui(3.0), show_labels=False, draw_order=11.0)),
        (layout.MAP_TRANSITIONS, rr.LineStrips2D.from_fields(radii=ui(1.0), draw_order=20.0)),
        (layout.MAP_ACCEPTED, rr.LineStrips2D.from_fields(draw_order=25.0)),
        (layout.MAP_REFUSED, rr.LineStrips2D.from_fields(draw_order=24.0)),
        (layout.MAP_TRAIL, rr.LineStrips2D.from_fields(radii=ui(1.0), draw_order=30.0)),
        (layout.MAP_MATCH, rr.LineStrips2D.from_fields(radii=ui(1.5), draw_order=31.0)),
        (layout.MAP_NODES, rr.Points2D.from_fields(radii=ui(7.0), show_labels=True, draw_order=40.0)),
        (layout.MAP_HEADING, rr.Arrows2D.from_fields(radii=ui(2.0), colors=layout.WHITE, draw_order=50.0)),
        (
            layout.MAP_ROBOT,
            rr.Points2D.from_fields(radii=ui(5.0), colors=layout.WHITE, show_labels=False, draw_order=51.0),
        ),
    ]


def _legend(extent: Extent) -> Style:
    """Return the legend of the loop closures' colours, in a row below the building."""
    return rr.Points2D(
        map_window(extent).legend(len(layout.CLOSURES)) * (1.0, -1.0),
        labels=[label for _, label, _, _ in layout.CLOSURES],
        colors=np.array([color for _, _, color, _ in layout.CLOSURES], np.uint32),
        radii=rr.Radius.ui_points(5.0),
        show_labels=True,
    )


def _scale(extent: Extent) -> Style:
    """Return a line that is a round number of metres long."""
    length, ends = map_window(extent).scale()
    return rr.LineStrips2D(
        [ends * (1.0, -1.0)],
        labels=[f"{length:g} m"],
        colors=layout.WHITE,
        radii=rr.Radius.ui_points(1.0),
        show_labels=True,
    )


def _bar_color(color: int) -> Style:
    """Return the colour of a chart by itself; `rr.BarChart.from_fields` wants values as well."""
    batch = rr.components.ColorBatch([color])
    return [rr.DescribedComponentBatch(batch, rr.BarChart.descriptor_color())]
