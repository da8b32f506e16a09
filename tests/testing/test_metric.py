"""`check_metric` accepts the metrics that compute themselves, and says of a bad one which clause it breaks."""

from typing import Any

import numpy as np
import pytest

from omnieval.metrics.catalogue import CATALOGUE
from omnieval.testing import check_metric


@pytest.mark.parametrize("metric", [one for one in CATALOGUE if one.compute], ids=lambda one: one.name)
def test_metrics_of_omnieval_keep_the_contract(metric):
    check_metric(metric.compute)


def spoil(judged):
    judged.labels[0] += 1
    return 1.0


def once():
    values = iter(range(1000))
    return lambda judged: next(values)


@pytest.mark.parametrize(
    ("compute", "said"),
    [
        (lambda judged: None, "a map: a metric must be a finite number, or a sentence .* got None"),
        (lambda judged: "", "a finite number, or a sentence .* got ''"),
        (lambda judged: float(judged.positions.mean()), "a map with some positions: .* got nan"),
        (lambda judged: float(judged.labels.mean()), "must not depend on the numbers of nodes"),
        (spoil, "must not change what it is given"),
        (once(), "must be the same twice"),
        (lambda judged: len(set(filter(None, judged.rooms))) or float("inf"), "a map without rooms: .* got inf"),
    ],
)
def test_a_clause_that_does_not_hold_is_named(compute, said):
    with pytest.raises(AssertionError, match=said):
        check_metric(compute)


def test_an_array_of_one_number_is_no_number():
    def compute(judged) -> Any:
        return np.ones(1)

    with pytest.raises(AssertionError, match="got array"):
        check_metric(compute)
