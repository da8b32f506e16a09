"""Bags of all kinds become sequences: images of a topic, in the order of their times, with poses of another."""

import builtins
import math
import shutil

import cv2
import numpy as np
import pytest

from omnieval.datasets import load
from omnieval.datasets.check import check
from omnieval.errors import ConfigError, DatasetError
from tests.datasets.streams.made import KINDS, START_NS, STEP_NS, Maker, read_image

TIMES = [START_NS + number * STEP_NS for number in range(6)]
RNG = np.random.default_rng(1)
IMAGES = RNG.integers(0, 256, (6, 8, 24, 3), np.uint8)


@pytest.fixture(params=KINDS)
def kind(request):
    return request.param


def place(tmp_path, kind):
    return tmp_path / ("tour.bag" if kind == "ros1" else f"tour-{kind}")


def tour(path, kind, *topics):
    with Maker(path, kind) as bag:
        for time, image in zip(TIMES, IMAGES, strict=True):
            for topic in topics or ("/camera/image_raw",):
                bag.image(topic, time, image, "bgr8")
    return path


def codes(source):
    return [finding.code for finding in check(source).findings]


def refusal(source):
    with pytest.raises(DatasetError) as refused:
        load(source)
    return str(refused.value)


def test_images_are_those_of_the_topic(tmp_path, kind):
    path = tour(place(tmp_path, kind), kind)
    sequence = load(str(path))
    assert np.array_equal([read_image(frame.path) for frame in sequence.frames], IMAGES)
    assert [frame.time_ns for frame in sequence.frames] == TIMES
    assert sequence.source == f"bag:{path}"
    assert codes(sequence.source) == ["no-poses"]
    assert [frame.file for frame in load(f"bag:{path}#every=4").frames] == ["frame000000.png", "frame000004.png"]


def test_compressed_images_keep_their_bytes(tmp_path, kind):
    jpeg, png, webp = (cv2.imencode(ending, IMAGES[0])[1].tobytes() for ending in (".jpg", ".png", ".webp"))
    with Maker(place(tmp_path, kind), kind) as bag:
        forms = ("jpeg", "bgr8; png compressed bgr8", "webp")
        for time, data, form in zip(TIMES, (jpeg, png, webp), forms, strict=False):
            bag.compressed("/camera/compressed", time, data, form)
        bag.compressed("/camera/compressedDepth", TIMES[0], b"\0" * 12 + png, "16UC1; compressedDepth png")
    first, second, third = load(str(bag.path)).frames
    assert (first.read(), second.read()) == (jpeg, png)
    assert [frame.path.suffix for frame in (first, second, third)] == [".jpg", ".png", ".png"]
    expected = np.asarray(cv2.imdecode(np.frombuffer(webp, np.uint8), cv2.IMREAD_COLOR))
    assert np.array_equal(read_image(third.path), expected)


def test_a_compressed_image_that_is_cut_off_is_a_finding_like_in_a_folder(tmp_path):
    jpeg = cv2.imencode(".jpg", IMAGES[0])[1].tobytes()
    with Maker(tmp_path / "tour.bag", "ros1") as bag:
        for time, data in zip(TIMES, (jpeg, jpeg[:-60], jpeg), strict=False):
            bag.compressed("/image", time, data, "jpeg")
    assert "truncated-image" in codes(bag.path)


def test_of_several_topics_one_must_be_named(tmp_path, kind):
    path = tour(place(tmp_path, kind), kind, "/left", "/right")
    assert "there are 2 topics of images; choose one with --topic: /left (sensor_msgs/Image, 6), /right" in refusal(
        path
    )
    assert len(load(f"bag:{path}#topic=/left")) == len(load(f"bag:{path}#topic=left")) == 6
    assert "no topic '/up' (--topic); topics of images are /left (sensor_msgs/Image, 6), /right" in refusal(
        f"bag:{path}#topic=/up"
    )


def test_a_bag_without_images_says_what_it_has(tmp_path, kind):
    with Maker(place(tmp_path, kind), kind) as bag:
        bag.odometry("/odom", TIMES[0], 0.0, 0.0, 0.0)
    assert "there is no topic of images, only /odom (nav_msgs/Odometry, 1)" in refusal(bag.path)
    assert "topic /odom is of type nav_msgs/Odometry, which holds no images" in refusal(f"bag:{bag.path}#topic=/odom")


