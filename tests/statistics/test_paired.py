"""Paired differences: the test against its own definition, Holm's correction by hand."""

import itertools

import numpy as np
import pytest

from omnieval.statistics.paired import holm, paired_difference


def enumerated_p(differences):
    """Two-sided p of the signed rank test: over all signs that chance could have given; ties share their ranks."""
    sizes = np.abs(differences)
    ranks = np.array([(sizes < one).sum() + ((sizes == one).sum() + 1) / 2 for one in sizes])
    seen = abs((np.sign(differences) * ranks).sum())
    chances = [abs((np.array(signs) * ranks).sum()) for signs in itertools.product((-1, 1), repeat=len(ranks))]
    return np.mean([one >= seen for one in chances])


def test_the_p_value_is_that_of_all_signs():
    one = np.array([4.0, -1.0, 0.5, 2.5, 4.0, -0.25])
    other = np.zeros(6)
    found = paired_difference(one, other)
    assert found.p == pytest.approx(enumerated_p(one))
    assert found.mean.value == pytest.approx(9.75 / 6)
    assert found.mean.n == 6
    assert found.effect == pytest.approx((5.5 + 5.5 + 4 + 2 - 1 - 3) / 21)
    one[0] = 5.0  # no tie any more
    assert paired_difference(one, other).p == pytest.approx(enumerated_p(one))


def test_the_other_way_round_is_the_opposite():
    rng = np.random.default_rng(0)
    one, other = rng.normal(size=(2, 15))
    there, back = paired_difference(one, other), paired_difference(other, one)
    assert there.p == back.p
    assert np.array([there.effect, there.mean.value]) == pytest.approx(-np.array([back.effect, back.mean.value]))


def test_equal_methods_do_not_differ():
    values = np.arange(8.0)
    found = paired_difference(values, values)
    assert (found.p, found.effect, found.mean.value) == (1.0, 0.0, 0.0)
    nothing = paired_difference(values[:0], values[:0])
    assert (nothing.p, nothing.effect, nothing.mean.n) == (None, None, 0)


def test_holm_by_hand():
    # 0.01 x 4; 0.02 x 3; 0.03 x 2; 0.5 x 1, never below what came before.
    assert holm([0.5, 0.01, 0.03, 0.02]) == pytest.approx([0.5, 0.04, 0.06, 0.06])
    assert holm([0.9, 0.8]) == [1.0, 1.0]
    assert holm([None, 0.01]) == [None, 0.01]
    assert holm([]) == []
