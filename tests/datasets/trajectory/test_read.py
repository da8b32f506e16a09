"""Files of poses are known by what they hold; what cannot be known is said, or refused with what to do."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from omnieval.datasets.trajectory.read import read_track
from tests.datasets.trajectory.drives import START_NS, a_drive, camera_poses, euroc, kitti, lines, tum

DRIVE = a_drive()
IMAGES = [f"img_{number}.png" for number in range(12)]
X, Y = DRIVE.places.T
DEGREES = np.degrees(DRIVE.yaws)


def read(text):
    return read_track(text if isinstance(text, bytes) else text.encode(), "poses.txt")


def findings(track):
    return [(finding.severity, finding.code, finding.where) for finding in track.findings]


def words(text):
    """What is said of a file, in one text."""
    return "\n".join(f"{found.severity} {found.where}: {found.message}" for found in read(text).findings)


def poses(track):
    return np.array([(fix.pose.x, fix.pose.y, fix.pose.yaw) for fix in track.fixes])


def is_the_drive(track, *, times=True, yaws=True):
    assert track.findings == ()
    np.testing.assert_allclose(poses(track)[:, :2], DRIVE.places, atol=1e-9)
    if yaws:
        np.testing.assert_allclose(np.exp(1j * poses(track)[:, 2]), np.exp(1j * DRIVE.yaws), atol=1e-9)
    else:
        assert np.isnan(poses(track)[:, 2]).all()
    if times:
        assert [fix.time_ns for fix in track.fixes] == DRIVE.times_ns.tolist()


FORMS = {
    "TUM": (tum(DRIVE), "TUM; ground x, y; ahead is x of the robot"),
    "TUM with comments": (
        f"# ground truth trajectory\n# file: 'a.bag'\n# timestamp tx ty tz qx qy qz qw\n{tum(DRIVE)}",
        "TUM; ground x, y; ahead is x of the robot",
    ),
    "EuRoC": (euroc(DRIVE), "EuRoC; timestamp in ns; ground x, y; ahead is x of the robot"),
    "EuRoC without a heading": (euroc(DRIVE, heading=False), "EuRoC; time in ns; ground x, y"),
    "columns": (
        lines(DRIVE.seconds, Y, DRIVE.yaws, X, separator=",", heading="time,y,yaw,x"),
        "columns (time, y, yaw, x)",
    ),
    "units": (
        lines(
            DRIVE.times_ns, 100 * X, 100 * Y, DEGREES, separator="\t",
            heading="stamp_ns\tpos_x [cm]\tpos.y (cm)\theading_deg",
        ),
        "columns (stamp_ns, pos_x [cm], pos.y (cm), heading_deg)",
    ),
    "semicolons and decimal commas": (
        lines(DRIVE.seconds, X, Y, DRIVE.yaws, separator=";", heading="t;x;y;theta").replace(".", ","),
        "columns (t, x, y, theta); decimal commas",
    ),
    "milliseconds": (lines(DRIVE.times_ns // 10**6, X, Y, DRIVE.yaws, heading="time x y yaw"), "time in ms"),
    "what ROS prints": (
        lines(
            DRIVE.times_ns + 7, ["1"] * 12, DRIVE.times_ns, X, Y, *DRIVE.quaternions.T, separator=",",
            heading="%time,field.header.seq,field.header.stamp,field.pose.pose.position.x,field.pose.pose.position.y,"
            + ",".join(f"field.pose.pose.orientation.{axis}" for axis in "xyzw"),
        ),
        "not read: field.header.seq, time",
    ),
    "seconds and nanoseconds apart": (
        lines(
            DRIVE.times_ns + 7, DRIVE.times_ns // 10**9, DRIVE.times_ns % 10**9, X, Y, DRIVE.yaws, separator=",",
            heading="Time,header.stamp.secs,header.stamp.nsecs,pose.position.x,pose.position.y,yaw",
        ),
        "not read: Time",
    ),
    "seconds and nanoseconds apart, without more words": (
        lines(DRIVE.times_ns // 10**9, DRIVE.times_ns % 10**9, X, Y, DRIVE.yaws, heading="sec nanosec x y yaw"),
        "columns (sec, nanosec, x, y, yaw)",
    ),
    "nanoseconds alone": (lines(DRIVE.times_ns, X, Y, DRIVE.yaws, heading="nanoseconds x y yaw"), "columns"),
}  # fmt: skip


@pytest.mark.parametrize(("text", "said"), FORMS.values(), ids=FORMS)
def test_a_file_is_known_by_its_content(text, said):
    track = read(text)
    is_the_drive(track)
    assert said in track.words


def test_kitti_is_of_cameras_whose_ground_is_x_and_z():
    track = read(kitti(DRIVE))
    is_the_drive(track, times=False)
    assert track.words == "KITTI; ground z, -x (y is down); ahead is z of the camera"


def test_kitti_of_a_robot_that_turns_about_z_has_its_ground_in_x_and_y():
    turns = Rotation.from_quat(DRIVE.quaternions).as_matrix()
    rows = np.concatenate([turns, np.stack([X, Y, 0 * X], axis=1)[:, :, np.newaxis]], axis=2)
    track = read(lines(*rows.reshape(-1, 12).T))
    is_the_drive(track, times=False)
    assert track.words == "KITTI; ground x, y; ahead is x of the robot"


def test_tum_of_a_camera_looks_along_its_z():
    """A SLAM system gives the camera's poses in the frame of the first; motion capture in one whose z is up."""
    moving = camera_poses(DRIVE)
    quaternions = Rotation.from_matrix(moving[:, :, :3]).as_quat()
    track = read(lines(DRIVE.seconds, *moving[:, :, 3].T, *quaternions.T))
    is_the_drive(track)
    assert track.words == "TUM; ground z, -x (y is down); ahead is z of the camera"
    optical = Rotation.from_matrix([[0, 0, 1], [-1, 0, 0], [0, -1, 0]])  # x right, y down, z ahead of a robot
    turned = (Rotation.from_quat(DRIVE.quaternions) * optical).as_quat()
    track = read(lines(DRIVE.seconds, X, Y, [1.2] * 12, *turned.T))
    is_the_drive(track)
    assert track.words == "TUM; ground x, y; ahead is z of the camera"


