"""Intervals of means: hand-computed, against SciPy, and under what must not change them."""

import numpy as np
import pytest
from scipy.stats import bootstrap, norm, t

from omnieval.statistics.estimate import FEWEST, Estimate, mean_estimate, tail


def test_few_values_have_a_mean_and_no_interval():
    assert mean_estimate(np.array([])) == Estimate(None, None, None, 0)
    assert mean_estimate(np.array([1.0, 2.0])) == Estimate(1.5, None, None, 2)
    assert mean_estimate(np.ones(FEWEST)) == Estimate(1.0, 1.0, 1.0, FEWEST)


def test_the_tail_is_students_and_ends_at_the_normal_one():
    assert tail(5) == pytest.approx(norm.cdf(t.ppf(0.025, 4) * np.sqrt(5 / 4)))
    assert tail(1_000_000) == pytest.approx(0.025, abs=1e-5)
    assert tail(5) < tail(20) < 0.025
    assert tail(20, wider=1.5) < tail(20)


def test_the_interval_is_scipys_percentile_interval_of_the_wider_level():
    values = np.random.default_rng(3).lognormal(size=30)
    ours = mean_estimate(values)
    theirs = bootstrap(
        (values,),
        np.mean,
        n_resamples=20_000,
        confidence_level=1 - 2 * tail(30),
        method="percentile",
        random_state=np.random.default_rng(0),
    ).confidence_interval
    assert ours.value == pytest.approx(values.mean())
    assert (ours.low, ours.high) == pytest.approx(tuple(theirs), abs=0.1 * values.std())


def test_shifted_and_stretched_values_have_a_shifted_and_stretched_interval():
    values = np.random.default_rng(4).normal(size=12)
    one, other = mean_estimate(values), mean_estimate(3 * values + 7)
    assert [other.low, other.high] == pytest.approx((3 * np.array([one.low, one.high]) + 7).tolist())


def test_the_seed_decides():
    values = np.random.default_rng(5).normal(size=12)
    assert mean_estimate(values) == mean_estimate(values)
    assert mean_estimate(values, seed=1) != mean_estimate(values)
