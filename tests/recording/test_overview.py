"""The map from above shows every image, at every step, without growing with the square of the steps."""

import dataclasses
import itertools

import numpy as np

from omnieval.mapping.partition import Partition
from omnieval.recording import layout
from omnieval.recording.overview import Overview, node_rows, topological_graph
from tests.recording.replays import by_entity, steps, view


def follow(count, **options):
    """Yield (partition, rows of this step as a dictionary) along a made-up replay."""
    partition, overview = Partition(), Overview()
    for step in steps(count):
        partition.apply(step)
        yield partition, by_entity(overview.rows(view(step, **options), partition))


def test_drawn_images_and_recent_ones_are_all_images_in_their_current_colours():
    drawn = np.zeros(0, np.int64)
    for partition, rows in follow(200):
        if layout.MAP_IMAGES in rows:
            drawn = rows[layout.MAP_IMAGES].classes
        shown = np.concatenate([drawn, rows[layout.MAP_RECENT].classes])
        np.testing.assert_array_equal(shown, partition.labels)


def test_quiet_stretches_redraw_the_map_rarely():
    partition, overview = Partition(), Overview()
    points = 0
    for quiet in (step for step in steps(4000) if not step.events):
        step = dataclasses.replace(quiet, frame=len(partition.labels))
        partition.apply(step)
        points += sum(
            len(row.classes)
            for entity, row in by_entity(overview.rows(view(step), partition)).items()
            if entity in {layout.MAP_IMAGES, layout.MAP_RECENT}
        )
    count = len(partition.labels)
    assert points < 3 * count**1.5


def test_nodes_stand_at_the_mean_of_their_images_and_transitions_join_them():
    labels = np.array([1, 1, 0, 2])
    positions = np.array([[0.0, 0.0], [2.0, 0.0], [9.0, 9.0], [4.0, 4.0]])
    rows = by_entity(node_rows(labels, positions, frozenset({1})))
    nodes = rows[layout.MAP_NODES]
    assert nodes.positions.tolist() == [[1.0, 0.0], [4.0, 4.0]]
    assert nodes.labels == ("1", "(2)")
    assert rows[layout.MAP_TRANSITIONS].ends.tolist() == [[[1.0, 0.0], [4.0, 4.0]]]


def test_an_image_without_position_does_not_move_its_node():
    positions = np.array([[0.0, 0.0], [np.nan, np.nan], [2.0, 0.0]])
    rows = by_entity(node_rows(np.array([1, 1, 1]), positions, frozenset()))
    assert rows[layout.MAP_NODES].positions.tolist() == [[1.0, 0.0]]


def test_without_poses_only_the_graph_is_drawn():
    seen = set()
    for _, rows in follow(60, poses=False):
        assert not len(rows.pop(layout.MAP_RECENT).classes)
        images = rows.pop(layout.MAP_IMAGES, None)
        assert images is None or not len(images.classes)
        seen |= set(rows)
    assert seen == {layout.GRAPH}


def test_the_graph_is_logged_when_it_changes():
    graphs = [rows[layout.GRAPH] for _, rows in follow(200) if layout.GRAPH in rows]
    assert all(before != after for before, after in itertools.pairwise(graphs))
    assert len(graphs) < 60


def test_the_graph_joins_nodes_that_follow_each_other():
    graph = topological_graph(np.array([1, 2, 0, 3, 3, 2]), frozenset({1, 2}))
    assert graph.nodes == ("1", "2", "3")
    assert graph.labels == ("1", "2", "(3)")
    assert graph.edges == (("1", "2"), ("2", "3"))


def test_a_line_leads_to_the_best_match_and_a_trail_to_the_robot():
    decided = steps(40)
    ends = {}
    for step, (_, rows) in zip(decided, follow(40), strict=True):
        ends[step.frame] = rows[layout.MAP_ROBOT].positions[0]
        if step.frame:
            assert rows[layout.MAP_TRAIL].ends[0].tolist() == [list(ends[step.frame - 1]), list(ends[step.frame])]
        line = rows[layout.MAP_MATCH].ends
        if step.match is None:
            assert len(line) == 0
        else:
            assert line[0].tolist() == [list(ends[step.frame]), list(ends[step.match.best_frame])]
