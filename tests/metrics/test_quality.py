"""The quality of a map: exact values on maps made by hand, and plain loops over pairs on random ones."""

from itertools import combinations

import numpy as np
import pytest

from omnieval.mapping.partition import count_transitions
from omnieval.metrics import graph as graphs
from omnieval.metrics import ground as grounds
from omnieval.metrics.events import borders, reentries, visits
from omnieval.metrics.graph import Ways, coverage, shape
from omnieval.metrics.ground import THETAS, Clock, Ground
from omnieval.metrics.pairs import SMALLEST_GROUP, false_merges, nodes_per_place, pair_scores
from omnieval.metrics.proportion import Proportion
from tests.reference import quality as plain

SECOND = 10**9


def at_seconds(*seconds):
    return [round(second * SECOND) for second in seconds]


def worlds():
    """Random walks over a few lines and corners, with stops, loose images, and nodes of all kinds."""
    for seed in range(12):
        rng = np.random.default_rng(seed)
        count = int(rng.integers(20, 90))
        steps = rng.choice([0.0, 0.3, 0.4, 1.0], (count, 2)) * rng.choice([-1, 1], (count, 2))
        if seed % 3 == 0:
            steps[:, 1] = 0.0  # a corridor
        positions = np.abs(np.cumsum(steps, axis=0) % 6 - 3) + (0.01 * rng.normal(size=(count, 2)) if seed % 2 else 0)
        times = np.cumsum(rng.choice([0, 1, 4], count)) * SECOND
        labels = np.repeat(rng.integers(0, 6, count), 5)[:count] if seed % 4 else rng.integers(0, 4, count)
        yield Ground(positions, times.tolist()), labels.astype(np.int64)


@pytest.mark.parametrize("theta", THETAS)
def test_pairs_events_and_places_are_those_of_plain_loops(theta):
    for ground, labels in worlds():
        world = ground.positions.tolist(), ground.clock.stamps.tolist(), labels.tolist(), ground.apart, theta
        scores = pair_scores(labels, ground, [theta])[theta]
        assert (scores.together, scores.near, scores.both) == plain.pair_counts(*world)
        merges = false_merges(labels, ground, [theta])[theta]
        found = plain.false_merges(ground.positions.tolist(), labels.tolist(), theta, SMALLEST_GROUP)
        assert (merges.nodes.hits, merges.images.hits) == found
        assert nodes_per_place(labels, ground, theta) == plain.nodes_per_place(*world)
        events = reentries(labels, ground, [theta])[theta]
        counts = events.precision.hits, events.precision.count, events.recall.hits, events.recall.count
        assert counts == plain.reentries(*world)


def test_blocks_change_nothing(monkeypatch):
    whole = [(ground.positions, ground.near(THETAS)) for ground, _ in worlds()]
    monkeypatch.setattr(grounds, "_BLOCK_PAIRS", 7)
    for (_, before), (ground, _) in zip(whole, worlds(), strict=True):
        after = ground.near(THETAS)
        for theta in THETAS:
            assert before[theta].pairs == after[theta].pairs
            assert before[theta].known.tolist() == after[theta].known.tolist()
            one, other = before[theta].groups, after[theta].groups
            assert len(np.unique(np.stack([one, other]), axis=1).T) == len(np.unique(one)) == len(np.unique(other))


