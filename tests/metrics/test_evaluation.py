"""The metrics of a map: shares, controls, and null with a reason."""

import numpy as np
import pytest

from omnieval.baselines.controls import position_clusters, time_slices
from omnieval.mapping.step import Placement
from omnieval.metrics.evaluation import evaluate
from omnieval.metrics.silhouette import silhouettes

SILHOUETTES = {"silhouette", "silhouette_image", "silhouette_literal", "silhouette_sq"}
CONTROLS = {"silhouette_time_slices", "silhouette_positions"}
AGREEMENT = {"rooms_ari", "rooms_nmi", "rooms_homogeneity", "rooms_completeness", "rooms_purity"}


def a_map():
    positions = np.array([[0.0, 0], [1, 0], [10, 0], [11, 0], [20, 0], [21, 0], [5, 5], [6, 6]])
    labels = np.array([1, 1, 2, 2, 4, 4, 0, 2])
    placements = [Placement.FOUNDING] * 4 + [Placement.LOOP_CLOSURE, Placement.PENDING]
    return labels, [*placements, Placement.UNASSIGNED, Placement.FORCED], positions


def test_shares_count_every_image_once():
    labels, placements, positions = a_map()
    metrics = evaluate(labels, placements, positions, rooms=None, seed=0).metrics
    shares = {name: value for name, value in metrics.items() if name.startswith("share_")}
    assert shares["share_founding"] == 0.5
    assert shares["share_assigned"] == shares["share_pending"] == shares["share_forced"] == 0.125
    assert shares["share_unassigned"] == 0.125
    assert sum(value or 0 for value in shares.values()) == 1.0


def test_unassigned_images_are_left_out_of_the_silhouettes():
    labels, placements, positions = a_map()
    metrics = evaluate(labels, placements, positions, rooms=None, seed=0).metrics
    assert metrics["nodes"] == 3
    assert metrics["silhouette"] == silhouettes(positions[labels > 0], labels[labels > 0]).silhouette


def test_controls_have_as_many_clusters_as_the_map_has_nodes():
    labels, placements, positions = a_map()
    metrics = evaluate(labels, placements, positions, rooms=None, seed=0).metrics
    assert metrics["silhouette_time_slices"] == silhouettes(positions, time_slices(8, 3)).silhouette
    assert metrics["silhouette_positions"] == silhouettes(positions, position_clusters(positions, 3, seed=0)).silhouette
    assert metrics["silhouette_positions"] >= metrics["silhouette_time_slices"]


def test_without_poses_position_metrics_are_null_with_a_reason():
    labels, placements, _ = a_map()
    evaluation = evaluate(labels, placements, None, rooms=None, seed=0)
    assert set(evaluation.reasons) >= SILHOUETTES | CONTROLS | AGREEMENT | {"pair_f1", "reentry_f1", "stretch_median"}
    assert evaluation.metrics["components"] == 1
    assert all(evaluation.metrics[name] is None for name in evaluation.reasons)
    assert "no poses" in evaluation.reasons["silhouette"]
    assert evaluation.metrics["nodes"] == 3


def test_images_without_a_position_are_left_out_and_counted():
    """The silhouettes of part of the images are those of a sequence that has no others."""
    labels, placements, positions = a_map()
    known = np.array([True, True, True, False, True, True, False, True])
    rooms = ["A", None, "A", "B", "B", "B", None, "B"]
    part = evaluate(labels, placements, np.where(known[:, np.newaxis], positions, np.nan), rooms=rooms, seed=0)
    alone = evaluate(labels[known], None, positions[known], rooms=None, seed=0).metrics
    assert {name: part.metrics[name] for name in SILHOUETTES | CONTROLS} == {
        name: alone[name] for name in SILHOUETTES | CONTROLS
    }
    assert (part.metrics["nodes"], part.metrics["posed"], part.metrics["labelled"]) == (3, 6, 6)
    assert not {*part.reasons} & {*SILHOUETTES, *CONTROLS, *AGREEMENT}


def test_positions_in_one_node_only_have_no_silhouette():
    labels, placements, positions = a_map()
    positions[2:] = np.nan
    evaluation = evaluate(labels, placements, positions, rooms=None, seed=0)
    assert evaluation.metrics["posed"] == 2
    assert evaluation.reasons["silhouette"] == "of 8 images 2 have a position, and they lie in fewer than two nodes"


def test_positions_of_which_none_is_known_are_none():
    labels, placements, positions = a_map()
    nothing = np.full_like(positions, np.nan)
    assert evaluate(labels, placements, nothing, rooms=None, seed=0) == evaluate(
        labels, placements, None, rooms=None, seed=0
    )


@pytest.mark.parametrize(("labels", "nodes"), [([0, 0, 0], 0), ([5, 5, 5], 1)])
def test_fewer_than_two_nodes_have_no_silhouette(labels, nodes):
    evaluation = evaluate(np.array(labels), [Placement.FOUNDING] * 3, np.eye(3, 2), rooms=None, seed=0)
    assert evaluation.metrics["nodes"] == nodes
    assert f"the map has {nodes}" in evaluation.reasons["silhouette"]


def test_every_image_its_own_node_among_equal_positions():
    evaluation = evaluate(np.arange(1, 4), [Placement.FOUNDING] * 3, np.zeros((3, 2)), rooms=None, seed=0)
    assert evaluation.metrics["silhouette"] == 0.0
    assert evaluation.metrics["silhouette_positions"] is None
    assert "fewer different positions" in evaluation.reasons["silhouette_positions"]


@pytest.mark.parametrize(("count", "clusters"), [(10, 3), (7, 7), (1000, 13)])
def test_time_slices_are_equal_to_one_image_and_in_order(count, clusters):
    labels = time_slices(count, clusters)
    sizes = np.bincount(labels)[1:]
    assert sizes.size == clusters
    assert np.ptp(sizes) <= 1
    assert (np.diff(labels) >= 0).all()


def test_position_clusters_find_separated_groups_whatever_the_seed():
    truth = np.repeat([0, 1, 2], 10)
    positions = np.random.default_rng(1).normal(size=(30, 2), scale=0.1) + 10 * np.eye(3, 2)[truth]
    for seed in range(3):
        labels = position_clusters(positions, 3, seed=seed)
        assert all(len(set(labels[truth == group])) == 1 for group in range(3))
        assert len(set(labels)) == 3
