"""The map from above shows every image, at every step, without growing with the square of the steps."""

import dataclasses
import itertools

import numpy as np
import pytest

from omnieval.explain.capture import Capture
from omnieval.explain.decision import best_match, decision
from omnieval.mapping.partition import Partition
from omnieval.mapping.step import Verdict
from omnieval.recording import layout
from omnieval.recording.overview import Overview, node_rows, topological_graph
from omnieval.recording.rooms import Rooms
from tests.recording.replays import by_entity, decided, match, step, steps


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
        yield partition, by_entity(overview.rows(decided(a_step, **options), partition))


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
    for quiet in (a_step for a_step in steps(4000) if not a_step.events):
        a_step = dataclasses.replace(quiet, frame=len(partition.labels))
        partition.apply(a_step)
        points += sum(
            len(row.classes)
            for entity, row in by_entity(overview.rows(decided(a_step), partition)).items()
            if entity in {layout.MAP_IMAGES, layout.MAP_RECENT}
        )
    count = len(partition.labels)
    assert points < 3 * count**1.5


def test_nodes_stand_at_the_mean_of_their_images_and_transitions_join_them():
    labels = np.array([1, 1, 0, 2])
    positions = np.array([[0.0, 0.0], [2.0, 0.0], [9.0, 9.0], [4.0, 4.0]])
    rows = by_entity(node_rows(labels, positions, frozenset({1}), [(1, 2)], rooms(*[None] * 4)))
    nodes = rows[layout.MAP_NODES]
    assert nodes.positions.tolist() == [[1.0, 0.0], [4.0, 4.0]]
    assert nodes.labels == ("1", "(2)")
    assert rows[layout.MAP_TRANSITIONS].ends.tolist() == [[[1.0, 0.0], [4.0, 4.0]]]


def test_an_image_without_position_does_not_move_its_node():
    positions = np.array([[0.0, 0.0], [np.nan, np.nan], [2.0, 0.0]])
    rows = by_entity(node_rows(np.array([1, 1, 1]), positions, frozenset(), [], rooms(*[None] * 3)))
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
    graph = topological_graph(np.array([1, 2, 0, 3, 3, 2]), frozenset({1, 2}), [(1, 2), (2, 3)])
    assert graph.nodes == ("1", "2", "3")
    assert graph.labels == ("1", "2", "(3)")
    assert graph.edges == (("1", "2"), ("2", "3"))


def test_a_line_leads_to_the_best_match_and_a_trail_to_the_robot():
    ends = {}
    for a_step, (_, rows) in zip(steps(40), follow(40), strict=True):
        ends[a_step.frame] = rows[layout.MAP_ROBOT].positions[0]
        if a_step.frame:
            assert rows[layout.MAP_TRAIL].ends[0].tolist() == [list(ends[a_step.frame - 1]), list(ends[a_step.frame])]
        line = rows[layout.MAP_MATCH].ends
        if a_step.match is None:
            assert len(line) == 0
        else:
            assert line[0].tolist() == [list(ends[a_step.frame]), list(ends[a_step.match.best_frame])]


def test_a_closed_loop_is_a_line_between_its_capture_points_and_a_refused_one_is_apart():
    for a_step, (_, rows) in zip(steps(60), follow(60), strict=True):
        drawn = {entity for entity in (layout.MAP_ACCEPTED, layout.MAP_REFUSED) if entity in rows}
        if a_step.verdict is Verdict.ASSIGNED:
            assert drawn == {layout.MAP_ACCEPTED}
            assert rows[layout.MAP_ACCEPTED].ends.tolist() == rows[layout.MAP_MATCH].ends.tolist()
        elif a_step.match is not None:
            assert drawn == {layout.MAP_REFUSED}
        else:
            assert drawn == set()


@pytest.mark.parametrize(("metres", "shown"), [(0.5, 0), (0.51, 1), (2.0, 2), (16.4, 3)])
def test_the_colour_of_a_loop_closure_says_how_far_apart_its_images_were_taken(metres, shown):
    partition, overview = Partition(), Overview()
    for frame, x in enumerate([0.0, metres]):
        a_step = step(frame, Verdict.ASSIGNED if frame else Verdict.INITIAL, 1, match=match(1) if frame else None)
        partition.apply(a_step)
        here = Capture(frame, "", x=x, y=0.0)
        best = best_match(match(1), here, Capture(0, "", x=0.0, y=0.0), 256) if frame else None
        rows = by_entity(overview.rows(decision(a_step, here, best), partition))
    _, _, color, width = layout.CLOSURES[shown]
    assert rows[layout.MAP_ACCEPTED].colors.tolist() == [color]
    assert rows[layout.MAP_ACCEPTED].widths.tolist() == [width]


def test_loop_closures_grow_brighter_and_wider_with_the_distance_of_their_images():
    limits, _, colors, widths = zip(*layout.CLOSURES, strict=True)
    luminances = [0.21 * (color >> 24) + 0.72 * (color >> 16 & 255) + 0.07 * (color >> 8 & 255) for color in colors]
    assert luminances == sorted(luminances)
    assert list(widths) == sorted(widths)
    assert list(limits) == sorted(limits)
    assert limits[-1] == float("inf")


def test_a_selected_node_says_what_it_holds():
    positions = np.zeros((5, 2))
    seen = rooms("KT", "KT", "LR", None, "LR")
    rows = by_entity(node_rows(np.array([1, 1, 1, 2, 0]), positions, frozenset({1}), [], seen))
    assert rows[layout.MAP_NODES].facts == {
        "state": ["active", "pending"],
        "images": ["3", "1"],
        "rooms": ["KT 67 %, LR 33 %", "no label 100 %"],
    }


def test_rooms_follow_any_number_of_images_and_of_names():
    seen = rooms(*(f"R{number % 7}" for number in range(140)))
    labels = np.repeat([1, 2], 70)
    assert seen.shares(labels, np.array([2])) == [", ".join(f"R{room} 14 %" for room in range(7))]
    assert rooms("KT").shares(np.array([5]), np.array([5])) == ["KT 100 %"]