def test_ways_are_those_of_plain_loops():
    for ground, labels in list(worlds())[:6]:
        true = np.array(plain.true_ways(ground.positions.tolist(), grounds.STEP_M))
        images = np.unique(labels, return_index=True)[1]
        assert ground.distances(images) == pytest.approx(true[np.ix_(images, images)])
        representatives = {int(labels[image]): int(image) for image in images if labels[image] > 0}
        edges = list(count_transitions(labels))
        ways = Ways(representatives, edges, ground)
        index = {node: number for number, node in enumerate(sorted(representatives))}
        places = ground.positions[[representatives[node] for node in index]]
        lengths = {(index[a], index[b]): float(np.linalg.norm(places[index[a]] - places[index[b]])) for a, b in edges}
        over_map = plain.shortest(len(index), lengths)
        hops = plain.shortest(len(index), dict.fromkeys(lengths, 1.0))
        numbers = [representatives[node] for node in index]
        pairs = [(i, j, true[numbers[i], numbers[j]]) for i, j in combinations(range(len(index)), 2)]
        expected = [over_map[i][j] / way for i, j, way in pairs if way > plain.ROUNDING]
        assert sorted(ways.stretches) == pytest.approx(sorted(expected))
        for scale in (2.0, 5.0):
            found = ways.edges(scale)
            median = np.median([*lengths.values()])
            near = {(i, j) for i, j, _ in pairs if hops[i][j] <= np.ceil(scale / median - plain.ROUNDING)}
            assert found is not None
            assert found.precision.count == len(near)
            assert found.precision.hits == sum(way <= 1.5 * scale + 1e-9 for i, j, way in pairs if (i, j) in near)
            assert found.recall.count == sum(way <= scale + 1e-9 for _, _, way in pairs)
            assert found.recall.hits == sum(way <= scale + 1e-9 for i, j, way in pairs if (i, j) in near)


def test_images_in_one_square_are_one_vertex_where_there_are_too_many_links():
    rng = np.random.default_rng(0)
    line = np.column_stack([np.linspace(0, 5, 501), np.zeros(501)])
    around = np.concatenate([line + 0.01 * rng.normal(size=line.shape) for _ in range(3)])
    ground = Ground(around)
    assert len(np.unique(ground._vertices)) < 200
    assert ground.distances(np.array([0, 500]))[0, 1] == pytest.approx(5.0, rel=0.05)


# Two laps of ten images a metre and two seconds apart along a line, the second as the first.
LAPS = np.array([[x, 0.0] for _ in range(2) for x in range(10)])
LAP_TIMES = at_seconds(*range(0, 40, 2))


def test_a_perfect_map_of_two_laps():
    ground, labels = Ground(LAPS, LAP_TIMES), np.tile(np.repeat([1, 2], 5), 2)
    scores = pair_scores(labels, ground, [0.5, 2.0])
    # Each image has its own place in the other lap; within 2 m, two before and two behind, at the ends fewer.
    # Image 9 and image 10 to 11 of the other lap are far, and so is not a pair within a lap (at most 18 s apart).
    assert (scores[0.5].near, scores[0.5].both) == (10, 10)
    assert (scores[2.0].near, scores[2.0].both) == (10 + 2 * 9 + 2 * 8, 10 + 2 * 8 + 2 * 6)
    assert scores[2.0].recall.value == pytest.approx(38 / 44)
    # Of one node: 25 pairs of the two laps for each of the nodes; within a lap none is more than 10 s apart.
    assert scores[2.0].together == 50
    assert scores[2.0].f1 == pytest.approx(2 * 38 / (50 + 44))
    events = reentries(labels, ground, [0.5])[0.5]
    assert (events.precision, events.recall) == (Proportion(2, 2), Proportion(2, 2))
    assert false_merges(labels, ground, [2.0])[2.0].nodes == Proportion(0, 2)
    # Linked by pairs of the two laps, the line is one place at 1 m, and ten at half a metre.
    assert nodes_per_place(labels, ground, 0.5) == (1.0, 10)
    assert nodes_per_place(labels, ground, 1.0) == (2.0, 1)


def test_slices_of_time_never_come_back():
    ground, labels = Ground(LAPS, LAP_TIMES), np.repeat([1, 2, 3, 4], 5)
    events = reentries(labels, ground, [2.0])[2.0]
    assert events.precision == Proportion(0, 0)
    assert events.recall == Proportion(0, 2)
    assert events.f1 == 0.0
    assert nodes_per_place(labels, ground, 0.5) == (2.0, 10)