def test_a_heading_is_optional():
    is_the_drive(read(lines(DRIVE.seconds, X, Y, heading="time x y")), yaws=False)


@pytest.mark.parametrize("start", [b"\xef\xbb\xbf", b""], ids=["UTF-8 with its mark", "UTF-16"])
def test_the_marks_of_other_systems_do_no_harm(start):
    text = lines(IMAGES, X, Y, DRIVE.yaws, separator=",", heading="file,x,y,yaw").replace("\n", "\r\n")
    track = read(start + text.encode() if start else text.encode("utf-16"))
    is_the_drive(track, times=False)
    assert [fix.name for fix in track.fixes] == IMAGES


def test_times_since_the_epoch_keep_their_nanoseconds_and_coordinates_their_millimetres():
    track = read("time,easting,northing\n1403636579.123456789,465123.456,5249321.098\n1403636580,0,0\n")
    assert track.fixes[0].time_ns == 1_403_636_579_123_456_789
    assert (track.fixes[0].pose.x, track.fixes[0].pose.y) == (465123.456, 5249321.098)


def test_degrees_are_known_by_their_size_and_by_the_path_and_said():
    track = read(lines(X, Y, DEGREES, heading="x y yaw"))
    np.testing.assert_allclose(poses(track)[:, 2], DRIVE.yaws)
    assert findings(track) == [("warning", "yaw-in-degrees", "poses.txt")]
    # A winding road never turns further than six degrees.
    small = np.radians(np.tile([0, 2, 4, 6, 4, 2, 0, -2, -4, -6, -4, -2], 2))
    road = np.cumsum(np.stack([np.cos(small), np.sin(small)], axis=1), axis=0)
    track = read(lines(*road.T, np.degrees(small), heading="x y yaw"))
    assert findings(track) == [("warning", "yaw-in-degrees", "poses.txt")]
    np.testing.assert_allclose(poses(track)[:, 2], small)
    assert findings(read(lines(*road.T, small, heading="x y yaw"))) == []
    hairpins = np.cumsum(np.stack([np.cos(20 * small), np.sin(20 * small)], axis=1), axis=0)
    assert findings(read(lines(*hairpins.T, 20 * small, heading="x y yaw"))) == []


def test_radians_may_wind_up():
    """Three turns on the spot are no degrees where the path says so."""
    angles = np.linspace(0, 6 * np.pi, 90)
    path = 5 * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    track = read(lines(*path.T, angles + np.pi / 2, heading="x y yaw"))
    assert findings(track) == []
    np.testing.assert_allclose(poses(track)[:, 2], angles + np.pi / 2)


