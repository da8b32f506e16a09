"""The partition replayed from Steps is the one the steps tell of."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from omnieval.mapping.partition import Partition, count_transitions
from omnieval.mapping.step import EventKind, NodeEvent, Role, Step


def step(frame, node, *events):
    return Step(frame, "decided", Role.UNASSIGNED if node is None else Role.JOINED, node, events=events)


def replay(*nodes, start=0):
    partition = Partition()
    for frame, node in enumerate(nodes, start):
        partition.apply(step(frame, node))
    return partition


def test_images_take_the_node_of_their_step():
    assert replay(1, 1, None, 2).labels.tolist() == [1, 1, 0, 2]


def test_a_created_node_takes_the_images_it_is_made_of():
    partition = replay(1, None, 1, None)
    partition.apply(step(4, 2, NodeEvent(EventKind.CREATED, 2, frames=(1, 3, 4))))
    assert partition.labels.tolist() == [1, 2, 1, 2, 2]


def test_a_node_that_merges_hands_over_all_its_images():
    partition = replay(1, 3, None, None)
    created = NodeEvent(EventKind.CREATED, 4, frames=(2, 3, 4))
    partition.apply(step(4, 3, created, NodeEvent(EventKind.MERGED, 4, into=3)))
    assert partition.labels.tolist() == [1, 3, 3, 3, 3]
    partition.apply(step(5, 1, NodeEvent(EventKind.MERGED, 3, into=1)))
    assert set(partition.labels.tolist()) == {1}


def test_active_nodes_are_those_that_were_activated_and_have_not_merged():
    partition = Partition()
    partition.apply(step(0, 1, NodeEvent(EventKind.CREATED, 1, frames=(0,)), NodeEvent(EventKind.ACTIVATED, 1)))
    partition.apply(step(1, 2, NodeEvent(EventKind.CREATED, 2, frames=(1,))))
    assert partition.active == {1}
    partition.apply(step(2, 2, NodeEvent(EventKind.ACTIVATED, 2)))
    assert (set(partition.active), partition.count) == ({1, 2}, 2)
    partition.apply(step(3, 2, NodeEvent(EventKind.MERGED, 1, into=2)))
    assert (set(partition.active), partition.count) == ({2}, 1)


def test_labels_handed_out_are_not_the_partitions_own():
    partition = replay(1, 2)
    partition.labels[:] = 9
    assert partition.labels.tolist() == [1, 2]


def test_steps_out_of_order_are_refused():
    with pytest.raises(ValueError, match="expected frame 2, got 5"):
        replay(1, 1).apply(step(5, 1))


def test_transitions_pass_over_unassigned_images_and_ignore_direction():
    labels = np.array([1, 1, 0, 2, 2, 1, 0, 0, 1, 3])
    assert count_transitions(labels) == {(1, 2): 2, (1, 3): 1}


def test_merging_two_nodes_removes_the_transition_between_them():
    partition = replay(1, 2, 3)
    assert partition.transitions() == {(1, 2): 1, (2, 3): 1}
    partition.apply(step(3, 2, NodeEvent(EventKind.MERGED, 3, into=2)))
    assert partition.transitions() == {(1, 2): 1}


@pytest.mark.parametrize("labels", [[], [0, 0], [4], [0, 7, 0]])
def test_a_map_of_less_than_two_nodes_has_no_transitions(labels):
    assert count_transitions(np.array(labels, np.int64)) == {}


@given(st.lists(st.integers(0, 5), max_size=300))
def test_transitions_count_what_a_walk_along_the_labels_counts(labels):
    counts: dict[tuple[int, int], int] = {}
    previous = 0
    for label in labels:
        if label and previous and label != previous:
            edge = (min(label, previous), max(label, previous))
            counts[edge] = counts.get(edge, 0) + 1
        previous = label or previous
    assert replay(*(label or None for label in labels)).transitions() == counts


def test_the_share_unassigned_follows_the_labels():
    assert Partition().unassigned == 0.0
    assert replay(1, 1, None, 2).unassigned == 0.25
