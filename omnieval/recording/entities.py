"""What a recording is made of: names that never change, whatever the dataset and the parameters.

Rerun matches blueprints and recordings by application id and entity path, so a constant layout for all runs of one
mapper is what lets two replays be opened side by side. Plots, bars and curves are those that the mapper declares; what
else varies stands in the recording's name and properties.
"""

from __future__ import annotations

import re

import rerun as rr

from omnieval.mapping.interface import Gate, Method

APPLICATION = "omnieval"

STEP = "step"
CAPTURE = "capture"

PANORAMA = "/image/panorama"
OMNIDIRECTIONAL = "/image/omnidirectional"
BEST_MATCH = "/image/best_match"

CURVES = "/curve"
BARS = "/bars"
PASSING = f"{BARS}/passing"
REFUSED = f"{BARS}/refused"
BAND = f"{BARS}/threshold"

PLOT_GATES = "/plot/gate"
PLOT_COLUMNS = "/plot/column"
PLOT_MARGIN = "/plot/margin"
PLOT_NODES = "/plot/nodes"
PLOT_QUALITY = "/plot/quality"
PLOT_COST = "/plot/cost"

MAP = "/map"
MAP_IMAGES = "/map/images"
MAP_RECENT = "/map/recent"
MAP_TRANSITIONS = "/map/transitions"
MAP_NODES = "/map/nodes"
MAP_NUMBERS = "/map/numbers"
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
"""How many steps the lanes near the step show on either side: each state is then wide enough for its name."""


def application_id(method: Method) -> str:
    """Return what Rerun matches blueprints by: one for all runs of a mapper."""
    return f"{APPLICATION} {re.sub(r'[^A-Za-z0-9_-]', '-', method.name)}"


def curve(name: str) -> str:
    """Return where a similarity curve is: `curve` and `best` image, and the `threshold` the first has to reach."""
    return f"{CURVES}/{rr.escape_entity_path_part(name)}"


def gate_plot(gate: Gate) -> str:
    """Return where the plot of a gate is: `value` and `threshold`, and in the first one what was `missed`."""
    return f"{PLOT_GATES}/{rr.escape_entity_path_part(gate.name)}"


def bar_gate(method: Method) -> Gate | None:
    """Return the gate that compares an image with every node, the first one if there are several."""
    return next((gate for gate in method.gates if gate.of == "node" and gate.closes), None)


def plotted_gates(method: Method) -> list[Gate]:
    """Return the gates that are plotted: first those behind the gate of the bars, which say more than the bars.

    Missed loop closures are marked in the plot of the first.
    """
    nodes = bar_gate(method)
    before = () if nodes is None else method.gates[: method.gates.index(nodes) + 1]
    return sorted((gate for gate in method.gates if gate.plot_to is not None), key=lambda gate: gate in before)


def column_plot(name: str) -> str:
    """Return where the plot of a column is."""
    return f"{PLOT_COLUMNS}/{rr.escape_entity_path_part(name)}"


def capital(text: str) -> str:
    """Return a text as it begins a title."""
    return text[:1].upper() + text[1:]
