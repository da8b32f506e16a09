"""The silhouettes against scikit-learn, the plain oracle, and numbers worked out by hand."""

import dataclasses

import numpy as np
import pytest
from sklearn.metrics import silhouette_samples

from omnieval.metrics.silhouette import IncrementalSilhouette, silhouettes
from tests.reference.silhouette import silhouettes as plain_silhouettes

SEEDS = range(6)


def random_partition(seed: int, n: int = 60, k: int = 5):
    rng = np.random.default_rng(seed)
    labels = rng.integers(1, k + 1, n)
    labels[:k] = np.arange(1, k + 1)
    labels[-1] = k + 7  # a singleton, and a gap in the labels
    return rng.normal(size=(n, 2)) + labels[:, None], labels


def test_two_pairs_on_a_line_by_hand():
    positions = np.array([[0.0, 0], [1, 0], [10, 0], [13, 0]])
    found = silhouettes(positions, np.array([1, 1, 2, 2]))
    scores = np.array([(11.5 - 1) / 11.5, (10.5 - 1) / 10.5, (9.5 - 3) / 9.5, (12.5 - 3) / 12.5])
    assert found.silhouette == pytest.approx(scores.mean())
    assert found.silhouette_image == pytest.approx(scores.mean())
    assert found.silhouette_literal == pytest.approx(scores.mean())
    squared = [(134.5 - 1) / 134.5, (112.5 - 1) / 112.5, (90.5 - 9) / 90.5, (156.5 - 9) / 156.5]
    assert found.silhouette_sq == pytest.approx(np.mean(squared))


@pytest.mark.parametrize("seed", SEEDS)
def test_image_average_is_that_of_scikit_learn(seed):
    positions, labels = random_partition(seed)
    samples = silhouette_samples(positions, labels)
    found = silhouettes(positions, labels)
    assert found.silhouette_image == pytest.approx(samples.mean())
    assert found.silhouette == pytest.approx(np.mean([samples[labels == c].mean() for c in np.unique(labels)]))
    squared = silhouette_samples(positions, labels, metric="sqeuclidean")
    assert found.silhouette_sq == pytest.approx(np.mean([squared[labels == c].mean() for c in np.unique(labels)]))


@pytest.mark.parametrize("seed", SEEDS)
def test_all_four_agree_with_the_plain_implementation(seed):
    positions, labels = random_partition(seed, n=30, k=4)
    expected = plain_silhouettes([tuple(p) for p in positions.tolist()], labels.tolist())
    found = dataclasses.asdict(silhouettes(positions, labels))
    assert found == pytest.approx({name: expected[name] for name in found})


def test_blocks_do_not_change_the_result(monkeypatch):
    positions, labels = random_partition(3)
    whole = silhouettes(positions, labels)
    monkeypatch.setattr("omnieval.metrics.silhouette._BLOCK_VALUES", 7 * len(labels))
    in_blocks = silhouettes(positions, labels)
    assert in_blocks.silhouette == pytest.approx(whole.silhouette, abs=1e-12)
    assert in_blocks.silhouette_literal == pytest.approx(whole.silhouette_literal, abs=1e-12)


def test_identical_positions_score_zero():
    found = silhouettes(np.zeros((4, 2)), np.array([1, 1, 2, 2]))
    assert found.silhouette == 0.0
    assert found.silhouette_literal == 0.0


def test_clusters_without_a_known_position_are_merged_like_others():
    """Their images are left out, so that they have none to move, or none to move them to."""
    positions = np.array([[0.0, 0], [1, 0], [9, 0], [np.nan, np.nan]])
    follower = IncrementalSilhouette()
    for position in positions[:2]:
        follower.add(tuple(position), 1)
    follower.add(tuple(positions[2]), 2)
    follower.merge(7, 1)
    follower.merge(2, 8)
    labels = np.array([1, 1, 8, 7])
    assert follower.value() == pytest.approx(silhouettes(positions, labels).silhouette)


def test_one_cluster_has_no_silhouette():
    with pytest.raises(ValueError, match="two clusters"):
        silhouettes(np.zeros((3, 2)), np.ones(3, np.int64))


@pytest.mark.parametrize("seed", SEEDS)
def test_incremental_silhouette_follows_additions_and_merges(seed):
    rng = np.random.default_rng(seed)
    positions, labels = random_partition(seed, n=90, k=12)
    follower = IncrementalSilhouette()
    so_far = np.empty(0, np.int64)
    for index, label in enumerate(labels):
        follower.add(tuple(positions[index]), int(label))
        so_far = np.append(so_far, label)
        present = np.unique(so_far)
        if index % 17 == 16:
            gone, into = rng.choice(present, 2, replace=False)
            follower.merge(int(gone), int(into))
            so_far[so_far == gone] = into
        value = follower.value()
        if len(np.unique(so_far)) < 2:
            assert value is None
        else:
            assert value == pytest.approx(silhouettes(positions[: index + 1], so_far).silhouette, abs=1e-9)
