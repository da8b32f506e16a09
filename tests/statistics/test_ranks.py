"""Mean ranks, Friedman's test by its formula, and the sets of methods that a diagram joins."""

import numpy as np
import pytest
from scipy.stats import chi2

from omnieval.statistics.ranks import cliques, mean_ranks

VALUES = np.array([[0.9, 0.5, 0.1], [0.8, 0.85, 0.2], [0.7, 0.7, 0.3], [0.6, 0.2, 0.1]])


def test_ranks_by_hand():
    found = mean_ranks(VALUES, higher_is_better=True)
    assert found.ranks == pytest.approx(((1 + 2 + 1.5 + 1) / 4, (2 + 1 + 1.5 + 2) / 4, 3.0))
    assert found.cases == 4
    assert mean_ranks(-VALUES, higher_is_better=False).ranks == found.ranks
    assert mean_ranks(np.exp(VALUES), higher_is_better=True).ranks == found.ranks


def test_friedmans_p_by_its_formula():
    untied = np.delete(VALUES, 2, axis=0)
    found = mean_ranks(untied, higher_is_better=True)
    cases, methods = untied.shape
    sums = cases * np.array(found.ranks)
    statistic = 12 / (cases * methods * (methods + 1)) * (sums**2).sum() - 3 * cases * (methods + 1)
    assert found.p == pytest.approx(chi2.sf(statistic, methods - 1))
    assert mean_ranks(np.ones((4, 3)), higher_is_better=True).p == 1.0
    assert mean_ranks(VALUES[:, :2], higher_is_better=True).p is None
    assert mean_ranks(VALUES[:1], higher_is_better=True).p is None


def test_neighbours_that_cannot_be_told_apart_are_joined():
    apart = np.zeros((4, 4), bool)
    assert cliques([3.0, 1.0, 2.0, 4.0], apart) == [(1, 2, 0, 3)]
    apart[1, 3] = apart[3, 1] = True
    assert cliques([3.0, 1.0, 2.0, 4.0], apart) == [(1, 2, 0), (2, 0, 3)]
    assert cliques([3.0, 1.0, 2.0, 4.0], ~np.eye(4, dtype=bool)) == []
