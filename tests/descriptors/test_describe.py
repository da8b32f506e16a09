"""Frames to descriptions: in order, each image at most once, errors where they belong."""

import itertools

import cv2
import numpy as np
import pytest

from omnieval.datasets.sequence import Frame
from omnieval.descriptors.cache import DescriptorCache, image_digest
from omnieval.descriptors.describe import Describer
from omnieval.descriptors.hog import Hog, HogConfig
from omnieval.errors import DatasetError
from omnieval.imaging.camera import CameraModel
from omnieval.imaging.decode import decode_grey

CAMERA = CameraModel("panoramic", None, 32, 64, "the images are panoramas", (64, 32))
HOG = Hog(HogConfig(orientation_cells=32))


@pytest.fixture
def frames(tmp_path):
    rng = np.random.default_rng(0)
    frames = [Frame(tmp_path / f"{number:02d}.png", f"{number:02d}.png") for number in range(40)]
    for frame in frames:
        cv2.imwrite(str(frame.path), rng.integers(0, 256, (32, 64), np.uint8))
    return frames


@pytest.fixture
def read(monkeypatch):
    """Names of the files read, in no particular order."""
    names: list[str] = []
    reading = Frame.read

    def noted(frame):
        names.append(frame.file)
        return reading(frame)

    monkeypatch.setattr(Frame, "read", noted)
    return names


def test_descriptions_come_in_order_and_are_those_of_the_images(tmp_path, frames):
    with DescriptorCache(tmp_path / "c.sqlite") as cache:
        described = list(Describer(CAMERA, HOG, cache).describe_frames(frames))
    for frame, one in zip(frames, described, strict=True):
        expected = HOG.describe(decode_grey(frame.read(), frame.file))
        assert one.digest == image_digest(frame.read())
        assert np.array_equal(one.description.position, expected.position)
        assert np.array_equal(one.description.orientation, expected.orientation)


def test_the_second_time_no_image_is_read(tmp_path, frames, read):
    with DescriptorCache(tmp_path / "c.sqlite") as cache:
        first = list(Describer(CAMERA, HOG, cache).describe_frames(frames))
    assert sorted(read) == [frame.file for frame in frames]
    read.clear()
    with DescriptorCache(tmp_path / "c.sqlite") as cache:
        second = list(Describer(CAMERA, HOG, cache).describe_frames(frames))
        assert (cache.hits, cache.misses) == (40, 0)
    assert read == []
    assert [one.digest for one in second] == [one.digest for one in first]
    for before, after in zip(first, second, strict=True):
        assert np.array_equal(before.description.orientation, after.description.orientation)


def test_other_settings_do_not_find_each_others_descriptions(tmp_path, frames, read):
    flatter = CameraModel("panoramic", None, 16, 64, "", (64, 32))
    others = [(CAMERA, Hog(HogConfig(orientation_cells=32, bins=8))), (flatter, HOG)]
    for camera, descriptor in [(CAMERA, HOG), *others]:
        with DescriptorCache(tmp_path / "c.sqlite") as cache:
            list(Describer(camera, descriptor, cache).describe_frames(frames[:5]))
            assert cache.hits == 0
    assert len(read) == 15


def test_a_bad_image_is_reported_when_it_is_its_turn(tmp_path, frames):
    frames[7].path.write_bytes(b"no image")
    with DescriptorCache(tmp_path / "c.sqlite") as cache:
        describing = Describer(CAMERA, HOG, cache).describe_frames(frames)
        assert len(list(itertools.islice(describing, 7))) == 7
        with pytest.raises(DatasetError, match=r"07\.png"):
            next(describing)
    with DescriptorCache(tmp_path / "c.sqlite") as cache:
        assert len(list(Describer(CAMERA, HOG, cache).describe_frames(frames[:7]))) == 7
        assert cache.hits == 7


def test_only_a_few_frames_are_read_ahead(tmp_path, frames, read):
    with DescriptorCache(tmp_path / "c.sqlite") as cache:
        describing = Describer(CAMERA, HOG, cache).describe_frames(frames)
        assert len(list(itertools.islice(describing, 2))) == 2
        describing.close()
    assert 2 <= len(read) <= 20


def test_an_omnidirectional_image_of_another_size_is_named(tmp_path, frames):
    camera = CameraModel("panoramic", None, 32, 64, "", size=(640, 480))
    with (
        DescriptorCache(tmp_path / "c.sqlite") as cache,
        pytest.raises(DatasetError, match=r"00\.png is 64 x 32 pixels, the first one 640 x 480"),
    ):
        next(Describer(camera, HOG, cache).describe_frames(frames))
