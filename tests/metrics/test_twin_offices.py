"""The twin offices of the built-in building in one node: a false merge, and a way through the walls."""

import numpy as np

from omnieval.datasets.synthetic.day import day_of
from omnieval.datasets.synthetic.drives import drive
from omnieval.datasets.synthetic.first import FIRST
from omnieval.metrics.evaluation import evaluate
from omnieval.metrics.quality import Making


def judged(labels, tour):
    """The metrics of a map whose nodes are represented by their deepest image."""
    y = np.abs(tour.poses[:, 1])
    representatives = {
        int(node): int(np.flatnonzero(labels == node)[y[labels == node].argmax()]) for node in np.unique(labels)
    }
    times = [round(1e9 * seconds) for seconds in tour.times]
    making = Making(labels, representatives, 256, 256)
    return evaluate(labels, None, tour.poses[:, :2], rooms=None, seed=0, times=times, making=making).metrics


def test_twin_offices_in_one_node_are_a_false_merge_and_a_way_through_the_walls():
    tour = drive(day_of(FIRST, "cloudy"), 0)
    codes = [FIRST.room_at(x, y).code for x, y, _ in tour.poses]
    corridor = np.array([FIRST.room_at(x, y).corridor for x, y, _ in tour.poses])
    rooms = np.unique(codes, return_inverse=True)[1] + 1
    # A node each room, and each two metres of the corridor.
    honest = np.where(corridor, 100 + (tour.poses[:, 0] // 2).astype(int), rooms)
    first, second = (rooms[codes.index(code)] for code in FIRST.twins)
    merged = np.where(honest == second, first, honest)
    one, other = judged(honest, tour), judged(merged, tour)
    assert one["false_merge_share"] == one["false_merge_images"] == 0.0
    assert other["false_merge_share"] == 1 / (len(np.unique(honest)) - 1)
    assert other["false_merge_images"] == np.isin(honest, (first, second)).mean()
    assert other["pair_precision"] < one["pair_precision"]
    assert other["reentry_precision"] < one["reentry_precision"]
    assert other["stretch_p5"] < one["stretch_p5"]
    assert other["stretch_p5"] < 0.9
    assert other["loops"] > one["loops"]
