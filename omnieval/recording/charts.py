"""What a step compared, as charts: bars of nodes, similarity curves, and plots over the run."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from omnieval.explain.scene import Scene
from omnieval.explain.words import subject
from omnieval.mapping.interface import Method
from omnieval.mapping.partition import Partition
from omnieval.mapping.step import Comparison, Curves, Step
from omnieval.recording import entities
from omnieval.recording.entities import bar_gate, gate_plot, plotted_gates
from omnieval.recording.rows import NO_BARS, Bars, Row, Scalar

CURVE_BARS = 512
"""Most bars of a curve, about the pixels it is shown on; this bounds what a step costs in a growing map."""
CEILING = 3.0
"""Bars are drawn up to so many times the threshold; far nodes would otherwise flatten the others."""

_BEST_SHARE = 0.006
"""Least width of the best image's bar, as a share of the chart."""

Rows = list[tuple[str, Row]]


class Charts:
    """The charts of a mapper, as it declares them."""

    def __init__(self, method: Method) -> None:
        self._bars = bar_gate(method)
        self._curves = [(name, entities.curve(name)) for name in method.curves]
        # What a parameter alone sets is known also where nothing is compared with it.
        self._plots = [
            (gate.name, gate_plot(gate), _number(method.settings.get(gate.threshold))) for gate in plotted_gates(method)
        ]
        self._columns = [(one.name, entities.column_plot(one.name)) for one in method.columns if one.plotted]

    def step_rows(self, step: Step) -> Rows:
        """Return the bars and curves of a step; what it has none of is cleared."""
        bars = bar_rows(step.compared(self._bars.name)) if self._bars is not None else []
        return bars + self._curve_rows(step.curves)

    def plot_rows(self, step: Step, partition: Partition, milliseconds: float, silhouette: float | None = None) -> Rows:
        """Return every plot's points at a step, which `partition` has taken in; NaN where nothing was compared."""
        values: dict[str, float | None] = {}
        for gate, plot, known in self._plots:
            one = step.compared(gate)
            values[f"{plot}/value"] = None if one is None else subject_value(step, one)
            values[f"{plot}/threshold"] = known if one is None else one.threshold
        for name, entity in self._columns:
            values[entity] = step.measured.get(name)
        active = len(partition.active)
        values |= {
            f"{entities.PLOT_MARGIN}/value": None if step.margin is None else step.margin.value,
            f"{entities.PLOT_NODES}/active": active,
            f"{entities.PLOT_NODES}/pending": partition.count - active,
            f"{entities.PLOT_QUALITY}/silhouette": silhouette,
            f"{entities.PLOT_QUALITY}/unassigned": partition.unassigned,
            f"{entities.PLOT_COST}/milliseconds": milliseconds,
        }
        return [(entity, Scalar(_finite(value))) for entity, value in values.items()]

    def missed_rows(self, scene: Scene) -> Rows:
        """Return the mark of a missed loop closure: at 0 where it was refused before the gate that is plotted."""
        if not self._plots or scene.outcome != "missed":
            return []
        gate, plot, _ = self._plots[0]
        one = scene.step.compared(gate)
        value = 0.0 if one is None else subject_value(scene.step, one)
        return [(f"{plot}/missed", Scalar(value if math.isfinite(value) else 0.0))]

    def _curve_rows(self, curves: Curves | None) -> Rows:
        """Return the similarity curves over the images of the map, each relative to its maximum.

        The band of the first ends where its best image has to reach.
        """
        rows: Rows = []
        for number, (name, at) in enumerate(self._curves):
            curve = best = level = NO_BARS
            values = None if curves is None else curves.values.get(name)
            if curves is not None and values is not None:
                relative = values / (float(values.max()) or 1.0)
                curve = pooled_bars(curves.slots, relative, curves.size)
                width = max(1.0, _BEST_SHARE * curves.size)
                best = _bar(float(relative[curves.best]), float(curves.slots[curves.best]) + 0.5 - width / 2, width)
                if number == 0 and curves.level is not None:
                    level = _bar(curves.level, 0.0, float(curves.size))
            rows += [(f"{at}/curve", curve), (f"{at}/best", best)]
            if number == 0:
                rows.append((f"{at}/threshold", level))
        return rows


def bar_rows(comparison: Comparison | None) -> Rows:
    """Return what was compared of every node as a bar at its number, over the band up to the threshold."""
    passing = refused = band = NO_BARS
    if comparison is not None and comparison.of:
        values, nodes, threshold = np.array(comparison.values), np.array(comparison.of), comparison.threshold
        ceiling = CEILING * abs(threshold) or np.inf
        heights = np.clip(values, -ceiling, ceiling)
        passed = np.isin(nodes, comparison.passing)
        passing, refused = (
            Bars(heights[chosen], nodes[chosen] - 0.4, np.full(chosen.sum(), 0.8)) for chosen in (passed, ~passed)
        )
        band = _bar(threshold, 0.5, float(nodes.max()))
    return [(entities.PASSING, passing), (entities.REFUSED, refused), (entities.BAND, band)]


def subject_value(step: Step, comparison: Comparison) -> float:
    """Return the value a comparison was decided by: that of the node or image it was about."""
    one = subject(step, comparison)
    value = None if one is None else comparison.value_of(one)
    return comparison.best if value is None else value


def pooled_bars(slots: NDArray[np.int64], values: NDArray[np.float64], size: int) -> Bars:
    """Draw a curve of `size` images, 0 outside `slots`, with at most `CURVE_BARS` bars.

    Neighbours that share a bar are represented by their maximum, so that no peak is lost.
    """
    curve = np.zeros(size)
    curve[slots] = values
    together = -(-size // CURVE_BARS)
    left = np.arange(0, size, together)
    return Bars(np.maximum.reduceat(curve, left), left.astype(float), np.full(len(left), float(together)))


def _bar(height: float, left: float, width: float) -> Bars:
    return Bars(np.array([height]), np.array([left]), np.array([width]))


def _number(value: object) -> float | None:
    return float(value) if isinstance(value, int | float) and not isinstance(value, bool) else None


def _finite(value: float | None) -> float:
    return float(value) if value is not None and math.isfinite(value) else math.nan
