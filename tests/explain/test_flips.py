"""What is said to turn a gate turns it, and nothing more is said than the evidence proves."""

import dataclasses

import numpy as np
import polars as pl
import pytest

from omnieval.explain.capture import Capture
from omnieval.explain.decision import BestMatch, decision, shift_degrees
from omnieval.explain.flips import flips
from omnieval.explain.run import RunExplainer
from omnieval.mapping.config import MapperConfig
from omnieval.mapping.step import Centroid, EventKind, NodeEvent, NodeGate, Step, Verdict

CONFIG = MapperConfig(gamma=5.0, omega=2.0, merge_y=1.5)
MATCH = BestMatch(Capture(3, "b.png"), 1, 0.4, 2, 2.8, 0.1, 0.2, 0.02, 0.02, 0.004, 4.92, 5)


def decided(verdict=Verdict.PROMINENCE, *, match=MATCH, **changes):
    gate = NodeGate(2.0, np.arange(1, 11), np.array([1.62, 2.25, *np.arange(8) + 3.0]))
    fields = {"gate": gate, "centroid": None, "run": 1, "events": (), "margin": None, **changes}
    step = Step(frame=40, verdict=verdict, node=None, match=None, active=10, pending=0, **fields)
    return decision(step, Capture(40, "a.png"), match)


def only(found, gate):
    (flip,) = (flip for flip in found if flip.gate == gate)
    return flip


def test_a_refused_prominence_passes_from_its_ratio_down():
    flip = only(flips(decided(), CONFIG), "prominence")
    assert (flip.passed, flip.parameter, flip.needed, flip.threshold) == (False, "gamma", 4.92, 5.0)
    assert flip.text == "gamma <= 4.92 would pass this gate"


def test_an_accepted_prominence_is_refused_above_its_ratio_and_the_text_never_rounds_to_the_wrong_side():
    flip = only(flips(decided(match=dataclasses.replace(MATCH, prominence_ratio=7.12345)), CONFIG), "prominence")
    assert flip.passed
    assert flip.text == "gamma > 7.124 would refuse at this gate"
    refused = only(flips(decided(match=dataclasses.replace(MATCH, prominence_ratio=4.99999)), CONFIG), "prominence")
    assert refused.text == "gamma <= 4.999 would pass this gate"


@pytest.mark.parametrize(("option", "passed", "other"), [("accept", True, "reject"), ("reject", False, "accept")])
def test_a_single_peak_is_compared_with_nothing_so_no_gamma_turns_it(option, passed, other):
    config = CONFIG.model_copy(update={"single_peak": option})
    flip = only(flips(decided(match=dataclasses.replace(MATCH, peaks=1)), config), "prominence")
    assert (flip.passed, flip.parameter, flip.needed) == (passed, "single_peak", None)
    assert f"single_peak={other}" in flip.text


def test_without_candidate_the_nearest_node_needs_an_omega_of_its_ratio():
    gate = NodeGate(2.0, np.array([4, 7]), np.array([9.0, 2.3456]))
    flip = only(flips(decided(Verdict.NO_CANDIDATE, match=None, gate=gate), CONFIG), "node")
    assert (flip.passed, flip.needed) == (False, 2.3456)
    assert flip.text == "omega >= 2.346 would make node 7 a candidate"


def test_an_omega_that_cannot_be_set_is_not_advised():
    gate = NodeGate(2.0, np.array([4]), np.array([4000.0]))
    flip = only(flips(decided(Verdict.NO_CANDIDATE, match=None, gate=gate), CONFIG), "node")
    assert flip.needed is None
    assert "more than can be set" in flip.text


def test_a_candidate_is_refused_below_its_ratio_unless_x_cannot_go_there():
    few = NodeGate(2.75, np.array([1, 2]), np.array([2.7, 9.0]))  # x is at least 3.05 - 0.15 * 2
    flip = only(flips(decided(gate=few), CONFIG), "node")
    assert flip.needed is None
    assert flip.text == "no omega would refuse node 1: with 2 active nodes x is 2.75 or more"
    many = only(flips(decided(), CONFIG), "node")  # ten nodes: x may go down to 1.55
    assert many.needed == 1.62
    assert many.text == "omega < 1.62 would no longer make node 1 a candidate"


def test_the_centroid_has_no_parameter_and_is_silent_where_it_was_not_compared():
    assert not [flip for flip in flips(decided(), CONFIG) if flip.gate == "centroid"]
    flip = only(flips(decided(Verdict.CENTROID, centroid=Centroid(0.0505, 0.05)), CONFIG), "centroid")
    assert (flip.passed, flip.parameter, flip.needed) == (False, None, None)
    assert "1 % above" in flip.text


def created(merge_ratio):
    events = (NodeEvent(EventKind.CREATED, 12, frames=tuple(range(31, 41))),)
    return flips(decided(Verdict.NO_CANDIDATE, match=None, events=events, merge_ratio=merge_ratio), CONFIG)


def test_a_node_that_did_not_merge_needs_the_y_of_its_ratio():
    flip = only(created(1.6543), "merge")
    assert (flip.passed, flip.parameter, flip.needed, flip.threshold) == (False, "merge_y", 1.6543, 1.5)
    assert flip.text == "merge_y >= 1.655 would let the new node merge"


def test_a_node_that_merged_stays_apart_below_its_ratio():
    flip = only(created(1.2349), "merge")
    assert (flip.passed, flip.needed) == (True, 1.2349)
    assert flip.text == "merge_y < 1.234 would keep the new node apart"


def test_a_node_that_was_held_against_no_other_is_not_spoken_of():
    assert [flip.gate for flip in created(None)] == ["node"]


def test_an_initial_image_was_compared_with_nothing():
    assert flips(decided(Verdict.INITIAL, match=None, gate=None), CONFIG) == ()


@pytest.mark.parametrize(("shift", "cells", "degrees"), [(0, 256, 0.0), (128, 256, 180.0), (255, 256, -360 / 256)])
def test_a_shift_is_the_shorter_turn(shift, cells, degrees):
    assert shift_degrees(shift, cells) == pytest.approx(degrees)
    assert shift_degrees(shift, None) is None


def test_a_replay_with_the_gamma_that_is_said_to_pass_passes_there(run_of):
    strict = run_of(gamma=20.0)
    refused = strict.steps.filter(pl.col("verdict") == "prominence").sort("prominence_ratio", descending=True)
    frame = refused["frame"][0]
    flip = only(RunExplainer(strict).explain(frame).flips, "prominence")
    assert flip.needed is not None
    # Nothing before it would have passed with so high a gamma, so both runs come to this step with the same map.
    lenient, still = run_of(gamma=flip.needed), run_of(gamma=flip.needed * 1.001)
    before = pl.col("frame") < frame
    assert lenient.steps.filter(before)["verdict"].equals(strict.steps.filter(before)["verdict"])
    assert lenient.steps["verdict"][frame] in ("assigned", "centroid")
    assert still.steps["verdict"][frame] == "prominence"


def test_a_replay_with_the_omega_that_is_said_to_let_in_lets_in(run_of):
    strict = run_of(omega=1.0)
    explainer = RunExplainer(strict)
    refused = strict.steps.filter((pl.col("verdict") == "no-candidate") & (pl.col("frame") > 10))["frame"].to_list()
    frame = refused[0]
    flip = only(explainer.explain(frame).flips, "node")
    assert flip.needed is not None
    lenient = run_of(omega=flip.needed)
    assert not lenient.steps.head(frame).filter(pl.col("verdict") == "no-candidate").height
    assert lenient.steps["candidates"][frame].len() > 0
