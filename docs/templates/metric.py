"""A metric of your own, to start from: ``cp docs/templates/metric.py mine.py``, ``pytest mine.py``.

Judge runs with it: ``python mine.py runs/*``. How a metric becomes one of omnieval's own: ``CONTRIBUTING.md``.
"""

import sys

import numpy as np
import polars as pl
from numpy.typing import NDArray

import omnieval


def node_radius(labels: NDArray[np.int64], positions: NDArray[np.float64]) -> float | None:
    """Return how far images are from the middle of their node: root mean square, mean over nodes, metres.

    Parameters
    ----------
    labels
        Node of every image, 0 where it has none, shape (n,).
    positions
        Where each was truly taken, shape (n, 2), metres, NaN where that is not known.

    Returns
    -------
    float or None
        None if no image has both a node and a position: say that there is no value, never 0.

    Examples
    --------
    >>> node_radius(np.array([1, 1, 2]), np.array([[0.0, 0.0], [2.0, 0.0], [9.0, 9.0]]))
    0.5
    """
    known = (labels > 0) & np.isfinite(positions).all(axis=1)
    labels, positions = labels[known], positions[known]
    if not len(labels):
        return None
    spreads = [positions[labels == node].std(axis=0) for node in np.unique(labels)]
    return float(np.mean([np.linalg.norm(spread) for spread in spreads]))


def test_it_is_what_a_hand_computes():
    # Node 1: two images, 2 m apart, so each is 1 m from their middle. Node 2: one image. Mean over nodes: 0.5 m.
    labels, positions = np.array([1, 1, 2]), np.array([[0.0, 0.0], [2.0, 0.0], [9.0, 9.0]])
    assert node_radius(labels, positions) == 0.5
    # Images without a node or a position count for nothing, and of nothing there is no metric.
    more = np.array([0, 2]), np.array([[50.0, 50.0], [np.nan, np.nan]])
    assert node_radius(np.append(labels, more[0]), np.vstack([positions, more[1]])) == 0.5
    assert node_radius(*more) is None


def test_it_does_not_depend_on_where_the_origin_is():
    rng = np.random.default_rng(0)
    labels, positions = rng.integers(0, 4, 40), rng.normal(size=(40, 2))
    moved = node_radius(labels, positions + np.array([3.0, -7.0]))
    assert moved is not None
    assert abs(moved - (node_radius(labels, positions) or 0.0)) < 1e-9


if __name__ == "__main__":
    for folder in sys.argv[1:]:
        steps = omnieval.open_run(folder).steps
        labels, positions = steps["node_final"].fill_null(0).to_numpy(), steps.select(pl.col("x", "y").cast(float))
        print(folder, node_radius(labels, positions.fill_null(float("nan")).to_numpy()))
