"""Moving blocks: how images are drawn, and that the intervals cover what they should."""

import numpy as np
import pytest
from scipy.signal import lfilter

from omnieval.statistics import blocks as module
from omnieval.statistics.blocks import Blocks, block_estimate, mean_of

SECOND = 10**9


def stamps(images, apart_s=0.2):
    return np.round(np.arange(images) * apart_s * SECOND).astype(np.int64)


def ends(found):
    assert found.low is not None
    return found.low, found.high


def width(found):
    low, high = ends(found)
    return high - low


def test_a_block_is_ten_seconds_long():
    assert Blocks.of(stamps(1000), SECOND) == Blocks(1000, 50)
    assert Blocks.of(stamps(1000, apart_s=1.0), SECOND) == Blocks(1000, 10)
    assert Blocks.of(stamps(20), SECOND) == Blocks(20, 20)
    assert Blocks.of(stamps(1), SECOND) == Blocks(1, 1)
    assert Blocks.of(np.zeros(9, np.int64), SECOND) == Blocks(9, 9)


def test_every_resample_has_as_many_images_in_runs_of_a_block():
    counts = Blocks(103, 10).counts(400, np.random.default_rng(0))
    assert (counts.sum(axis=1) == 103).all()
    assert counts.mean(axis=0) == pytest.approx(np.ones(103), abs=0.25)  # wrapped: the ends are drawn as often
    (one,) = Blocks(10, 10).counts(1, np.random.default_rng(0))
    assert one.tolist() == [1] * 10
    (two,) = Blocks(9, 3).counts(1, np.random.default_rng(1))
    starts = np.random.default_rng(1).integers(9, size=(1, 3))[0]
    drawn = np.concatenate([(start + np.arange(3)) % 9 for start in starts])
    assert two.tolist() == np.bincount(drawn, minlength=9).tolist()


def test_images_without_a_value_do_not_count():
    mean = mean_of(np.array([1.0, np.nan, 4.0]))
    counts = np.array([[1, 1, 1], [2, 5, 1], [0, 3, 0]], np.int32)
    found = mean(counts)
    assert found[:2].tolist() == [2.5, 2.0]
    assert np.isnan(found[2])


def test_a_short_run_has_a_value_and_no_interval():
    found = block_estimate(Blocks(40, 10), mean_of(np.arange(40.0)))
    assert (found.value, found.low, found.high) == (19.5, None, None)
    assert block_estimate(Blocks(40, 10), mean_of(np.full(40, np.nan))).value is None


def test_a_constant_has_no_width():
    found = block_estimate(Blocks(100, 10), mean_of(np.ones(100)))
    assert (found.low, found.value, found.high) == (1.0, 1.0, 1.0)


def test_the_more_images_resemble_their_neighbours_the_wider(monkeypatch):
    monkeypatch.setattr(module, "RESAMPLES", 400)
    rng = np.random.default_rng(2)
    values = np.repeat(rng.normal(size=60), 10)
    one = block_estimate(Blocks(600, 50), mean_of(values))
    other = block_estimate(Blocks(600, 50), mean_of(rng.permutation(values)))
    assert width(one) > 1.5 * width(other)


def test_nearly_all_intervals_cover_the_truth(monkeypatch):
    """Five images a second that forget in 2 s: intervals of 95 % cover 114 of 120, with a standard deviation of 2.4."""
    monkeypatch.setattr(module, "RESAMPLES", 300)
    rng = np.random.default_rng(7)
    keep = np.exp(-0.2 / 2.0)
    covered = 0
    for _ in range(120):
        series = lfilter([1.0], [1.0, -keep], rng.normal(size=1400))[400:]
        found = block_estimate(Blocks(1000, 50), mean_of(series))
        low, high = ends(found)
        covered += low <= 0.0 <= high
    assert 107 <= covered <= 119
