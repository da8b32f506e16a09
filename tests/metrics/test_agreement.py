"""Agreement of nodes with rooms: by hand, against scikit-learn, and null where there is nothing to compare."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from sklearn.metrics import adjusted_rand_score, homogeneity_completeness_v_measure

from omnieval.mapping.step import Placement
from omnieval.metrics.agreement import room_agreement
from omnieval.metrics.evaluation import METRICS, evaluate

NAMES = [name for name in METRICS if name.startswith("rooms_")]


def judged(labels, rooms):
    return evaluate(np.array(labels), [Placement.FOUNDING] * len(labels), None, rooms=rooms, seed=0)


def test_six_images_by_hand():
    # Node 1 has two of room A and one of B, node 2 one of B, node 3 two of B.
    found = room_agreement(np.array([1, 1, 1, 2, 3, 3]), ["A", "A", "B", "B", "B", "B"])
    room_entropy = -(1 / 3 * math.log(1 / 3) + 2 / 3 * math.log(2 / 3))
    node_entropy = -(1 / 2 * math.log(1 / 2) + 1 / 6 * math.log(1 / 6) + 1 / 3 * math.log(1 / 3))
    room_given_node = 1 / 2 * room_entropy  # node 1 alone is mixed, 2 to 1, and holds half of the images
    information = room_entropy - room_given_node
    assert found.rooms_purity == pytest.approx(5 / 6)
    assert found.rooms_homogeneity == pytest.approx(1 - room_given_node / room_entropy)
    assert found.rooms_completeness == pytest.approx(information / node_entropy)
    assert found.rooms_nmi == pytest.approx(2 * information / (room_entropy + node_entropy))
    # Pairs together: in nodes 3 + 0 + 1 = 4, in rooms 1 + 6 = 7, in both 1 + 1 = 2, of 15.
    expected = 4 * 7 / 15
    assert found.rooms_ari == pytest.approx((2 - expected) / ((4 + 7) / 2 - expected))


@pytest.mark.parametrize("nodes", [[1, 1, 2, 2, 3], [9, 9, 4, 4, 7]])
def test_the_rooms_themselves_score_one_whatever_the_nodes_are_called(nodes):
    found = room_agreement(np.array(nodes), ["A", "A", "B", "B", "C"])
    assert [getattr(found, name) for name in NAMES] == pytest.approx([1.0] * 5)


def test_one_node_is_complete_and_every_image_its_own_is_homogeneous():
    rooms = ["A", "A", "B", "B"]
    one = room_agreement(np.ones(4, np.int64), rooms)
    values = (one.rooms_completeness, one.rooms_homogeneity, one.rooms_ari, one.rooms_purity)
    assert values == pytest.approx((1.0, 0.0, 0.0, 0.5))
    each = room_agreement(np.arange(1, 5), rooms)
    assert (each.rooms_homogeneity, each.rooms_purity, each.rooms_ari) == pytest.approx((1.0, 1.0, 0.0))
    assert each.rooms_completeness == pytest.approx(0.5)


@given(st.lists(st.tuples(st.integers(1, 5), st.sampled_from("ABC")), min_size=2, max_size=40))
def test_agreement_is_that_of_scikit_learn(pairs):
    nodes, rooms = zip(*sorted(pairs * 3), strict=True)
    found = room_agreement(np.array(nodes), rooms)
    homogeneity, completeness, v_measure = homogeneity_completeness_v_measure(rooms, nodes)
    assert found.rooms_ari == pytest.approx(adjusted_rand_score(rooms, nodes))
    assert found.rooms_homogeneity == pytest.approx(homogeneity)
    assert found.rooms_completeness == pytest.approx(completeness)
    # With the arithmetic mean of the entropies, NMI is the V-measure, except where both are constant or 0.
    assert found.rooms_nmi == pytest.approx(v_measure, abs=1e-9)


def test_only_images_with_both_a_node_and_a_label_count():
    labels, rooms = [1, 1, 0, 2, 2, 1], ["A", "A", "B", "B", "B", None]
    metrics = judged(labels, rooms).metrics
    assert [metrics[name] for name in NAMES] == pytest.approx([1.0] * 5)


@pytest.mark.parametrize(
    ("labels", "rooms", "reason"),
    [
        ([1, 2], None, "no room labels"),
        ([1, 2], [None, None], "no room labels"),
        ([0, 1], ["A", None], "both a room label and a node"),
    ],
)
def test_without_anything_to_compare_agreement_is_null_with_a_reason(labels, rooms, reason):
    evaluation = judged(labels, rooms)
    assert all(evaluation.metrics[name] is None for name in NAMES)
    assert all(reason in evaluation.reasons[name] for name in NAMES)


def test_nothing_to_compare_is_an_error_of_the_caller():
    with pytest.raises(ValueError, match="at least one image"):
        room_agreement(np.array([0, 1]), ["A", None])


def test_a_partition_that_was_not_made_image_by_image_has_no_shares_but_that_of_the_unassigned():
    evaluation = evaluate(np.array([0, 1, 1, 2]), None, None, rooms=None, seed=0)
    shares = {name: value for name, value in evaluation.metrics.items() if name.startswith("share_")}
    assert shares.pop("share_unassigned") == 0.25
    assert set(shares.values()) == {None}
    assert all("not placed one by one" in evaluation.reasons[name] for name in shares)


def test_metrics_come_in_the_order_of_their_names():
    evaluation = evaluate(np.array([1, 1, 2, 2]), None, np.eye(4, 2), rooms=["A", "A", "B", "B"], seed=0)
    assert tuple(evaluation.metrics) == METRICS
