"""What is said to turn a gate turns it, and nothing more is said than the evidence proves."""

import polars as pl
import pytest

from omnieval.explain.flips import flips, refusing_first
from omnieval.explain.run import RunExplainer
from omnieval.mapping.interface import Method
from omnieval.mapping.roman2020.evidence import Verdict
from omnieval.mapping.step import Comparison, Role, Step
from tests.explain.made import BEST, METHOD, asked, decided

TEN = {1: 1.62, 2: 2.25, **{node: node + 0.0 for node in range(3, 11)}}


def found(verdict, method=METHOD, **compared):
    return flips(decided(verdict, asked(**compared)), method)


def only(flipped, gate):
    (flip,) = (flip for flip in flipped if flip.gate == gate)
    return flip


def test_a_refused_prominence_passes_from_its_ratio_down():
    flip = only(found(Verdict.PROMINENCE, node=TEN, prominence=4.92), "prominence")
    assert (flip.passed, flip.parameter, flip.needed, flip.threshold) == (False, "gamma", 4.92, 5.0)
    assert flip.text == "gamma <= 4.92 would pass this gate"


def test_an_accepted_prominence_is_refused_above_its_ratio_and_the_text_never_rounds_to_the_wrong_side():
    flip = only(found(Verdict.CENTROID, prominence=7.12345), "prominence")
    assert flip.passed
    assert flip.text == "gamma > 7.124 would refuse at this gate"
    refused = only(found(Verdict.PROMINENCE, prominence=4.99999), "prominence")
    assert refused.text == "gamma <= 4.999 would pass this gate"


@pytest.mark.parametrize("verdict", [Verdict.CENTROID, Verdict.PROMINENCE])
def test_a_single_peak_is_compared_with_nothing_so_no_gamma_is_said_to_turn_it(verdict):
    assert found(verdict, peaks=1) == ()


def test_without_candidate_the_nearest_node_needs_an_omega_of_its_ratio():
    flip = only(found(Verdict.NO_CANDIDATE, node={4: 9.0, 7: 2.3456}), "node")
    assert (flip.passed, flip.needed) == (False, 2.3456)
    assert flip.text == "omega >= 2.346 would make node 7 a candidate"


def test_an_omega_that_cannot_be_set_is_not_advised():
    flip = only(found(Verdict.NO_CANDIDATE, node={4: 4000.0}), "node")
    assert flip.needed is None
    assert "more than can be set" in flip.text


def test_a_candidate_is_refused_below_its_ratio_unless_x_cannot_go_there():
    few = only(found(Verdict.PROMINENCE, node={1: 2.7, 2: 9.0}, x=2.75), "node")  # x is at least 3.05 - 0.15 * 2
    assert few.needed is None
    assert few.text == "no omega would drop node 1 as a candidate: x is 2.75 or more"
    many = only(found(Verdict.PROMINENCE, node=TEN), "node")  # ten nodes: x may go down to 1.55
    assert many.needed == 1.62
    assert many.text == "omega < 1.62 would drop node 1 as a candidate"


def test_a_candidate_that_was_chosen_is_spoken_of_rather_than_the_nearest():
    step = decided(Verdict.ASSIGNED, asked(node={**TEN, 4: 1.9}, centroid=(0.01, 0.02)), node=4, match=BEST)
    assert only(flips(step, METHOD), "node").text == "omega < 1.9 would drop node 4 as a candidate"


def test_the_centroid_has_no_parameter_and_is_silent_where_it_was_not_compared():
    assert not [flip for flip in found(Verdict.PROMINENCE, prominence=4.92) if flip.gate == "centroid"]
    flip = only(found(Verdict.CENTROID, centroid=(0.0505, 0.05)), "centroid")
    assert (flip.passed, flip.parameter, flip.needed) == (False, None, None)
    assert "1 % above" in flip.text


def test_a_node_that_did_not_merge_needs_the_y_of_its_ratio():
    flip = only(found(Verdict.NO_CANDIDATE, merge={3: 1.6543, 5: 9.0}), "merge")
    assert (flip.passed, flip.parameter, flip.needed, flip.threshold) == (False, "merge_y", 1.6543, 1.5)
    assert flip.text == "merge_y >= 1.655 would let the node merge into node 3"


def test_a_node_that_merged_stays_apart_below_its_ratio():
    step = decided(Verdict.NO_CANDIDATE, asked(merge={3: 1.2349, 5: 1.4}), node=3)
    flip = only(flips(step, METHOD), "merge")
    assert (flip.passed, flip.needed) == (True, 1.2349)
    assert flip.text == "merge_y < 1.234 would keep the node apart from node 3"


def test_a_node_that_was_held_against_no_other_is_not_spoken_of():
    assert [flip.gate for flip in found(Verdict.NO_CANDIDATE, node={4: 9.0})] == ["node"]


def test_a_run_that_n_new_would_have_ended_says_so():
    flip = only(found(Verdict.NO_CANDIDATE, node={4: 9.0}, run=14), "run")
    assert (flip.passed, flip.needed) == (False, 14)
    assert flip.text == "n_new <= 14 would make a node of the run"


def test_a_run_that_no_n_new_would_have_ended_yet_is_not_spoken_of():
    assert [flip.gate for flip in found(Verdict.NO_CANDIDATE, node={4: 9.0}, run=3)] == ["node"]


def test_an_initial_image_was_compared_with_nothing():
    assert found(Verdict.INITIAL) == ()


def test_of_a_refused_image_the_gate_that_refused_comes_first():
    first, second = refusing_first(found(Verdict.PROMINENCE, node=TEN, prominence=4.92))
    assert (first.gate, second.gate) == ("prominence", "node")


def test_a_mapper_that_declares_nothing_is_explained_by_the_names_of_its_gates_and_parameters():
    compared = Comparison("reach", (3.0, 7.5), 2.5, -float("inf"), 3.0, "reach", of=(1, 2))
    step = Step(9, "alone", Role.REFUSED, comparisons=(compared,))
    (flip,) = flips(step, Method(name="unheard-of"))
    assert (flip.passed, flip.needed) == (False, 3.0)
    assert flip.text == "reach >= 3 would pass this gate"


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
    gate = RunExplainer(lenient).scene(frame).step.compared("node")
    assert gate is not None
    assert gate.passing
