"""Curves, gates and plots show what the step compared."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from omnieval.explain.capture import Capture
from omnieval.explain.decision import decision
from omnieval.explain.revisit import Revisit
from omnieval.mapping.step import Centroid, NodeGate, Verdict
from omnieval.recording import layout
from omnieval.recording.evidence import (
    CURVE_BARS,
    DECISION_COLORS,
    GATE_CEILING,
    curve_rows,
    decision_state,
    gate_rows,
    plot_rows,
    pooled_bars,
    prominence_level,
    word_rows,
)
from tests.recording.replays import GAMMA, by_entity, match, step, steps, view


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


@pytest.mark.parametrize("prominence", [0.1, 4.9, 5.0, 5.1, 8.9])
def test_the_peak_passes_the_drawn_threshold_iff_it_is_prominent_enough(prominence):
    found = match(40, prominence=prominence)
    assert (prominence_level(found, GAMMA) <= 1.0) == (found.prominence_ratio >= GAMMA)


def test_three_curves_are_drawn_with_best_candidate_and_threshold():
    rows = by_entity(curve_rows(match(40, best=7), GAMMA))
    assert len(rows) == 7
    for curve in (layout.SIMILARITY, layout.POSITION, layout.ORIENTATION):
        assert rows[f"{curve}/curve"].heights.max() == 1.0
        best = rows[f"{curve}/best"]
        assert best.left[0] <= 7 < best.left[0] + best.width[0]
    assert rows[f"{layout.SIMILARITY}/threshold"].width.tolist() == [40.0]


def test_no_threshold_is_drawn_where_nothing_is_compared():
    rows = by_entity(curve_rows(match(40, peaks=1), GAMMA))
    assert len(rows[f"{layout.SIMILARITY}/threshold"].heights) == 0


def test_without_a_match_the_curves_are_cleared():
    assert all(len(row.heights) == 0 for row in by_entity(curve_rows(None, GAMMA)).values())


def test_every_active_node_has_a_bar_at_its_number():
    gate = NodeGate(2.0, np.array([1, 4, 9]), np.array([0.5, 2.5, 1e9]))
    rows = by_entity(gate_rows(gate))
    assert rows["/gate/candidates"].left.tolist() == [0.6]
    assert rows["/gate/refused"].left.tolist() == [3.6, 8.6]
    assert rows["/gate/refused"].heights.tolist() == [2.5, 2.0 * GATE_CEILING]
    assert rows["/gate/threshold"].heights.tolist() == [2.0]


def test_without_a_gate_the_bars_are_cleared():
    assert all(len(row.heights) == 0 for row in by_entity(gate_rows(None)).values())


def test_plots_carry_the_compared_values():
    decided = step(
        9,
        Verdict.ASSIGNED,
        1,
        gate=NodeGate(1.85, np.array([1, 2]), np.array([0.5, 40.0])),
        match=match(30, prominence=8.0, mean=2.0),
        centroid=Centroid(0.01, 0.02),
    )
    values = {entity: row.value for entity, row in by_entity(plot_rows(view(decided), GAMMA, 0.125)).items()}
    assert values["/plot/prominence/ratio"] == 4.0
    assert values["/plot/prominence/gamma"] == GAMMA
    assert (values["/plot/gate/nearest"], values["/plot/gate/x"]) == (0.5, 1.85)
    assert (values["/plot/centroid/shift"], values["/plot/centroid/bound"]) == (0.01, 0.02)
    assert values["/plot/quality/silhouette"] == 0.25
    assert values["/plot/quality/unassigned"] == 0.125


def test_what_was_not_reached_interrupts_the_line():
    rows = by_entity(plot_rows(view(step(0, Verdict.INITIAL, 1), silhouette=None), GAMMA, 0.25))
    missing = {entity for entity, row in rows.items() if math.isnan(row.value)}
    assert missing == {
        "/plot/gate/nearest",
        "/plot/gate/x",
        "/plot/prominence/ratio",
        "/plot/centroid/shift",
        "/plot/centroid/bound",
        "/plot/margin/value",
        "/plot/quality/silhouette",
    }


def test_plots_have_a_style_for_every_line():
    assert {entity for entity, _ in plot_rows(view(steps(1)[0]), GAMMA, 0.25)} == set(layout.SERIES)


def test_an_infinite_ratio_is_not_drawn():
    endless = dataclasses.replace(match(30), prominence_mean=0.0)
    rows = by_entity(plot_rows(view(step(9, Verdict.ASSIGNED, 1, match=endless)), GAMMA, 0.25))
    assert math.isnan(rows["/plot/prominence/ratio"].value)


def test_refusals_stand_out_in_the_log():
    levels = {decided.verdict: by_entity(word_rows(decided, GAMMA))[layout.LOG_DECISION].level for decided in steps(30)}
    refused = {verdict for verdict, level in levels.items() if level == "WARN"}
    assert refused == {Verdict.NO_CANDIDATE, Verdict.PROMINENCE, Verdict.CENTROID}


def test_colours_of_nodes_depend_on_the_number_alone_and_differ():
    colors = [layout.node_color(node) for node in range(40)]
    assert len(set(colors)) == 40
    assert layout.node_color(0) == layout.UNASSIGNED_COLOR


@pytest.mark.parametrize(
    ("verdict", "metres", "state"),
    [
        (Verdict.INITIAL, None, "initial"),
        (Verdict.ASSIGNED, 0.2, "closed"),
        (Verdict.PENDING, 9.0, "closed"),
        (Verdict.PROMINENCE, 0.2, "missed"),
        (Verdict.NO_CANDIDATE, 1.0, "missed"),
        (Verdict.NO_CANDIDATE, 1.1, "refused"),
        (Verdict.CENTROID, None, "refused"),
    ],
)
def test_a_refusal_at_a_known_place_is_a_missed_loop_closure(verdict, metres, state):
    revisit = None if metres is None else Revisit(Capture(0, ""), 1, metres)
    decided = decision(step(40, verdict), Capture(40, ""), None, revisit)
    assert decision_state(decided) == state
    assert state in DECISION_COLORS
