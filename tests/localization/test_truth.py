"""What answers are worth, on a map of four images on a line, one metre apart."""

import math

import numpy as np
import pytest

from omnieval.localization.strategies import Found
from omnieval.localization.truth import Truth, heading_between, truth_of
from omnieval.mapping.map import TopologicalMap
from omnieval.mapping.step import Match, Role, Step


def line(xy=((0, 0), (1, 0), (2, 0), (3, 0)), labels=(1, 1, 2, 2)):
    count = len(xy)
    return TopologicalMap(
        files=np.array([f"{k}.png" for k in range(count)]),
        times=np.arange(count),
        xy=np.array(xy, float),
        yaws=np.zeros(count),
        rooms=np.array([""] * count),
        positions=np.zeros((count, 2), np.float32),
        orientations=np.zeros((count, 8, 1), np.float32),
        labels=np.array(labels),
        nodes=np.unique(labels),
        active=np.ones(len(set(labels)), bool),
        representatives=np.zeros((len(set(labels)), 2)),
        representative_frames=np.zeros(len(set(labels)), int),
        edges=np.zeros((0, 3), int),
        about={},
    )


def found(frame, ranked, node=1, shift=0):
    step = Step(0, "assigned", Role.JOINED, node, Match(frame, node, shift))
    return Found(step, (node,), np.array(ranked), 0.5)


def test_errors_and_ranks_by_hand():
    # The query was taken at x = 2.1; the answer is image 0, then 3, then 2.
    truth = truth_of(line(), found(0, [0, 3, 2, 1]), (2.1, 0.0), None, 0.5)
    assert truth.error == pytest.approx(2.1)
    assert truth.reachable_frame == 2
    assert truth.reachable == pytest.approx(0.1)
    assert truth.nearest_rank == 4
    assert truth.rank == 3
    assert truth.node_right is False
    assert truth.heading_error is None


def test_a_node_is_right_where_any_of_its_images_is_near():
    assert truth_of(line(), found(3, [3], node=2), (2.1, 0.0), None, 0.5).node_right is True


def test_of_a_refused_query_only_what_could_be_had_is_known():
    refused = Found(Step(0, "no-candidate", Role.REFUSED), (), np.array([], int), 9.0)
    truth = truth_of(line(), refused, (2.1, 0.0), 0.3, 0.5)
    assert truth.reachable == pytest.approx(0.1)
    assert truth == Truth(reachable_frame=2, reachable=truth.reachable)


def test_without_positions_nothing_is_known():
    unposed = line(xy=[(math.nan, math.nan)] * 4)
    assert truth_of(unposed, found(0, [0]), (1.0, 0.0), None, 0.5) == Truth()
    assert truth_of(line(), found(0, [0]), None, None, 0.5) == Truth()


def test_images_of_the_map_without_a_position_are_passed_over():
    partly = line(xy=[(math.nan, math.nan), (1, 0), (2, 0), (3, 0)])
    truth = truth_of(partly, found(0, [0, 1]), (1.0, 0.0), None, 0.5)
    assert (truth.error, truth.nearest_rank, truth.rank, truth.reachable) == (None, None, 2, 0.0)


@pytest.mark.parametrize(
    ("yaw", "other", "shift", "error"),
    [
        (0.0, 0.0, 0, 0.0),
        (math.pi / 2, 0.0, 2, 0.0),
        (-math.pi, math.pi, 0, 0.0),
        (0.0, 0.0, 4, 180.0),
        (0.1, 0.0, 7, 50.7296),
    ],
)
def test_the_heading_is_that_of_the_image_turned_by_its_shift(yaw, other, shift, error):
    assert heading_between(yaw, other, shift, 8) == pytest.approx(error, abs=1e-4)
