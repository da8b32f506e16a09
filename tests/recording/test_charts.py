"""Curves, bars and plots show what the step compared, whatever the mapper."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from omnieval.explain.revisit import Revisit
from omnieval.mapping.interface import Column, Gate, Method
from omnieval.mapping.partition import Partition
from omnieval.mapping.step import Match, Role
from omnieval.recording import entities
from omnieval.recording.charts import CEILING, CURVE_BARS, Charts, bar_rows, pooled_bars
from omnieval.recording.rows import Scalar
from omnieval.recording.styles import OUTCOME_COLORS, UNASSIGNED_COLOR, node_color, series
from tests.recording.replays import (
    FAR,
    GAMMA,
    LEADER,
    METHOD,
    by_entity,
    centroid,
    compared,
    curves,
    image,
    prominence,
    scene,
    step,
    steps,
)

SIMILARITY, POSITION, ORIENTATION = map(entities.curve, METHOD.curves)
MISSED = "/plot/gate/prominence/missed"


def drawn(a_step, method=METHOD):
    return by_entity(Charts(method).step_rows(a_step))


def plotted(a_step, method=METHOD, **options):
    partition = Partition()
    partition.apply(dataclasses.replace(a_step, frame=0))
    rows = by_entity(Charts(method).plot_rows(a_step, partition, 1.5, **options))
    return {entity: row.value for entity, row in rows.items()}


@given(st.integers(1, 5000), st.integers(0, 2**32 - 1))
def test_a_curve_has_few_bars_and_loses_no_peak(size, seed):
    rng = np.random.default_rng(seed)
    slots = np.flatnonzero(rng.random(size) < 0.3)
    values = rng.random(len(slots))
    bars = pooled_bars(slots, values, size)
    assert len(bars.heights) <= CURVE_BARS
    assert bars.heights.max() == max(values, default=0.0)
    assert bars.left[0] == 0
    assert bars.left[-1] + bars.width[-1] >= size


def test_a_short_curve_is_drawn_image_by_image():
    bars = pooled_bars(np.array([1, 3]), np.array([0.5, 1.0]), 5)
    assert bars.heights.tolist() == [0, 0.5, 0, 1, 0]
    assert bars.left.tolist() == [0, 1, 2, 3, 4]


def test_curves_are_drawn_with_best_image_and_the_level_it_has_to_reach():
    rows = drawn(step(40, "assigned", Role.JOINED, 1, curves=curves(40, best=7, level=0.75)))
    for curve in (SIMILARITY, POSITION, ORIENTATION):
        assert rows[f"{curve}/curve"].heights.max() == 1.0
        best = rows[f"{curve}/best"]
        assert best.left[0] <= 7 < best.left[0] + best.width[0]
    assert (rows[f"{SIMILARITY}/threshold"].heights.tolist(), rows[f"{SIMILARITY}/threshold"].width.tolist()) == (
        [0.75],
        [40.0],
    )
    assert not {f"{POSITION}/threshold", f"{ORIENTATION}/threshold"} & set(rows)


def test_no_level_is_drawn_where_nothing_is_asked():
    assert (
        len(
            drawn(step(9, "assigned", Role.JOINED, 1, curves=curves(40, level=None)))[f"{SIMILARITY}/threshold"].heights
        )
        == 0
    )


def test_what_a_step_has_none_of_is_cleared():
    rows = drawn(step(0, "initial", Role.FOUNDING, 1))
    assert set(rows) >= {
        f"{SIMILARITY}/curve",
        f"{ORIENTATION}/best",
        entities.PASSING,
        entities.REFUSED,
        entities.BAND,
    }
    assert all(len(row.heights) == 0 for row in rows.values())


def test_a_curve_that_is_zero_or_was_not_declared_hurts_nobody():
    flat = dataclasses.replace(curves(4), values={"similarity": np.zeros(4), "other": np.ones(4)})
    rows = drawn(step(9, "assigned", Role.JOINED, 1, curves=flat))
    assert rows[f"{SIMILARITY}/curve"].heights.tolist() == [0.0] * 4
    assert len(rows[f"{POSITION}/curve"].heights) == 0


def test_every_node_has_a_bar_at_its_number():
    rows = by_entity(bar_rows(compared("node", [0.5, 2.5, 1e9], 2.0, of=(1, 4, 9))))
    assert rows[entities.PASSING].left.tolist() == [0.6]
    assert rows[entities.REFUSED].left.tolist() == [3.6, 8.6]
    assert rows[entities.REFUSED].heights.tolist() == [2.5, 2.0 * CEILING]
    assert rows[entities.BAND].heights.tolist() == [2.0]


def test_bars_that_have_to_reach_a_threshold_pass_above_it():
    rows = by_entity(bar_rows(compared("node", [0.5, 2.5], 2.0, of=(1, 4), reaches=True)))
    assert (rows[entities.PASSING].left.tolist(), rows[entities.REFUSED].left.tolist()) == ([3.6], [0.6])


def test_the_bars_are_those_of_the_first_gate_that_compares_with_nodes_and_closes_loops():
    later = compared("pending", [9.0], 2.0, of=(3,))
    rows = drawn(step(9, "pending", Role.PENDING, 3, comparisons=(FAR, later)))
    assert rows[entities.REFUSED].heights.tolist() == [2.31]
    assert entities.bar_gate(Method(name="m", gates=(Gate(name="g", value="v", threshold="t", of="node"),))) is None


def test_plots_carry_the_values_that_were_decided_by():
    ratios = compared("node", [0.5, 0.1, 40.0], 1.85, of=(1, 2, 3), parameter="omega")
    decided = step(
        9, "assigned", Role.JOINED, 1, match=Match(0, 1), comparisons=(ratios, prominence(4.0), centroid(0.01))
    )
    values = plotted(decided, silhouette=0.25)
    assert (values["/plot/gate/node/value"], values["/plot/gate/node/threshold"]) == (0.5, 1.85)
    assert (values["/plot/gate/prominence/value"], values["/plot/gate/prominence/threshold"]) == (4.0, GAMMA)
    assert (values["/plot/gate/centroid/value"], values["/plot/gate/centroid/threshold"]) == (0.01, 0.02)
    assert values["/plot/quality/silhouette"] == 0.25
    assert values["/plot/quality/unassigned"] == 0.0
    nowhere = dataclasses.replace(decided, role=Role.REFUSED, node=None, match=None, comparisons=(FAR,))
    assert plotted(nowhere)["/plot/gate/node/value"] == 2.31


def test_what_was_not_reached_interrupts_the_line_but_a_parameter_is_known_all_along():
    missing = {entity for entity, value in plotted(step(0, "initial", Role.FOUNDING, 1)).items() if math.isnan(value)}
    assert missing == {
        "/plot/gate/node/value",
        "/plot/gate/node/threshold",
        "/plot/gate/prominence/value",
        "/plot/gate/centroid/value",
        "/plot/gate/centroid/threshold",
        "/plot/margin/value",
        "/plot/quality/silhouette",
    }


def test_a_column_that_is_to_be_plotted_is():
    column = Column(name="peaks of it", type="int", meaning="peaks", plotted=True)
    method = Method(name="own", columns=(column, Column(name="other", type="int", meaning="other")))
    values = plotted(step(0, "first", Role.FOUNDING, 1, measured={"peaks of it": 3}), method)
    assert values[entities.column_plot("peaks of it")] == 3.0
    assert set(values) == set(series(method))


@pytest.mark.parametrize("method", [METHOD, LEADER, Method(name="silent")])
def test_plots_have_a_style_for_every_line(method):
    assert set(plotted(steps(1)[0], method)) == set(series(method))


def test_an_infinite_value_is_not_drawn():
    endless = step(9, "assigned", Role.JOINED, 1, comparisons=(prominence(math.inf),))
    assert math.isnan(plotted(endless)["/plot/gate/prominence/value"])


def test_colours_of_nodes_depend_on_the_number_alone_and_differ():
    colors = [node_color(node) for node in range(40)]
    assert len(set(colors)) == 40
    assert node_color(0) == UNASSIGNED_COLOR


@pytest.mark.parametrize(
    ("role", "metres", "outcome"),
    [
        (Role.FOUNDING, None, "founding"),
        (Role.JOINED, 0.2, "closed"),
        (Role.PENDING, 9.0, "pending"),
        (Role.REFUSED, 0.2, "missed"),
        (Role.REFUSED, 1.1, "refused"),
        (Role.REFUSED, None, "refused"),
        (Role.UNASSIGNED, 0.2, "unassigned"),
    ],
)
def test_every_outcome_has_a_colour_and_a_missed_loop_closure_a_mark(role, metres, outcome):
    revisit = None if metres is None else Revisit(0, image(0), 1, metres)
    one = scene(step(40, "so", role), revisit)
    assert one.outcome == outcome
    assert outcome in OUTCOME_COLORS
    assert bool(Charts(METHOD).missed_rows(one)) == (outcome == "missed")


def test_a_missed_loop_closure_is_marked_at_the_value_that_refused_it_in_the_first_plot_behind_the_bars():
    near = Revisit(0, image(0), 1, 0.2)
    refused = step(40, "prominence", Role.REFUSED, match=Match(0, 1, 3), comparisons=(FAR, prominence(3.1)))
    charts = Charts(METHOD)
    assert charts.missed_rows(scene(refused, near)) == [(MISSED, Scalar(3.1))]
    assert charts.missed_rows(scene(step(40, "no", Role.REFUSED, comparisons=(FAR,)), near)) == [(MISSED, Scalar(0.0))]
    far = step(40, "too far", Role.REFUSED, comparisons=(compared("distance", [4.0], 3.0, of=(1,)),))
    assert Charts(LEADER).missed_rows(scene(far, near)) == [("/plot/gate/distance/missed", Scalar(4.0))]
    assert Charts(Method(name="silent")).missed_rows(scene(far, near)) == []
