"""Metrics over resampled images are those of the catalogue where every image counts once."""

import numpy as np
import pytest

import omnieval
from omnieval.comparison.records import read_records
from omnieval.metrics.ground import Ground
from omnieval.metrics.pairs import pair_scores
from omnieval.metrics.resampled import resampled_metrics

SECOND = 10**9


def world(images=400, seed=0):
    """A robot that goes round a square twice, with nodes by where it is, some of them wrong."""
    rng = np.random.default_rng(seed)
    angle = np.linspace(0, 4 * np.pi, images)
    positions = 8 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    labels = (angle % (2 * np.pi) // (np.pi / 3)).astype(np.int64) + 1
    labels[rng.random(images) < 0.1] = 0
    times = [int(0.2 * SECOND * image) for image in range(images)]
    return positions, labels, times


def statistics_of(positions, labels, times):
    placements = ["loop-closure" if label else "unassigned" for label in labels]
    rooms = [f"R{label % 2}" if image % 3 else None for image, label in enumerate(labels)]
    return resampled_metrics(labels, placements, positions, times, rooms, [0, 100])


def test_a_run_has_the_metrics_it_had(panoramas, tmp_path):
    run = omnieval.replay(panoramas, n_init=10, n_new=10, gamma=1.0, out=tmp_path / "run")
    (record,) = read_records([run.folder])
    known = ["pair_precision", "pair_recall", "pair_f1", "silhouette_image", "coverage_1m", "coverage_2m"]
    known += ["share_assigned", "share_founding", "share_unassigned", "rooms_purity"]
    for name in known:
        found = record.within(name)  # None if it were another value
        assert found is not None, name
        assert found.value == pytest.approx(run.metrics[name])
    assert record.within("silhouette") is None


def test_pairs_over_some_images_are_those_of_a_map_without_the_others():
    positions, labels, times = world()
    chosen = np.random.default_rng(1).random(len(labels)) < 0.6
    ground = Ground(positions[chosen], [time for time, one in zip(times, chosen, strict=True) if one])
    expected = pair_scores(labels[chosen], ground, [2.0])[2.0]
    found = statistics_of(positions, labels, times)
    counts = chosen.astype(np.int32)[np.newaxis]
    assert found["pair_precision"](counts)[0] == pytest.approx(expected.precision.value)
    assert found["pair_recall"](counts)[0] == pytest.approx(expected.recall.value)
    assert found["pair_f1"](counts)[0] == pytest.approx(expected.f1)


def test_images_that_count_twice_count_as_two():
    positions, labels, times = world(images=300)
    counts = np.random.default_rng(2).integers(3, size=300).astype(np.int32)
    twice = np.repeat(np.arange(300), counts)
    ground = Ground(positions[twice], [times[image] for image in twice])
    expected = pair_scores(labels[twice], ground, [2.0])[2.0]
    found = statistics_of(positions, labels, times)["pair_f1"](counts[np.newaxis])[0]
    assert found == pytest.approx(expected.f1)


def test_of_nothing_there_is_no_value():
    positions, labels, times = world()
    found = statistics_of(positions, np.zeros_like(labels), times)
    once = np.ones((1, len(labels)), np.int32)
    assert np.isnan(found["pair_precision"](once)[0])
    assert found["pair_f1"](once)[0] == 0.0
    assert "silhouette_image" not in found
    assert set(statistics_of(np.full_like(positions, np.nan), labels, times)) == {
        *(f"share_{what}" for what in ("assigned", "pending", "founding", "retest", "forced", "unassigned")),
        "rooms_purity",
    }
