"""Every verdict, comparison and event is said in words that give the reason."""

import numpy as np
import pytest

from omnieval.explain.words import (
    comparison_text,
    decision_text,
    distinct,
    event_text,
    frame_ranges,
    map_text,
    margin_text,
    threshold_text,
)
from omnieval.mapping.interface import Method
from omnieval.mapping.roman2020.evidence import Verdict
from omnieval.mapping.step import Comparison, EventKind, FinalMap, NodeEvent, Placement, Role, Step
from tests.explain.made import BEST, METHOD, asked, decided

FAR = {1: 4.0, 3: 2.31}
NEAR = {1: 0.5, 4: 1.1}


@pytest.mark.parametrize(
    ("step", "text"),
    [
        (decided(Verdict.INITIAL, node=1), "initial image of node 1"),
        (
            decided(Verdict.ASSIGNED, asked(NEAR, prominence=7.9, centroid=(0.01, 0.02)), node=4, match=BEST),
            "joined node 4: best image 212, shift of the node's mean 0.01 <= bound 0.02",
        ),
        (
            decided(Verdict.NO_CANDIDATE, asked(FAR)),
            "refused (no-candidate): gate ratio of node 3: 2.31 > x 2",
        ),
        (
            decided(Verdict.PROMINENCE, asked(NEAR, prominence=3.1), match=BEST),
            "refused (prominence): prominence over the mean 3.1 < gamma 5",
        ),
        (
            decided(Verdict.PROMINENCE, asked(NEAR, peaks=1), match=BEST),
            "refused (prominence): peaks of the similarity curve 1 < number needed to compare 2",
        ),
        (
            decided(Verdict.CENTROID, asked(NEAR, prominence=9.0, centroid=(0.03, 0.02)), match=BEST),
            "refused (centroid): shift of the node's mean 0.03 > bound 0.02",
        ),
        (
            decided(Verdict.PENDING, asked(FAR), node=6),
            "joined pending node 6; active nodes refused: gate ratio of node 3: 2.31 > x 2",
        ),
        (decided(Verdict.NO_CANDIDATE), "refused (no-candidate)"),
        (Step(9, "lost", Role.UNASSIGNED), "lost"),
    ],
)
def test_a_decision_says_why(step, text):
    assert decision_text(step, METHOD) == text


@pytest.mark.parametrize("role", Role)
def test_no_role_is_without_words(role):
    step = Step(9, "whatever", role, 1, comparisons=tuple(asked(FAR, centroid=(0.03, 0.02)).comparisons))
    assert decision_text(step, METHOD)


def test_a_mapper_that_declares_nothing_is_told_in_the_names_of_its_gates():
    compared = Comparison("reach", (3.0, 7.5), 2.5, -np.inf, 3.0, "reach", of=(1, 2))
    step, method = Step(9, "alone", Role.REFUSED, comparisons=(compared,)), Method(name="unheard-of")
    assert decision_text(step, method) == "refused (alone)"
    assert comparison_text(step, compared, method) == "reach 3 > threshold 2.5"
    assert threshold_text(compared, method) == "threshold = reach = 2.5"
    assert margin_text(step, method) == "0.2 (reach): nearest to going the other way was reach against threshold"


def test_a_threshold_says_where_it_comes_from():
    node, prominence, centroid = asked(FAR, prominence=7.0, centroid=(0.03, 0.02)).comparisons
    assert threshold_text(node, METHOD) == "x = max(omega 2, 2.75) = 2"
    assert threshold_text(prominence, METHOD) == "gamma 5"
    assert threshold_text(centroid, METHOD) == "bound 0.02"


def test_the_margin_names_what_was_nearest_to_going_the_other_way():
    step = decided(Verdict.CENTROID, asked(NEAR, prominence=9.0, centroid=(0.0203, 0.02)))
    text = "0.015 (centroid): nearest to going the other way was shift of the node's mean against bound"
    assert margin_text(step, METHOD) == text
    assert margin_text(decided(Verdict.INITIAL), METHOD) == "none: nothing was compared"


@pytest.mark.parametrize(
    ("event", "text"),
    [
        (NodeEvent(EventKind.CREATED, 5, frames=tuple(range(300, 320))), "created node 5 from images 300-319"),
        (NodeEvent(EventKind.MERGED, 5, into=2), "node 5 merged into 2"),
        (NodeEvent(EventKind.ACTIVATED, 5), "node 5 became active"),
    ],
)
def test_an_event_says_what_happened(event, text):
    assert event_text(event) == text


def test_a_refusal_never_reads_as_if_the_condition_were_met():
    near_miss = decided(Verdict.PROMINENCE, asked(prominence=4.998))
    assert decision_text(near_miss, METHOD).endswith("4.998 < gamma 5")
    nearer = decided(Verdict.PROMINENCE, asked(prominence=4.9999999))
    assert decision_text(nearer, METHOD).endswith("4.9999999 < gamma 5")


def test_equal_values_read_equal():
    assert distinct(5.0, 5.0) == "5"


def test_frames_are_written_as_ranges():
    assert frame_ranges((300, 301, 302, 305, 307, 308)) == "300-302, 305, 307-308"


def test_the_end_says_what_became_of_leftovers():
    placements = (Placement.FOUNDING, Placement.FOUNDING, Placement.FORCED, Placement.UNASSIGNED)
    final = FinalMap(np.array([1, 1, 2, 0]), placements, (1, 2), frozenset({1}), np.zeros((2, 4)))
    assert map_text(final) == "final map: 2 nodes, 1 active; leftovers: 0 accepted, 1 forced, 1 unassigned"
