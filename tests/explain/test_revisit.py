"""The image that a new one revisits is the nearest of the active nodes, the last ones left out."""

from pathlib import Path

import numpy as np
import pytest

from omnieval.datasets.sequence import Frame, Pose
from omnieval.explain.page import revisit_text
from omnieval.explain.revisit import AGO_STEPS, Revisits
from omnieval.explain.run import RunExplainer
from omnieval.mapping.partition import Partition
from omnieval.mapping.step import EventKind, NodeEvent, Role, Step


def step(frame, node, *events):
    return Step(frame, "initial", Role.FOUNDING, node, events=events)


def follow(places, *, ago=2, active=(1,)):
    """Let images come at (x, node); return what each revisits."""
    partition, revisits, found = Partition(), Revisits(ago), []
    for frame, (x, node) in enumerate(places):
        pose = None if x is None else Pose(x, 0.0, 0.0)
        found.append(revisits.find(Frame(Path(), f"{frame}.png", pose=pose, room="KT"), partition))
        events = tuple(NodeEvent(EventKind.ACTIVATED, one) for one in active) if frame == 0 else ()
        partition.apply(step(frame, node, *events))
    return found


def test_the_nearest_earlier_image_is_found_but_not_the_last_ones():
    found = follow([(0.0, 1), (5.0, 1), (5.1, 1), (5.2, 1)], ago=2)
    assert found[:2] == [None, None]
    assert (found[2].frame, found[2].distance) == (0, pytest.approx(5.1))
    assert (found[3].frame, found[3].node, found[3].near) == (1, 1, True)


def test_images_of_pending_nodes_and_of_none_are_no_place_to_return_to():
    found = follow([(0.0, 2), (0.1, None), (3.0, 1), (9.0, 1), (0.0, 1)], ago=2)
    assert (found[4].frame, found[4].near) == (2, False)


def test_without_position_nothing_is_revisited():
    assert follow([(None, 1)] * 5) == [None] * 5
    found = follow([(None, 1), (1.0, 1), (1.0, 1), (1.0, 1)], ago=1)
    assert [one.frame if one else None for one in found] == [None, None, 1, 1]


def test_many_images_are_followed():
    found = follow([(float(frame % 70), 1) for frame in range(200)], ago=10)
    assert [one.frame for one in found[70:140]] == list(range(70))


def test_a_known_place_and_a_new_one_read_differently():
    found = follow([(0.0, 1), (0.3, 1), (0.25, 1), (7.0, 1)], ago=2)
    known, new = (revisit_text(found[frame], frame) for frame in (2, 3))
    assert known == "that of image 0 of node 1 in KT, 0.25 m away and 2 steps ago"
    assert new == "a new one; the nearest in an active node is image 1 of node 1 in KT, 6.70 m away and 2 steps ago"


def test_an_explained_run_revisits_by_its_own_poses(run):
    positions = run.steps.select("x", "y").to_numpy()
    revisits = [scene.revisit for scene in RunExplainer(run).scenes()]
    assert any(revisit is not None and revisit.near for revisit in revisits)
    for frame, revisit in enumerate(revisits):
        if revisit is not None:
            assert revisit.frame <= frame - AGO_STEPS
            assert revisit.image.file == run.steps["file"][revisit.frame]
            expected = np.linalg.norm(positions[frame] - positions[revisit.frame])
            assert revisit.distance == pytest.approx(float(expected))