@pytest.mark.parametrize(
    ("kind", "of"), [("ros1", "pose_stamped"), ("sqlite3", "pose_with_covariance"), ("mcap", "odometry")]
)
def test_poses_are_interpolated_at_the_times_of_images(tmp_path, kind, of):
    with Maker(place(tmp_path, kind), kind) as bag:
        for number, time in enumerate(TIMES):
            bag.image("/image", time, IMAGES[number], "bgr8")
            # Half a step earlier, and turning through the direction in which yaw jumps.
            getattr(bag, of)("/where", time - STEP_NS // 2, 2.0 * number, -1.0 * number, math.pi - 0.25 + 0.1 * number)
    sequence = load(f"bag:{bag.path}#pose-topic=/where")
    assert sequence.positions is not None
    assert sequence.positions[:5] == pytest.approx(np.array([[2 * n + 1, -n - 0.5] for n in range(5)]))
    assert sequence.positions[5] == pytest.approx([10, -5])  # the last pose, half a step away
    assert sequence.yaws is not None
    expected = [math.remainder(math.pi - 0.2 + 0.1 * number, math.tau) for number in range(5)]
    assert sequence.yaws[:5] == pytest.approx(expected)
    (said,) = check(sequence.source).findings
    assert said.code == "poses-read"
    assert "between neighbours at most 1 s apart, else the nearest within 0.1 s: 6 of 6 images" in said.message


def test_other_poses_need_no_other_images(tmp_path):
    with Maker(tmp_path / "tour.bag", "ros1") as bag:
        for number, time in enumerate(TIMES):
            bag.image("/image", time, IMAGES[number], "bgr8")
            bag.odometry("/odom", time, 1.0, 2.0, 0.0)
            bag.pose_stamped("/truth", time, 3.0, 4.0, 0.0)
    unposed, odom, truth = (load(f"bag:{bag.path}{end}") for end in ("", "#pose-topic=/odom", "#pose-topic=/truth"))
    assert unposed.root == odom.root == truth.root
    assert [frame.pose for frame in unposed.frames] == [None] * 6
    assert np.array_equal(np.unique(np.asarray(odom.positions), axis=0), [[1, 2]])
    assert np.array_equal(np.unique(np.asarray(truth.positions), axis=0), [[3, 4]])


def test_a_frame_of_transforms_needs_a_topic_of_them(tmp_path):
    with Maker(tmp_path / "tour.bag", "ros1") as bag:
        bag.image("/image", TIMES[0], IMAGES[0], "bgr8")
        bag.odometry("/odom", TIMES[0], 1.0, 2.0, 0.0)
    assert "name that with --pose-topic" in refusal(f"bag:{bag.path}#pose-frame=base_link")
    assert "--pose-frame is for topics of transforms" in refusal(
        f"bag:{bag.path}#pose-topic=/odom,pose-frame=base_link"
    )


def test_images_far_in_time_from_any_pose_have_none(tmp_path):
    with Maker(tmp_path / "tour.bag", "ros1") as bag:
        for number, time in enumerate(TIMES):
            bag.image("/image", time, IMAGES[number], "bgr8")
        for time in (TIMES[1], TIMES[2], TIMES[2] + 20 * STEP_NS):
            bag.odometry("/odom", time, 1.0, 2.0, 0.0)
    sequence = load(f"bag:{bag.path}#pose-topic=/odom")
    assert [frame.pose is None for frame in sequence.frames] == [False, False, False, False, True, True]
    assert codes(sequence.source) == ["image-without-pose", "poses-read"]


def test_poses_of_a_topic_come_to_images_as_those_of_a_file_do(tmp_path):
    """The same options, the same rule: what a topic says and what a TUM file with the same poses says is one."""
    stamps = [TIMES[0] + 3 * STEP_NS // 10, TIMES[1], TIMES[4]]
    tum = tmp_path / "poses.tum"
    tum.write_text("".join(f"{time // 10**9}.{time % 10**9:09d} {x} 0 0 0 0 0 1\n" for x, time in enumerate(stamps)))
    with Maker(tmp_path / "tour.bag", "ros1") as bag:
        for number, time in enumerate(TIMES):
            bag.image("/image", time, IMAGES[number], "bgr8")
        for x, time in enumerate(stamps):
            bag.odometry("/odom", time, float(x), 0.0, 0.0)
    gap = 3 * STEP_NS / 1e9
    expected = {
        (0, 0): [None, 1, None, None, 2, None],
        (0, gap): [None, 1, 4 / 3, 5 / 3, 2, None],
        (0.6 * STEP_NS / 1e9, 0): [0, 1, None, None, 2, None],
        (1.1 * STEP_NS / 1e9, gap): [0, 1, 4 / 3, 5 / 3, 2, 2],
    }
    for (tolerance, interpolate), places in expected.items():
        of_topic, of_file = (
            load(f"bag:{bag.path}{end}", poses=file, poses_tolerance=tolerance, poses_interpolate=interpolate)
            for end, file in (("#pose-topic=/odom", None), ("", tum))
        )
        for sequence in (of_topic, of_file, load(of_topic.source)):
            found = [None if frame.pose is None else frame.pose.x for frame in sequence.frames]
            assert found == pytest.approx(places), (tolerance, interpolate)


def test_how_poses_of_a_topic_come_to_images_must_be_seconds(tmp_path):
    path = tour(tmp_path / "tour.bag", "ros1")
    assert "poses-interpolate=soon" in refusal(f"bag:{path}#pose-topic=/odom,poses-interpolate=soon")


def test_transforms_are_chained_from_the_root_to_what_moves(tmp_path, kind):
    with Maker(place(tmp_path, kind), kind) as bag:
        bag.transform("/tf_static", TIMES[0] - 10**12, "base_link", "camera", 0.0, 1.0, 0.0)
        for number, time in enumerate(TIMES):
            bag.image("/image", time, IMAGES[number], "bgr8")
            bag.transform("/tf", time, "map", "odom", 10.0, 0.0, math.pi / 2)
            bag.transform("/tf", time, "odom", "base_link", 1.0 * number, 0.0, 0.0)
    base = load(f"bag:{bag.path}#pose-topic=/tf")
    assert base.positions == pytest.approx(np.array([[10.0, number] for number in range(6)]))
    assert base.yaws == pytest.approx(np.full(6, math.pi / 2))
    camera = load(f"bag:{bag.path}#pose-topic=/tf,pose-frame=camera")
    assert camera.positions == pytest.approx(np.array([[9.0, number] for number in range(6)]))
    assert "has no frame 'laser' (--pose-frame); it has base_link, camera, odom" in refusal(
        f"bag:{bag.path}#pose-topic=/tf,pose-frame=laser"
    )


def test_of_several_frames_that_move_one_must_be_named(tmp_path):
    with Maker(tmp_path / "tour.bag", "ros1") as bag:
        for number, time in enumerate(TIMES):
            bag.image("/image", time, IMAGES[number], "bgr8")
            bag.transform("/tf", time, "odom", "base_link", 1.0 * number, 0.0, 0.0)
            bag.transform("/tf", time, "base_link", "left_wheel", 0.0, 0.3, 0.0)
            bag.transform("/tf", time, "base_link", "right_wheel", 0.0, -0.3, 0.0)
    assert "moves 2 frames; name one with --pose-frame: base_link, left_wheel" in refusal(
        f"bag:{bag.path}#pose-topic=/tf"
    )
    base = load(f"bag:{bag.path}#pose-topic=/tf,pose-frame=/base_link")
    assert base.positions == pytest.approx(np.array([[number, 0.0] for number in range(6)]))


def test_images_are_in_the_order_of_their_own_times(tmp_path, kind):
    with Maker(place(tmp_path, kind), kind) as bag:
        for number in (1, 0, 2):
            bag.image("/image", TIMES[number], IMAGES[number], "bgr8", recorded_ns=TIMES[0] + (number + 2) % 3)
    sequence = load(bag.path)
    assert [frame.time_ns for frame in sequence.frames] == TIMES[:3]


def test_without_times_of_their_own_those_of_recording_are_taken_for_images_and_poses(tmp_path, kind):
    with Maker(place(tmp_path, kind), kind) as bag:
        for number, time in enumerate(TIMES):
            bag.image("/image", 0, IMAGES[number], "bgr8", recorded_ns=time)
            bag.odometry("/odom", time, 1.0 * number, 0.0, 0.0)
    sequence = load(f"bag:{bag.path}#pose-topic=/odom")
    assert [frame.time_ns for frame in sequence.frames] == TIMES
    assert sequence.positions == pytest.approx(np.array([[number, 0.0] for number in range(6)]))
    assert codes(sequence.source) == ["times-of-recording", "poses-read"]


def test_a_bag_that_is_cut_off_is_refused(tmp_path, kind):
    path = tour(place(tmp_path, kind), kind)
    file = path if kind == "ros1" else next(file for file in path.iterdir() if file.suffix in {".mcap", ".db3"})
    file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])
    assert codes(path) == ["unreadable-stream"]
    assert "cut off or damaged" in refusal(path)


