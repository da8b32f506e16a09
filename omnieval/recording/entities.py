"""What a recording is made of: names that never change, whatever the dataset and the parameters.

Rerun matches blueprints and recordings by application id and entity path, so a constant layout for all runs of one
mapper is what lets two replays be opened side by side. Plots, bars and curves are those that the mapper declares; what
else varies stands in the recording's name and properties.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

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


def application_id(method: Method) -> str:
    """Return what Rerun matches blueprints by: one for all runs of a mapper."""
    return f"{APPLICATION} {re.sub(r'[^A-Za-z0-9_-]', '-', method.name)}"


@dataclass(frozen=True)
class CurveEntities:
    """Where a similarity curve is: its bars, its best image, and how high that must be."""

    root: str

    @staticmethod
    def of(name: str) -> CurveEntities:
        """Return where the curve of a name is."""
        return CurveEntities(f"{CURVES}/{rr.escape_entity_path_part(name)}")

    @property
    def curve(self) -> str:
        """The bars of all images."""
        return f"{self.root}/curve"

    @property
    def best(self) -> str:
        """The bar of the best one."""
        return f"{self.root}/best"

    @property
    def level(self) -> str:
        """The band it has to reach out of."""
        return f"{self.root}/threshold"


@dataclass(frozen=True)
class GatePlot:
    """The plot over the run of what a gate compares."""

    gate: Gate

    @property
    def root(self) -> str:
        """Where the plot is."""
        return f"{PLOT_GATES}/{rr.escape_entity_path_part(self.gate.name)}"

    @property
    def value(self) -> str:
        """The line of what was compared."""
        return f"{self.root}/value"

    @property
    def threshold(self) -> str:
        """The line of what it was compared with."""
        return f"{self.root}/threshold"

    @property
    def missed(self) -> str:
        """The marks of missed loop closures."""
        return f"{self.root}/missed"

    @property
    def title(self) -> str:
        """What is plotted, in words."""
        return f"{capital(self.gate.value)}, {self.gate.threshold}"


def bar_gate(method: Method) -> Gate | None:
    """Return the gate that compares an image with every node, the first one if there are several."""
    return next((gate for gate in method.gates if gate.of == "node" and gate.closes), None)


def gate_plots(method: Method) -> list[GatePlot]:
    """Return the plots of gates: first those behind the gate of the bars, which say more than the bars.

    Missed loop closures are marked in the first.
    """
    plotted = [gate for gate in method.gates if gate.plot_to is not None]
    nodes = bar_gate(method)
    first = method.gates.index(nodes) if nodes is not None else -1
    return [GatePlot(gate) for gate in sorted(plotted, key=lambda gate: method.gates.index(gate) <= first)]


def column_plot(name: str) -> str:
    """Return where the plot of a column is."""
    return f"{PLOT_COLUMNS}/{rr.escape_entity_path_part(name)}"


def capital(text: str) -> str:
    """Return a text as it begins a title."""
    return text[:1].upper() + text[1:]
