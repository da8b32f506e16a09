"""The map from above shows every image, at every step, without growing with the square of the steps."""

import dataclasses
import itertools
from pathlib import Path

import numpy as np
import pytest

from omnieval.datasets.sequence import Frame, Pose
from omnieval.explain.scene import Scene
from omnieval.mapping.partition import Partition
from omnieval.mapping.step import Match, Role
from omnieval.recording import entities
from omnieval.recording.overview import Overview, Rooms, node_rows, topological_graph
from omnieval.recording.styles import CLOSURES
from tests.recording.replays import by_entity, scene, step, steps


def rooms(*names):
    seen = Rooms()
    for name in names:
        seen.add(name)
    return seen


def follow(count, **options):
    """Yield (partition, rows of this step as a dictionary) along a made-up replay."""
    partition, overview = Partition(), Overview()
    for a_step in steps(count):
        partition.apply(a_step)
        yield partition, by_entity(overview.rows(scene(a_step, **options), partition))


def test_drawn_images_and_recent_ones_are_all_images_in_their_current_colours():
    drawn = np.zeros(0, np.int64)
    for partition, rows in follow(200):
        if entities.MAP_IMAGES in rows:
            drawn = rows[entities.MAP_IMAGES].classes
        shown = np.concatenate([drawn, rows[entities.MAP_RECENT].classes])
        np.testing.assert_array_equal(shown, partition.labels)


def test_quiet_stretches_redraw_the_map_rarely():
    partition, overview = Partition(), Overview()
    points = 0
    for quiet in (a_step for a_step in steps(4000) if not a_step.events):
        a_step = dataclasses.replace(quiet, frame=len(partition.labels))
        partition.apply(a_step)
        points += sum(
            len(row.classes)
            for entity, row in by_entity(overview.rows(scene(a_step), partition)).items()
            if entity in {entities.MAP_IMAGES, entities.MAP_RECENT}
        )
    count = len(partition.labels)
    assert points < 3 * count**1.5


def test_nodes_stand_at_the_mean_of_their_images_and_transitions_join_them():
    labels = np.array([1, 1, 0, 2])
    positions = np.array([[0.0, 0.0], [2.0, 0.0], [9.0, 9.0], [4.0, 4.0]])
    rows = by_entity(node_rows(labels, positions, frozenset({1}), [(1, 2)], rooms(*[None] * 4)))
    nodes = rows[entities.MAP_NODES]
    assert nodes.positions.tolist() == [[1.0, 0.0], [4.0, 4.0]]
    assert nodes.labels == ("1", "(2)")
    assert rows[entities.MAP_TRANSITIONS].ends.tolist() == [[[1.0, 0.0], [4.0, 4.0]]]


def test_positions_are_drawn_from_the_origin_of_the_map():
    a_step = next(iter(steps(1)))
    partition, overview = Partition(), Overview((465_100.0, 5_249_300.0))
    partition.apply(a_step)
    there = dataclasses.replace(scene(a_step), image=Frame(Path("a"), "a", pose=Pose(465_101.25, 5_249_302.5, 0.0)))
    rows = by_entity(overview.rows(there, partition))
    assert rows[entities.MAP_ROBOT].positions.tolist() == [[1.25, 2.5]]


def test_an_image_without_position_does_not_move_its_node():
    positions = np.array([[0.0, 0.0], [np.nan, np.nan], [2.0, 0.0]])
    rows = by_entity(node_rows(np.array([1, 1, 1]), positions, frozenset(), [], rooms(*[None] * 3)))
    assert rows[entities.MAP_NODES].positions.tolist() == [[1.0, 0.0]]


def test_without_poses_only_the_graph_is_drawn():
    seen = set()
    for _, rows in follow(60, poses=False):
        assert not len(rows.pop(entities.MAP_RECENT).classes)
        images = rows.pop(entities.MAP_IMAGES, None)
        assert images is None or not len(images.classes)
        seen |= set(rows)
    assert seen == {entities.GRAPH}


def test_the_graph_is_logged_when_it_changes():
    graphs = [rows[entities.GRAPH] for _, rows in follow(200) if entities.GRAPH in rows]
    assert all(before != after for before, after in itertools.pairwise(graphs))
    assert len(graphs) < 60