@pytest.mark.parametrize("kind", ["sqlite3", "mcap"])
def test_a_file_of_ros2_needs_no_folder_around_it(tmp_path, kind):
    path = tour(place(tmp_path, kind), kind)
    whole = load(path)
    (path / "metadata.yaml").unlink()  # as after a recording that was interrupted
    loose = next(iter(path.iterdir()))
    for source in (path, loose):
        again = load(source)
        assert [frame.read() for frame in again.frames] == [frame.read() for frame in whole.frames]
    shutil.copy(loose, path / f"second{loose.suffix}")
    assert "2 files of a recording" in refusal(path)


def test_what_is_no_image_is_refused(tmp_path):
    with Maker(tmp_path / "tour.bag", "ros1") as bag:
        bag.image("/depth", TIMES[0], np.ones((8, 8), np.float32), "32FC1")
    assert "image 0 of topic /depth has encoding '32FC1', which is not an image" in refusal(bag.path)


def test_without_rosbags_it_is_said_what_to_install(tmp_path, monkeypatch):
    path = tour(tmp_path / "tour.bag", "ros1")
    installed = builtins.__import__

    def without(name, *rest):
        if name.partition(".")[0] == "rosbags":
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
        return installed(name, *rest)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(ConfigError, match=r"pip install 'omnieval\[bag\]'"):
        load(path)
