"""What a recording is made of: names that never change, whatever the dataset and the parameters.

Rerun matches blueprints and recordings by application id and entity path, so a constant layout is what lets
two replays be opened side by side. What varies stands in the recording's name and properties.
"""

from __future__ import annotations

from omnieval import palette

APPLICATION_ID = "omnieval"

STEP = "step"
CAPTURE = "capture"

PANORAMA = "/image/panorama"
OMNIDIRECTIONAL = "/image/omnidirectional"
BEST_MATCH = "/image/best_match"

SIMILARITY = "/curve/similarity"
POSITION = "/curve/position"
ORIENTATION = "/curve/orientation"
GATE = "/gate"
CURVE = "curve"
BEST = "best"
THRESHOLD = "threshold"
CANDIDATES = "candidates"
REFUSED = "refused"

PLOT_GATE = "/plot/gate"
PLOT_PROMINENCE = "/plot/prominence"
MISSED = "/plot/prominence/missed"
PLOT_CENTROID = "/plot/centroid"
PLOT_MARGIN = "/plot/margin"
PLOT_NODES = "/plot/nodes"
PLOT_QUALITY = "/plot/quality"
PLOT_COST = "/plot/cost"

MAP = "/map"
MAP_IMAGES = "/map/images"
MAP_RECENT = "/map/recent"
MAP_TRANSITIONS = "/map/transitions"
MAP_NODES = "/map/nodes"
MAP_TRAIL = "/map/trail"
MAP_MATCH = "/map/match"
MAP_ACCEPTED = "/map/loop_closures/accepted"
MAP_REFUSED = "/map/loop_closures/refused"
MAP_LEGEND = "/map/legend"
MAP_SCALE = "/map/scale"
MAP_ROBOT = "/map/robot"
MAP_HEADING = "/map/heading"

GRAPH = "/graph"

LANES = "/lanes"
LANE_DECISION = "/lanes/decision"
LANE_NODE = "/lanes/node"
LANE_FINAL = "/lanes/node_final"
LANE_ROOM = "/lanes/room"

LOG = "/log"
LOG_DECISION = "/log/decision"
LOG_EVENT = "/log/event"

WHY = "/why"
PAGE = "/page"

TRAIL_STEPS = 60
"""How far back the robot's trail reaches on the map."""
NEAR_STEPS = 40
"""How far the lanes near the step reach, either side: each state is then wide enough for its name."""

SERIES: dict[str, tuple[str, int]] = {
    f"{PLOT_GATE}/nearest": ("nearest node's gate ratio", 0x4CA3FFFF),
    f"{PLOT_GATE}/x": ("x", 0xFF9F40FF),
    f"{PLOT_PROMINENCE}/ratio": ("prominence / mean", 0x4CA3FFFF),
    f"{PLOT_PROMINENCE}/gamma": ("gamma", 0xFF9F40FF),
    f"{PLOT_CENTROID}/shift": ("shift of the centroid", 0x4CA3FFFF),
    f"{PLOT_CENTROID}/bound": ("bound", 0xFF9F40FF),
    f"{PLOT_MARGIN}/value": ("margin", 0xC792EAFF),
    f"{PLOT_NODES}/active": ("active nodes", 0x5CCB7AFF),
    f"{PLOT_NODES}/pending": ("pending nodes", 0xFF9F40FF),
    f"{PLOT_QUALITY}/silhouette": ("silhouette so far", 0x5CCB7AFF),
    f"{PLOT_QUALITY}/unassigned": ("share unassigned", 0xFF9F40FF),
    f"{PLOT_COST}/milliseconds": ("ms a step", 0x9AA4AEFF),
}
"""Every line of every plot over time: its label and its colour (0xRRGGBBAA)."""

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
"""How a loop closure is drawn by the true distance between its two images: up to so many metres, what the legend
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
"""Colours of the first rooms, as they come: Paul Tol's muted scheme, told apart by people of any colour vision, with
its indigo made lighter for the black ground."""


def node_color(node: int) -> int:
    """Return the colour of a node, 0xRRGGBBAA, which it has in reports as well; 0 stands for unassigned images."""
    return int(palette.node_color(node)[1:] + "FF", 16)


def room_color(index: int) -> int:
    """Return the colour of the room that comes as number `index`, 0xRRGGBBAA."""
    return ROOM_COLORS[index] if index < len(ROOM_COLORS) else node_color(index)


def most_nodes(steps: int) -> int:
    """Return a number of nodes that a replay of `steps` images cannot exceed (a node takes ten images or more)."""
    return min(1 + steps // 10, 0xFFFF)
