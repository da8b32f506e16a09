"""Every verdict and every event is said in words that give the reason."""

import numpy as np
import pytest

from omnieval.explain.words import decision_text, distinct, event_text, final_text, frame_ranges
from omnieval.mapping.step import Centroid, EventKind, NodeEvent, NodeGate, Verdict
from tests.recording.replays import GAMMA, final, match, step

FAR = NodeGate(1.85, np.array([1, 3]), np.array([4.0, 2.31]))


@pytest.mark.parametrize(
    ("decided", "text"),
    [
        (step(3, Verdict.INITIAL, 1), "initial image of node 1"),
        (
            step(9, Verdict.ASSIGNED, 4, match=match(300, best=212, prominence=7.9, node=4)),
            "joined node 4: best image 212, prominence 7.9 x mean",
        ),
        (
            step(9, Verdict.ASSIGNED, 4, match=match(300, best=212, peaks=1, node=4)),
            "joined node 4: best image 212, 1 peak, nothing to compare its prominence with",
        ),
        (step(9, Verdict.NO_CANDIDATE, gate=FAR, run=1), "no candidate: nearest node 3 at 2.31 > x = 1.85"),
        (
            step(9, Verdict.PROMINENCE, match=match(30, prominence=3.1), run=4),
            "refused: prominence 3.1 x mean < 5 (4 unassigned in a row)",
        ),
        (
            step(9, Verdict.PROMINENCE, match=match(30, peaks=1), run=1),
            "refused: 1 peak on the similarity curve, too few to stand out",
        ),
        (
            step(9, Verdict.CENTROID, match=match(30), centroid=Centroid(0.03, 0.02)),
            "refused: centroid shift 0.0300 > bound 0.0200",
        ),
        (
            step(9, Verdict.PENDING, 6, gate=FAR),
            "joined pending node 6; active nodes: no candidate: nearest node 3 at 2.31 > x = 1.85",
        ),
        (step(9, Verdict.NO_CANDIDATE, gate=None), "no candidate: no active node"),
    ],
)
def test_a_decision_says_why(decided, text):
    assert decision_text(decided, GAMMA) == text


@pytest.mark.parametrize("verdict", Verdict)
def test_no_verdict_is_without_words(verdict):
    decided = step(9, verdict, 1, gate=FAR, match=match(30), centroid=Centroid(0.03, 0.02))
    assert decision_text(decided, GAMMA)


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
    near_miss = step(9, Verdict.PROMINENCE, match=match(30, prominence=4.998))
    assert decision_text(near_miss, GAMMA) == "refused: prominence 4.998 x mean < 5"


def test_equal_values_read_equal():
    assert distinct(5.0, 5.0, 1) == "5.0"


def test_frames_are_written_as_ranges():
    assert frame_ranges((300, 301, 302, 305, 307, 308)) == "300-302, 305, 307-308"


def test_the_end_says_what_became_of_leftovers():
    text = final_text(final([1, 1, 2, 0]))
    assert text == "final map: 2 nodes, 1 active; leftovers: 0 accepted, 0 forced, 1 unassigned"
