"""Curves, gates and plots show what the step compared."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from omnieval.explain.capture import Capture
from omnieval.explain.decision import best_match, decision
from omnieval.explain.revisit import Revisit
from omnieval.mapping.config import MapperConfig
from omnieval.mapping.step import Centroid, NodeGate, Verdict
from omnieval.recording import layout
from omnieval.recording.evidence import (
    CURVE_BARS,
    DECISION_COLORS,
    GATE_CEILING,
    curve_rows,
    decision_state,
    gate_rows,
    missed_rows,
    plot_rows,
    pooled_bars,
    prominence_level,
    why_rows,
    word_rows,
)
from omnieval.recording.rows import Scalar
from tests.recording.replays import GAMMA, by_entity, decided, match, step, steps, view


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
    levels = {a_step.verdict: by_entity(word_rows(a_step, GAMMA))[layout.LOG_DECISION].level for a_step in steps(30)}
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
    one = decision(step(40, verdict), Capture(40, ""), None, revisit)
    assert decision_state(one) == state
    assert state in DECISION_COLORS
    assert bool(missed_rows(one)) == (state == "missed")


def test_a_missed_loop_closure_is_marked_at_the_ratio_that_refused_it():
    near = Revisit(Capture(0, ""), 1, 0.2)
    refused = step(40, Verdict.PROMINENCE, match=match(30, prominence=3.1))
    best = best_match(refused.match, Capture(40, ""), Capture(0, ""), 256)
    assert missed_rows(decision(refused, Capture(40, ""), best, near)) == [(layout.MISSED, Scalar(3.1))]
    nowhere = decision(step(40, Verdict.NO_CANDIDATE), Capture(40, ""), None, near)
    assert missed_rows(nowhere) == [(layout.MISSED, Scalar(0.0))]


def labels_of(one):
    """The bold labels of a page, in their order."""
    page = by_entity(why_rows(one, MapperConfig(gamma=GAMMA)))[layout.WHY].text
    headline, reasons = page.split("\n\n")
    assert headline.startswith("**")
    return [line.split("**")[1] for line in reasons.split("  \n")]


def test_the_page_begins_with_what_would_let_a_refused_image_in_or_with_the_match_of_an_accepted_one():
    closed, refused = (labels_of(decided(steps(30)[frame])) for frame in (15, 20))
    assert refused.index("would flip") < refused.index("best match")
    assert closed.index("best match") < closed.index("prominence") < closed.index("would flip")


def test_every_line_of_the_log_begins_with_its_step():
    for a_step in steps(60):
        for entity, words in word_rows(a_step, GAMMA):
            assert words.text.startswith(f"{a_step.frame}: "), entity


@pytest.mark.parametrize("ground", [0x0D1011FF, 0xFFFFFFFF])
def test_the_log_can_be_read_in_a_dark_and_in_a_bright_viewer(ground):
    assert contrast(layout.GREY_TEXT_COLOR, ground) > 3
    assert contrast(layout.EVENT_COLOR, ground) > 2.5


def contrast(one, other):
    """Contrast of two colours, 1..21 (WCAG 2.1)."""
    bright, dark = sorted((luminance(one), luminance(other)), reverse=True)
    return (bright + 0.05) / (dark + 0.05)


def luminance(color):
    channels = [(color >> shift & 255) / 255 for shift in (24, 16, 8)]
    linear = [channel / 12.92 if channel <= 0.04045 else ((channel + 0.055) / 1.055) ** 2.4 for channel in channels]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]