def test_numbers_of_nodes_stand_apart_and_move_rarely():
    partition, overview = Partition(), Overview(extent=(0.0, 0.0, 40.0, 20.0))
    logged, shown, worst = 0, None, 0.0
    for a_step in steps(200):
        partition.apply(a_step)
        rows = by_entity(overview.rows(scene(a_step), partition))
        shown = rows.get(entities.MAP_NUMBERS, shown)
        logged += entities.MAP_NUMBERS in rows
        nodes = rows[entities.MAP_NODES]
        assert shown is not None
        assert shown.labels == nodes.labels
        worst = max(worst, float(np.abs(shown.positions - nodes.positions).max()))
    assert worst < 4.0
    assert logged < 100


def test_the_graph_joins_nodes_that_follow_each_other():
    graph = topological_graph(np.array([1, 2, 0, 3, 3, 2]), frozenset({1, 2}), [(1, 2), (2, 3)])
    assert graph.nodes == ("1", "2", "3")
    assert graph.labels == ("1", "2", "(3)")
    assert graph.edges == (("1", "2"), ("2", "3"))


def test_a_line_leads_to_the_best_match_and_a_trail_to_the_robot():
    ends = {}
    for a_step, (_, rows) in zip(steps(40), follow(40), strict=True):
        ends[a_step.frame] = rows[entities.MAP_ROBOT].positions[0]
        if a_step.frame:
            assert rows[entities.MAP_TRAIL].ends[0].tolist() == [list(ends[a_step.frame - 1]), list(ends[a_step.frame])]
        line = rows[entities.MAP_MATCH].ends
        if a_step.match is None:
            assert len(line) == 0
        else:
            assert line[0].tolist() == [list(ends[a_step.frame]), list(ends[a_step.match.frame])]


def test_a_closed_loop_is_a_line_between_its_capture_points_and_a_refused_one_is_apart():
    for a_step, (_, rows) in zip(steps(60), follow(60), strict=True):
        drawn = {entity for entity in (entities.MAP_ACCEPTED, entities.MAP_REFUSED) if entity in rows}
        if a_step.role is Role.JOINED:
            assert drawn == {entities.MAP_ACCEPTED}
            assert rows[entities.MAP_ACCEPTED].ends.tolist() == rows[entities.MAP_MATCH].ends.tolist()
        elif a_step.match is not None:
            assert drawn == {entities.MAP_REFUSED}
        else:
            assert drawn == set()


@pytest.mark.parametrize(("metres", "shown"), [(0.5, 0), (0.51, 1), (2.0, 2), (16.4, 3)])
def test_the_colour_of_a_loop_closure_says_how_far_apart_its_images_were_taken(metres, shown):
    partition, overview = Partition(), Overview()
    images = [Frame(Path(), "", pose=Pose(x, 0.0, 0.0)) for x in (0.0, metres)]
    first = step(0, "initial", Role.FOUNDING, 1)
    second = step(1, "assigned", Role.JOINED, 1, match=Match(0, 1))
    for a_scene in (Scene(first, images[0]), Scene(second, images[1], images[0])):
        partition.apply(a_scene.step)
        rows = by_entity(overview.rows(a_scene, partition))
    _, _, color, width = CLOSURES[shown]
    assert rows[entities.MAP_ACCEPTED].colors.tolist() == [color]
    assert rows[entities.MAP_ACCEPTED].widths.tolist() == [width]


def test_loop_closures_grow_brighter_and_wider_with_the_distance_of_their_images():
    limits, _, colors, widths = zip(*CLOSURES, strict=True)
    luminances = [0.21 * (color >> 24) + 0.72 * (color >> 16 & 255) + 0.07 * (color >> 8 & 255) for color in colors]
    assert luminances == sorted(luminances)
    assert list(widths) == sorted(widths)
    assert list(limits) == sorted(limits)
    assert limits[-1] == float("inf")


def test_a_selected_node_says_what_it_holds():
    positions = np.zeros((5, 2))
    seen = rooms("KT", "KT", "LR", None, "LR")
    rows = by_entity(node_rows(np.array([1, 1, 1, 2, 0]), positions, frozenset({1}), [], seen))
    assert rows[entities.MAP_NODES].facts == {
        "state": ["active", "pending"],
        "images": ["3", "1"],
        "rooms": ["KT 67 %, LR 33 %", "no label 100 %"],
    }


def test_rooms_follow_any_number_of_images_and_of_names():
    seen = rooms(*(f"R{number % 7}" for number in range(140)))
    labels = np.repeat([1, 2], 70)
    assert seen.shares(labels, np.array([2])) == [", ".join(f"R{room} 14 %" for room in range(7))]
    assert rooms("KT").shares(np.array([5]), np.array([5])) == ["KT 100 %"]
