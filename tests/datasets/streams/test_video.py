"""Videos become sequences whose images are those that OpenCV decodes, with the times of the stream."""

import cv2
import numpy as np
import pytest

from omnieval.datasets import Camera, Mirror, load
from omnieval.datasets.check import check
from omnieval.datasets.registry import canonical
from omnieval.errors import DatasetError
from tests.datasets.streams.made import make_video, read_image, with_variable_rate

FRAMES = 20


@pytest.fixture
def video(tmp_path):
    levels = np.linspace(50, 250, FRAMES).astype(np.uint8)
    ramp = np.linspace(0, 1, 128)[None, :, None] * np.ones((32, 1, 3))
    return make_video(tmp_path / "my tour.mp4", [(ramp * level).astype(np.uint8) for level in levels])


def decoded(path):
    capture, images = cv2.VideoCapture(str(path)), []
    while (found := capture.read())[0]:
        images.append(found[1])
    return images


def seconds(sequence):
    return [frame.time_ns / 1e9 for frame in sequence.frames]


def test_every_frame_is_an_image_without_loss(video):
    sequence = load(f"video:{video}")
    images = [read_image(frame.path) for frame in sequence.frames]
    expected = decoded(video)
    assert len(images) == len(expected) == FRAMES
    assert all(np.array_equal(image, other) for image, other in zip(images, expected, strict=True))
    assert (sequence.name, sequence.frames[12].file) == ("my-tour", "frame000012.png")
    assert seconds(sequence) == pytest.approx([number / 10 for number in range(FRAMES)])


def test_every_nth_frame_keeps_its_number_and_time(video):
    sequence = load(f"video:{video}#every=6")
    assert [frame.file for frame in sequence.frames] == [f"frame0000{number:02}.png" for number in (0, 6, 12, 18)]
    assert seconds(sequence) == pytest.approx([0, 0.6, 1.2, 1.8])
    whole = load(f"video:{video}")
    assert [frame.read() for frame in sequence.frames] == [frame.read() for frame in whole.frames[::6]]


def test_the_times_of_a_variable_rate_are_those_of_the_stream(video):
    assert seconds(load(with_variable_rate(video, 1, 3))) == pytest.approx(
        [number / 10 for number in range(11)] + [1 + 0.3 * number for number in range(1, 10)]
    )


@pytest.mark.parametrize("name", ["tour.mp4", "TOUR.MP4", "a#b.mp4", "a#every=2.mp4", "50%, ü.mp4"])
def test_a_bare_path_is_recognised_and_its_source_loads_it_again(video, name):
    path = video.rename(video.with_name(name))
    sequence = load(str(path))
    assert load(sequence.source).frames == sequence.frames
    assert load(sequence.source).source == sequence.source == canonical(str(path))
    assert len(sequence) == FRAMES


def test_a_camera_beside_it_is_its_camera(video):
    text = 'kind = "omnidirectional"\n[mirror]\ncx = 64.0\ncy = 16.0\nr_in = 2.0\nr_out = 15.0\n'
    (video.parent / "camera.toml").write_text(text)
    assert load(video).camera == Camera("omnidirectional", Mirror(64, 16, 2, 15))


def codes(source):
    return [finding.code for finding in check(source).findings]


def test_a_video_that_lacks_its_end_is_refused_or_said_to_end_early(video):
    data = video.read_bytes()
    index = data.index(b"moov") - 4
    video.write_bytes(data[: index // 2])
    assert codes(video) == ["unreadable-stream"]
    with pytest.raises(DatasetError, match="cannot be read as a video"):
        load(video)
    # With its index in front, as on the web, what is there of it can be seen.
    box = data.index(b"mdat") - 4
    early = bytearray(data[:box] + data[index:] + data[box:index])
    shift, at = len(data) - index, early.index(b"stco") + 12
    for entry in range(int.from_bytes(early[at - 4 : at], "big")):
        place = slice(at + 4 * entry, at + 4 * entry + 4)
        early[place] = (int.from_bytes(early[place], "big") + shift).to_bytes(4, "big")
    video.write_bytes(early)
    assert codes(video) == []
    video.write_bytes(early[: len(early) - (index - box) // 2])
    assert codes(video) == ["ends-early"]
    assert 0 < len(load(video)) < FRAMES


@pytest.mark.parametrize("data", [b"", b"no video", b"\0" * 4096])
def test_what_is_no_video_is_refused(tmp_path, data):
    path = tmp_path / "tour.mp4"
    path.write_bytes(data)
    assert codes(path) == ["unreadable-stream"]


def test_a_video_that_is_not_there_is_said_to_be_missing(tmp_path):
    with pytest.raises(DatasetError, match=r"tour\.mp4: no such file"):
        load(f"video:{tmp_path / 'tour.mp4'}")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ("every=0", "must be a whole number from 1 on"),
        ("every=two", "must be a whole number from 1 on"),
        ("evry=2", "did you mean every?"),
        ("topic=/image", "unknown option 'topic'"),
        ("every=", "has no value"),
    ],
)
def test_options_that_make_no_sense_are_refused(video, options, message):
    with pytest.raises(DatasetError, match=message.replace("?", r"\?")):
        load(f"video:{video}#{options}")