def test_a_visit_goes_on_over_images_without_a_node():
    assert [ends.tolist() for ends in visits(np.array([0, 1, 0, 1, 2, 0, 1]))] == [[1, 4, 6], [3, 4, 6]]
    assert [len(ends) for ends in visits(np.array([0, 0]))] == [0, 0]


def test_a_reentry_is_more_than_ten_seconds_after_the_visit_ended():
    positions = np.zeros((3, 2))
    for seconds, again in ((10.0, 0), (10.1, 1)):
        ground = Ground(positions, at_seconds(0, 1, seconds))
        assert reentries(np.array([1, 2, 1]), ground, [2.0])[2.0].precision == Proportion(again, again)


def test_a_false_reentry_is_no_chance_that_was_taken():
    # Node 1 is entered again where only node 2 has been before: a wrong re-entry, and a chance that was missed.
    positions = np.array([[0.0, 0], [9, 0], [5, 5], [9, 0]])
    events = reentries(np.array([1, 2, 3, 1]), Ground(positions, at_seconds(0, 1, 20, 40)), [2.0])[2.0]
    assert (events.precision, events.recall) == (Proportion(0, 1), Proportion(0, 1))


def test_two_offices_in_one_node_are_a_false_merge_and_a_way_through_the_wall():
    """Twin offices: out of the far end of one, along the corridor, to the far end of the other."""
    first = [(0.0, 0.2 * y) for y in range(20, -1, -1)]
    corridor = [(x, -0.5) for x in np.arange(0.0, 6.1, 0.2)]
    second = [(6.0, 0.2 * y) for y in range(21)]
    positions = np.array([*first, *corridor, *second])
    labels = np.repeat([1, 2, 1], [len(first), len(corridor), len(second)])
    apart = np.repeat([1, 2, 3], [len(first), len(corridor), len(second)])
    ground = Ground(positions, at_seconds(*(0.4 * np.arange(len(positions)))))
    assert false_merges(labels, ground, [2.0])[2.0].nodes == Proportion(1, 2)
    assert false_merges(labels, ground, [2.0])[2.0].images == Proportion(42, len(positions))
    assert false_merges(apart, ground, [2.0])[2.0].nodes == Proportion(0, 3)
    # The far end of the first office, the corridor before it and before the second, the far end of that.
    far, west, east, other = 0, len(first), len(first) + len(corridor) - 1, len(positions) - 1
    honest = Ways({1: far, 2: west, 3: east, 4: other}, [(1, 2), (2, 3), (3, 4)], ground)
    assert min(honest.stretches) == pytest.approx(1.0, abs=0.01)
    merged = Ways({1: far, 2: west, 3: east}, [(1, 2), (2, 3), (1, 3)], ground)
    assert min(merged.stretches) == pytest.approx(np.hypot(6, 4.5) / 10.5, abs=0.01)


def test_four_images_are_no_place_of_their_own():
    positions = np.array([[0.0, 0]] * 5 + [[9.0, 0]] * 4)
    labels = np.ones(9, np.int64)
    assert false_merges(labels, Ground(positions), [2.0])[2.0].nodes == Proportion(0, 1)
    more = np.concatenate([positions, [[9.0, 1.0]]])
    assert false_merges(np.ones(10, np.int64), Ground(more), [2.0])[2.0].nodes == Proportion(1, 1)


