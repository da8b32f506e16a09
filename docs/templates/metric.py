"""A metric of your own, to start from: ``cp docs/templates/metric.py mine.py``, ``pytest mine.py``.

Judge runs with it: ``python mine.py runs/*``. How it becomes one of omnieval's own: ``CONTRIBUTING.md``.
"""

import dataclasses
import sys

import numpy as np
import polars as pl

import omnieval
from omnieval import Judged
from omnieval.testing import check_metric


def node_radius(judged: Judged) -> float | str:
    """Return how far images are from the middle of their node: root mean square, mean over nodes, metres.

    Parameters
    ----------
    judged
        The node of every image, and where each was truly taken.

    Returns
    -------
    float or str
        Where there is no value, the sentence that says why: never 0, never NaN.
    """
    known = (judged.labels > 0) & np.isfinite(judged.positions).all(axis=1)
    labels, positions = judged.labels[known], judged.positions[known]
    if not len(labels):
        return "no image has both a node and a position"
    spreads = [positions[labels == node].std(axis=0) for node in np.unique(labels)]
    return float(np.mean([np.linalg.norm(spread) for spread in spreads]))


def made(labels, positions):
    return Judged(np.array(labels), np.array(positions, float), [None] * len(labels), [None] * len(labels))


def test_it_keeps_the_contract_of_metrics():
    check_metric(node_radius)


def test_it_is_what_a_hand_computes():
    # Node 1: two images, 2 m apart, so each is 1 m from their middle. Node 2: one image. Mean over nodes: 0.5 m.
    assert node_radius(made([1, 1, 2], [[0, 0], [2, 0], [9, 9]])) == 0.5
    # Images without a node or a position count for nothing, and of nothing there is no metric.
    nowhere = [np.nan, np.nan]
    assert node_radius(made([1, 1, 2, 0, 2], [[0, 0], [2, 0], [9, 9], [50, 50], nowhere])) == 0.5
    assert node_radius(made([0, 2], [[50, 50], nowhere])) == "no image has both a node and a position"


def test_it_does_not_depend_on_where_the_origin_is():
    rng = np.random.default_rng(0)
    judged = made(rng.integers(0, 4, 40), rng.normal(size=(40, 2)))
    moved = node_radius(dataclasses.replace(judged, positions=judged.positions + np.array([3.0, -7.0])))
    assert abs(moved - node_radius(judged)) < 1e-9


if __name__ == "__main__":
    for folder in sys.argv[1:]:
        steps = omnieval.open_run(folder).steps
        places = steps.select(pl.col("x", "y").cast(float)).fill_null(float("nan")).to_numpy()
        labels, rooms = steps["node_final"].fill_null(0).to_numpy(), steps["room"].to_list()
        print(folder, node_radius(Judged(labels, places, rooms, [None] * len(steps))))