MISTAKES = {
    "swapped columns": (
        lines(DRIVE.seconds, Y, X, DRIVE.yaws, heading="time x y yaw"),
        "warning poses.txt: headings turn the other way than the path: are x and y swapped, or is yaw clockwise?",
    ),
    "a quaternion with w first": (
        lines(DRIVE.seconds, X, Y, 0 * X, *np.roll(DRIVE.quaternions, 1, axis=1).T),
        "error poses.txt: the rotations are about x, which points up in no usual frame; is w first in the quaternion",
    ),
    "rotation before position": (
        lines(DRIVE.seconds, *DRIVE.quaternions.T, X, Y, 0 * X),
        "columns 5 to 8 are no unit quaternion",
    ),
    "quaternions that are not unit": (
        lines(DRIVE.seconds, X, Y, 0 * X, *(3 * DRIVE.quaternions).T, heading="time x y z qx qy qz qw"),
        "error poses.txt: the quaternions are no unit quaternions (norm 3); correct the columns",
    ),
    "TUM or EuRoC": (
        lines(DRIVE.seconds, X, Y, 0 * X, *DRIVE.quaternions.T, separator=","),
        "may be TUM (w of the quaternion last) or EuRoC (first); name them in a first line",
    ),
    "12 numbers that are no poses": (lines(*[X] * 12), "no rotation: not KITTI"),
    "no heading": (
        lines(IMAGES, X, Y, DRIVE.yaws, separator=","),
        "4 columns without a heading; name them in a first line, such as file,x,y,yaw or time,x,y,z,qx,qy,qz,qw",
    ),
    "decimal commas between commas": (
        "file,x,y\n1.png,0,5,1,5\n",
        "error poses.txt:2: 5 fields for 3 columns; are there decimal commas?",
    ),
    "nanoseconds that are not said to be": (
        lines(DRIVE.times_ns - START_NS, X, Y, heading="time x y"),
        "error poses.txt: time grows by 2e+08 a row, too much for seconds; name its unit, such as time_ns",
    ),
    "latitude": ("image,lat,lon\n1.png,47.1,8.1\n", "poses.txt:1: column 'lat' is an angle on the Earth; project it"),
    "a slip": ("file,x,y,yaww\n1.png,0,0,0\n", "error poses.txt:1: unknown column 'yaww'; did you mean yaw?"),
    "two columns for one thing": ("file,x,pos_x,y\n1.png,0,0,0\n", "columns 'x' and 'pos_x' may both be x; rename"),
    "half a quaternion": ("x,y,qz,qw\n0,0,0,1\n", "a quaternion needs qx, qy, qz and qw, there is no qx"),
    "no rows": ("file,x,y\n", "error poses.txt: it has a heading and no rows"),
    "nothing": ("# comment\n", "error poses.txt: it has no rows"),
    "a picture": (b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR", "error poses.txt: not UTF-8 text; save it as UTF-8"),
    "zeros": (b"x,y\n\0\0\n", "error poses.txt: not a text"),
}  # fmt: skip


@pytest.mark.parametrize(("text", "said"), MISTAKES.values(), ids=MISTAKES)
def test_a_mistake_is_said_with_what_to_do(text, said):
    assert said in words(text)


def test_one_rotation_that_is_none_has_its_heading_left_out():
    rows = tum(DRIVE).splitlines()
    track = read("\n".join([*rows[:3], " ".join([*rows[3].split()[:4], "0 0 0 0"]), *rows[4:]]))
    assert findings(track) == [("warning", "bad-rotation", "poses.txt:4")]
    assert [math.isnan(fix.pose.yaw) for fix in track.fixes] == [number == 3 for number in range(12)]


def test_compass_bearings_are_not_read_as_yaw():
    track = read("file,x,y,bearing\n1.png,0,0,10\n")
    assert (track.findings, math.isnan(track.fixes[0].pose.yaw)) == ((), True)
    assert "bearing is of a compass, clockwise, and is not read as yaw" in track.words


def test_rotations_about_no_one_axis_are_doubtful():
    wild = Rotation.random(12, rng=np.random.default_rng(0)).as_quat()
    track = read(lines(DRIVE.seconds, X, Y, 0 * X, *wild.T))
    assert findings(track) == [("warning", "odd-rotations", "poses.txt")]


def test_a_name_may_begin_like_a_comment_and_fields_may_be_quoted():
    track = read('file,x,y\n#1.png,0,0\n"a, b.png",1,2\n')
    assert [fix.name for fix in track.fixes] == ["#1.png", "a, b.png"]


def test_the_robot_may_stand_still():
    still = replace(DRIVE, places=0 * DRIVE.places, yaws=0 * DRIVE.yaws)
    assert read(tum(still)).findings == ()
    assert read(kitti(still)).words == "KITTI; ground z, -x (y is down); ahead is z of the camera"