def test_a_loop_left_open_is_a_stretch_above_one():
    """Around a square of 4 m; the map does not know that the last corner is the first."""
    side = np.linspace(0, 4, 20, endpoint=False)
    square = (
        [(x, 0.0) for x in side]
        + [(4.0, y) for y in side]
        + [(4 - x, 4.0) for x in side]
        + [(0.0, 4 - y) for y in side]
    )
    ground = Ground(np.array(square))
    corners = {1: 0, 2: 20, 3: 40, 4: 60}
    open_, closed = (Ways(corners, [(1, 2), (2, 3), (3, 4), *more], ground) for more in ([], [(1, 4)]))
    assert max(open_.stretches) == pytest.approx(3.0, abs=0.1)
    assert max(closed.stretches) == pytest.approx(1.0, abs=0.02)  # the true way cuts corners
    assert shape([1, 2, 3, 4], [(1, 2), (2, 3), (3, 4), (1, 4)]).loops == 1
    assert shape([1, 2, 3, 4], [(1, 2)]).components == 3
    edges = closed.edges(5.0)
    assert edges is not None
    # h = ceil(5 / 4) = 2: all six pairs; 7.5 m leaves the four sides; within 5 m are the sides.
    assert (edges.precision, edges.recall) == (Proportion(4, 6), Proportion(4, 4))
    assert coverage(closed.places, ground, 1.0) == Proportion(4 * 11, 80)


def test_nodes_at_one_place_have_no_stretch_and_edges_without_length_no_scale():
    ground = Ground(np.zeros((4, 2)))
    ways = Ways({1: 0, 2: 3}, [(1, 2)], ground)
    assert len(ways.stretches) == 0
    assert ways.edges(2.0) is None


def test_of_large_maps_every_kth_node_is_judged(monkeypatch):
    monkeypatch.setattr(graphs, "MOST_NODES", 3)
    ground = Ground(np.column_stack([np.arange(6.0), np.zeros(6)]))
    ways = Ways({node: node - 1 for node in range(1, 7)}, [(node, node + 1) for node in range(1, 6)], ground)
    assert ways.stretches == pytest.approx([1.0, 1.0, 1.0])


def test_changes_of_room_and_of_node_are_matched_one_to_one():
    rooms = [*"AAAA", None, *"BBBB", *"CCCC"]
    clock = Clock.of(at_seconds(*range(13)), 13)
    labels = np.array([1, 1, 2, 2, 0, 2, 2, 3, 3, 3, 3, 3, 3])
    found = borders(labels, rooms, clock)
    # Rooms change at 5 and 9 s, nodes at 2 and 7 s.
    assert found is not None
    assert (found.precision, found.recall) == (Proportion(2, 2), Proportion(2, 2))
    assert borders(labels, ["A"] * 13, clock) is None
    rng = np.random.default_rng(3)
    for _ in range(30):
        rooms, labels = rng.choice(["A", "B"], 14).tolist(), rng.integers(0, 3, 14)
        clock = Clock.of(at_seconds(*np.cumsum(rng.integers(0, 4, 14))), 14)
        codes = np.array([1 if room == "A" else 2 for room in rooms])
        ones, others = (clock.stamps[visits(one)[0][1:]].tolist() for one in (codes, labels))
        found = borders(labels, rooms, clock)
        assert (found.recall.hits if found else 0) == plain.most_matched(ones, others, clock.span(3.0))


def test_without_times_fifty_images_are_ten_seconds():
    positions = np.zeros((52, 2))
    for times in (None, [None] * 52, [*at_seconds(*range(51)), None], at_seconds(*range(52, 0, -1))):
        # Pairs 51 images apart: the first and the last.
        assert Ground(positions, times).near([0.5])[0.5].pairs == 1


def test_images_without_a_position_are_left_out():
    positions = LAPS.copy()
    positions[[3, 12]] = np.nan
    ground = Ground(positions, LAP_TIMES)
    assert len(ground) == 18
    assert ground.near([0.5])[0.5].pairs == 8


@pytest.mark.parametrize(("hits", "count"), [(0, 0), (0, 7), (7, 7), (3, 7), (480, 1000)])
def test_wilsons_interval_is_that_of_scipy(hits, count):
    from scipy.stats import binomtest

    expected = (0.0, 1.0)
    if count:
        interval = binomtest(hits, count).proportion_ci(method="wilson")
        expected = interval.low, interval.high
    assert Proportion(hits, count).interval == pytest.approx(expected, abs=1e-12)
