"""Poses come to images by name, by time or one after the other; what finds none is said."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from omnieval.datasets.sequence import Frame, Pose
from omnieval.datasets.trajectory.between import Joining
from omnieval.datasets.trajectory.join import interpolated, joined
from omnieval.datasets.trajectory.read import read_track
from tests.datasets.trajectory.drives import STEP_NS, a_drive, kitti, lines, tum

DRIVE = a_drive()
ALONE = Joining()


def frames(*files, times=None):
    return [Frame(Path(file), file, None if times is None else int(times[at])) for at, file in enumerate(files)]


def join(images, text, how=ALONE):
    return joined(images, read_track(text.encode(), "p.csv"), how)


def at(images):
    return [None if frame.pose is None else frame.pose.x for frame in images]


def kinds(findings):
    return [finding.code for finding in findings]


NAMES = {
    "as they are": (["a/1.png", "a/2.png"], ["a/1.png", "a/2.png"]),
    "a folder in front": (["1.png", "2.png"], ["data/set/1.png", "data/set/2.png"]),
    "a folder less": (["a/1.png", "a/2.png"], ["1.png", "2.png"]),
    "no ending": (["t1.52.png", "t1.53.png"], ["t1.52", "t1.53"]),
    "another ending": (["1.png", "2.png"], ["1.tif", "2.tif"]),
    "upper case": (["img_1.png", "img_2.png"], ["IMG_1.PNG", "Img_2.png"]),
    "of Windows": (["a/1.png", "b/1.png"], ["a\\1.png", "C:\\x\\b\\1.png"]),
    "accents written apart": (["\u00e4.png", "2.png"], ["a\u0308.png", "./2.png"]),
    "the same in two folders": (["a/1.png", "b/1.png"], ["x/a/1.png", "b/1"]),
    "the same but for the ending": (["1.png", "1.jpg"], ["d/1.png", "1.JPG"]),
    "the same but for the case": (["A.png", "a.png"], ["x/A.png", "x/a.png"]),
}


@pytest.mark.parametrize(("images", "named"), NAMES.values(), ids=NAMES)
def test_images_are_found_by_their_names(images, named):
    posed, findings = join(frames(*images), f"file,x,y\n{named[0]},1,0\n{named[1]},2,0\n")
    assert (at(posed), findings) == ([1, 2], [])


def test_a_name_of_several_images_is_refused():
    _, findings = join(frames("a/1.png", "b/1.png"), "file,x,y\n1.png,1,0\n")
    assert [(found.severity, found.code, found.where) for found in findings] == [
        ("error", "ambiguous-image", "p.csv:2")
    ]


def test_names_of_another_sequence_are_refused_with_what_they_are():
    _, findings = join(frames("img_1.png"), "file,x,y\nfoto7.png,1,0\nfoto8.png,1,0\n")
    assert [(found.severity, found.code) for found in findings] == [("error", "poses-match-nothing")]
    assert "it names foto7.png, and the first image is img_1.png" in findings[0].message


def test_names_that_match_none_leave_it_to_the_times():
    images = frames("1.png", "2.png", times=[10**9, 2 * 10**9])
    posed, findings = join(images, "image,t,x,y\nleft/7.png,1.1,1,0\nleft/8.png,2.1,2,0\n")
    assert (at(posed), kinds(findings)) == ([1, 2], ["poses-read"])
    assert "joined by time (within 0.5 s): 2 of 2 images" in findings[0].message


def test_what_is_missing_on_either_side_is_counted():
    posed, findings = join(frames("1.png", "2.png", "3.png"), "file,x,y\n1.png,1,0\ngone.png,2,0\n3.png,,\n")
    assert at(posed) == [1, None, None]
    assert [(found.code, found.where) for found in findings] == [
        ("missing-image", "gone.png"),
        ("image-without-pose", "2.png"),
        ("image-without-pose", "3.png"),
    ]


def test_the_nearest_pose_in_time_is_taken_within_half_an_interval():
    times = DRIVE.times_ns[::3]  # 0.6 s apart
    posed, findings = join(frames(*"abcd", times=times + STEP_NS // 3), tum(DRIVE))
    np.testing.assert_allclose([(frame.pose.x, frame.pose.y) for frame in posed], DRIVE.places[::3])
    assert "joined by time (within 0.3 s): 4 of 4 images" in findings[0].message
    late, findings = join(frames(*"abcd", times=times + 5 * STEP_NS), tum(DRIVE))
    assert [frame.pose is None for frame in late] == [False, False, False, True]
    assert findings[-1].message == "no pose in p.csv"
    near, _ = join(frames(*"abcd", times=times + 5 * STEP_NS), tum(DRIVE), Joining(tolerance_s=0.01))
    assert at(near)[:2] == at(late)[:2]


@pytest.mark.parametrize(
    ("shift", "words"),
    [
        (10**18, "it is of another sequence, or of another clock or unit of time"),
        (STEP_NS // 3, "no pose is within 0.01 s of an image"),
    ],
)
def test_times_that_match_nothing_are_said_beside_each_other(shift, words):
    _, findings = join(frames("a", "b", times=DRIVE.times_ns[:2] + shift), tum(DRIVE), Joining(tolerance_s=0.01))
    assert [(found.severity, found.code) for found in findings] == [("error", "poses-match-nothing")]
    assert words in findings[0].message
    assert "its times are 1403636579.500 to 1403636581.700 s" in findings[0].message


def test_rows_without_names_and_times_are_one_an_image():
    posed, findings = join(frames(*"abcdefghijkl"), kitti(DRIVE))
    np.testing.assert_allclose([(frame.pose.x, frame.pose.y) for frame in posed], DRIVE.places, atol=1e-9)
    assert "joined one after the other: 12 of 12 images" in findings[0].message
    _, findings = join(frames("a"), kitti(DRIVE))
    assert [(found.severity, found.code) for found in findings] == [("error", "rows-differ")]


def test_poses_are_interpolated_between_near_neighbours_and_nowhere_else():
    text = lines(
        ["0", "10", "12", "30"], ["0.0", "0.0", "4.0", "8.0"], ["0.0", "3.0", "-3.0", "0.0"], heading="t x yaw"
    )
    text = text.replace("t x yaw", "t x yaw y").replace("\n", " 1\n").replace("y 1", "y", 1)
    images = frames(*"abcdef", times=[-(10**9), 10 * 10**9, 11 * 10**9, 12 * 10**9, 20 * 10**9, 31 * 10**9])
    posed, findings = join(images, text, Joining(interpolate_s=2.0))
    assert at(posed) == [None, 0.0, 2.0, 4.0, None, None]
    assert abs(posed[2].pose.yaw) == pytest.approx(math.pi)  # the shorter arc from 3 to -3 leads over pi
    assert "1 image between poses at most 2 s apart" in findings[1].message
    wider, _ = join(images, text, Joining(interpolate_s=18.0))
    assert at(wider)[4] == pytest.approx(4 + 4 * 8 / 18)


def test_gaps_of_named_poses_are_filled_likewise():
    images = frames("a.png", "b.png", "c.png", "d.png", times=[0, 10**9, 2 * 10**9, 3 * 10**9])
    table = "file,x,y\na.png,0,0\nc.png,2,4\n"
    posed, findings = join(images, table, Joining(interpolate_s=2.0))
    assert at(posed) == [0, 1, 2, None]
    assert posed[1].pose.y == 2
    assert kinds(findings) == ["poses-interpolated", "image-without-pose"]
    alone, findings = join(images, table)
    assert at(alone) == [0, None, 2, None]
    filled, _ = interpolated(alone, 1.9)
    assert at(filled) == [0, None, 2, None]


def test_what_has_no_time_cannot_be_interpolated_and_that_is_said():
    images = frames("a.png", "b.png", "c.png")
    filled, findings = join(images, "file,time,x,y\na.png,0,0,0\nc.png,2,2,4\n", Joining(interpolate_s=2.0))
    assert at(filled) == [0, None, 2]
    assert kinds(findings) == ["poses-not-interpolated", "image-without-pose"]


def test_a_pose_whose_heading_is_not_known_lends_none():
    known = [
        Frame(Path("a"), "a", 0, Pose(0, 0, math.nan)),
        Frame(Path("b"), "b", 1),
        Frame(Path("c"), "c", 2, Pose(2, 2, 1)),
    ]
    filled, _ = interpolated(known, 1.0)
    pose = filled[1].pose
    assert pose is not None
    assert (pose.x, math.isnan(pose.yaw)) == (1, True)


def test_times_of_the_table_are_taken_if_all_images_have_one():
    images = frames("1.png", "2.png", times=[5, 6])
    posed, _ = join(images, "file,x,y,t\n1.png,0,0,1\n2.png,0,0,2\n")
    assert [frame.time_ns for frame in posed] == [10**9, 2 * 10**9]
    posed, _ = join(images, "file,x,y,t\n1.png,0,0,1\n")
    assert [frame.time_ns for frame in posed] == [5, 6]
