"""Frames to descriptions: in order, each image at most once, errors where they belong."""

import itertools
import os
from dataclasses import replace

import cv2
import numpy as np
import pytest

from omnieval.components.component import resolve_component
from omnieval.datasets.sequence import Frame
from omnieval.descriptors.cache import DescriptorCache, image_digest
from omnieval.descriptors.describe import Describer
from omnieval.descriptors.description import DescribedFrame, Description
from omnieval.descriptors.hog import Hog, HogSettings
from omnieval.errors import ConfigError, DatasetError
from omnieval.imaging.camera import CameraModel
from omnieval.imaging.decode import decode_grey
from omnieval.imaging.mask import MaskFile

CAMERA = CameraModel("panoramic", None, 32, 64, "the images are panoramas", (64, 32))
HOG = resolve_component("descriptor", Hog(HogSettings(orientation_cells=32)))
STORED = [cv2.IMWRITE_PNG_COMPRESSION, 0]
"""Images of one size have files of one size."""


@pytest.fixture
def frames(tmp_path):
    rng = np.random.default_rng(0)
    frames = [Frame(tmp_path / f"{number:02d}.png", f"{number:02d}.png") for number in range(40)]
    for frame in frames:
        cv2.imwrite(str(frame.path), rng.integers(0, 256, (32, 64), np.uint8), STORED)
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
    with DescriptorCache(tmp_path / "c") as cache:
        described = list(Describer(CAMERA, HOG, cache).describe_frames(frames))
    for frame, one in zip(frames, described, strict=True):
        expected = HOG.make().describe(decode_grey(frame.read(), frame.file))
        assert one.digest == image_digest(frame.read())
        assert np.array_equal(one.description.position, expected.position)
        assert np.array_equal(one.description.orientation, expected.orientation)


def test_the_second_time_no_image_is_read(tmp_path, frames, read):
    with DescriptorCache(tmp_path / "c") as cache:
        first = list(Describer(CAMERA, HOG, cache).describe_frames(frames))
    assert sorted(read) == [frame.file for frame in frames]
    read.clear()
    with DescriptorCache(tmp_path / "c") as cache:
        second = list(Describer(CAMERA, HOG, cache).describe_frames(frames))
        assert (cache.hits, cache.misses) == (40, 0)
    assert read == []
    assert [one.digest for one in second] == [one.digest for one in first]
    for before, after in zip(first, second, strict=True):
        assert np.array_equal(before.description.orientation, after.description.orientation)


def test_other_settings_do_not_find_each_others_descriptions(tmp_path, frames, read):
    flatter = CameraModel("panoramic", None, 16, 64, "", (64, 32))
    others = [(CAMERA, resolve_component("descriptor", Hog(HogSettings(orientation_cells=32, bins=8)))), (flatter, HOG)]
    for camera, descriptor in [(CAMERA, HOG), *others]:
        with DescriptorCache(tmp_path / "c") as cache:
            list(Describer(camera, descriptor, cache).describe_frames(frames[:5]))
            assert cache.hits == 0
    assert len(read) == 15


def test_a_bad_image_is_reported_when_it_is_its_turn(tmp_path, frames):
    frames[7].path.write_bytes(b"no image")
    with DescriptorCache(tmp_path / "c") as cache:
        describing = Describer(CAMERA, HOG, cache).describe_frames(frames)
        assert len(list(itertools.islice(describing, 7))) == 7
        with pytest.raises(DatasetError, match=r"07\.png"):
            next(describing)
    with DescriptorCache(tmp_path / "c") as cache:
        assert len(list(Describer(CAMERA, HOG, cache).describe_frames(frames[:7]))) == 7
        assert cache.hits == 7


def test_only_a_few_frames_are_read_ahead(tmp_path, frames, read):
    with DescriptorCache(tmp_path / "c") as cache:
        describing = Describer(CAMERA, HOG, cache).describe_frames(frames)
        assert len(list(itertools.islice(describing, 2))) == 2
        describing.close()
    assert 2 <= len(read) <= 20


def test_an_omnidirectional_image_of_another_size_is_named(tmp_path, frames):
    camera = CameraModel("panoramic", None, 32, 64, "", size=(640, 480))
    with (
        DescriptorCache(tmp_path / "c") as cache,
        pytest.raises(DatasetError, match=r"00\.png is 64 x 32 pixels, the first one 640 x 480"),
    ):
        next(Describer(camera, HOG, cache).describe_frames(frames))


OWN = """
import numpy as np
import omnieval
{imported}

class Own:
    def describe(self, panorama):
        position = np.array([panorama.mean(), {value}], np.float32)
        return omnieval.Description(position, panorama[:32].astype(np.float32))
"""


def describe_all(tmp_path, frames, chosen):
    """Return the second number of every description, and how many the cache knew."""
    with DescriptorCache(tmp_path / "c") as cache:
        component = resolve_component("descriptor", chosen)
        described = list(Describer(CAMERA, component, cache).describe_frames(frames))
        return {float(one.description.position[1]) for one in described}, cache.hits


@pytest.mark.parametrize("edited", ["own.py", "beside.py"])
def test_edited_code_of_ones_own_is_never_answered_from_the_cache(tmp_path, frames, edited):
    own, beside = tmp_path / "own.py", tmp_path / "beside.py"
    own.write_text(OWN.format(imported="from beside import VALUE", value="VALUE + 0"))
    beside.write_text("VALUE = 1\n")
    assert describe_all(tmp_path, frames, f"{own}:Own") == ({1.0}, 0)
    assert describe_all(tmp_path, frames, f"{own}:Own") == ({1.0}, 40)
    before = (tmp_path / edited).stat()
    (tmp_path / edited).write_text((tmp_path / edited).read_text().replace("+ 0", "+ 1").replace("= 1", "= 2"))
    os.utime(tmp_path / edited, ns=(before.st_atime_ns, before.st_mtime_ns))
    assert describe_all(tmp_path, frames, f"{own}:Own") == ({2.0}, 0)


def test_two_descriptors_of_one_name_do_not_find_each_others_descriptions(tmp_path, frames):
    found = []
    for value in (1, 2):
        folder = tmp_path / str(value)
        folder.mkdir()
        (folder / "own.py").write_text(OWN.format(imported="", value=value))
        found.append(describe_all(tmp_path, frames, f"{folder}/own.py:Own"))
    assert found == [({1.0}, 0), ({2.0}, 0)]


def test_images_replaced_with_the_same_size_and_time_are_described_anew(tmp_path, frames):
    with DescriptorCache(tmp_path / "c") as cache:
        before = list(Describer(CAMERA, HOG, cache).describe_frames(frames))
    for frame in frames:
        status = frame.path.stat()
        cv2.imwrite(str(frame.path), 255 - decode_grey(frame.read(), frame.file), STORED)
        assert frame.path.stat().st_size == status.st_size
        os.utime(frame.path, ns=(status.st_atime_ns, status.st_mtime_ns))
    with DescriptorCache(tmp_path / "c") as cache:
        after = list(Describer(CAMERA, HOG, cache).describe_frames(frames))
        assert cache.hits == 0
    assert all(one.digest != other.digest for one, other in zip(before, after, strict=True))
    assert after[3].digest == image_digest(frames[3].path.read_bytes())


def test_an_image_that_is_replaced_while_it_is_described_is_not_taken_for_the_one_that_was(tmp_path, frames):
    class Replacing:
        def describe(self, panorama):
            cv2.imwrite(str(frames[0].path), 255 - decode_grey(frames[0].read(), "0"), STORED)
            return Description(panorama[:4].mean(axis=1, dtype=np.float32), panorama[:4, :1].astype(np.float32))

    replacing = resolve_component("descriptor", Replacing())
    found: list[DescribedFrame] = []
    for _ in range(2):
        with DescriptorCache(tmp_path / "c") as cache:
            found += Describer(CAMERA, replacing, cache).describe_frames(frames[:1])
            assert cache.hits == 0
    assert found[0].digest != found[1].digest


def test_a_descriptor_that_asks_for_colour_is_given_colour_where_a_mask_is_filled_in_too(tmp_path):
    image = np.random.default_rng(3).integers(0, 256, (32, 64, 3), np.uint8)
    frame = Frame(tmp_path / "colour.png", "colour.png")
    cv2.imwrite(str(frame.path), image)
    black = np.full((32, 64), 255, np.uint8)
    black[:, 10:14] = 0
    masked = replace(CAMERA, mask=MaskFile(tmp_path / "mask.png", "digest", black))
    given = []

    class Sees:
        colour = True

        def describe(self, panorama):
            given.append(panorama)
            return Description(np.ones(1, np.float32), np.ones((1, 1), np.float32))

    with DescriptorCache(tmp_path / "c") as cache:
        for camera in (CAMERA, masked):
            next(Describer(camera, resolve_component("descriptor", Sees()), cache).describe_frames([frame]))
    assert np.array_equal(given[0], image)
    assert np.array_equal(given[1][:, 20:], image[:, 20:])
    assert given[1].shape == image.shape
    between = (given[1][:, 11].astype(int) - image[:, 8]) * (given[1][:, 11].astype(int) - image[:, 15])
    assert (between <= 0).all(), "each channel is blended from the seen pixels on either side"


class Batched:
    """Hands on the mean of panoramas, and notes how many it was given at once."""

    batch = 3

    def __init__(self, given):
        self.given = given

    def describe(self, panorama):
        return self.describe_batch([panorama])[0]

    def describe_batch(self, panoramas):
        self.given.append(len(panoramas))
        return [Description(np.array([one.mean()], np.float32), np.ones((1, 1), np.float32)) for one in panoramas]


def test_panoramas_are_described_several_at_once_by_a_descriptor_that_can(tmp_path, frames):
    given: list[int] = []
    batched = resolve_component("descriptor", Batched(given))
    with DescriptorCache(tmp_path / "c") as cache:
        list(Describer(CAMERA, batched, cache).describe_frames(frames[4:5]))
    with DescriptorCache(tmp_path / "c") as cache:
        described = list(Describer(CAMERA, batched, cache).describe_frames(frames[:11]))
    assert sorted(given) == [1, 2, 2, 3, 3], "one was known already"
    means = [decode_grey(frame.read(), frame.file).mean(dtype=np.float64) for frame in frames[:11]]
    np.testing.assert_allclose([float(one.description.position[0]) for one in described], means, rtol=1e-6)
    assert [one.digest for one in described] == [image_digest(frame.read()) for frame in frames[:11]]


def test_a_bad_image_of_a_batch_is_reported_when_it_is_its_turn_and_the_others_are_described(tmp_path, frames):
    frames[4].path.write_bytes(b"no image")
    batched = resolve_component("descriptor", Batched([]))
    with DescriptorCache(tmp_path / "c") as cache:
        describing = Describer(CAMERA, batched, cache).describe_frames(frames)
        assert len(list(itertools.islice(describing, 4))) == 4
        with pytest.raises(DatasetError, match=r"04\.png"):
            next(describing)


def test_too_few_descriptions_of_a_batch_are_told_with_the_images(tmp_path, frames):
    class Loses(Batched):
        def describe_batch(self, panoramas):
            return super().describe_batch(panoramas)[1:]

    with (
        DescriptorCache(tmp_path / "c") as cache,
        pytest.raises(
            ConfigError, match=r"loses made 2 descriptions of 3 panoramas, from image .*00\.png to .*02\.png"
        ),
    ):
        next(Describer(CAMERA, resolve_component("descriptor", Loses([])), cache).describe_frames(frames))


def test_what_a_descriptor_of_ones_own_raises_is_told_with_the_image(tmp_path, frames):
    class Broken:
        def describe(self, panorama):
            raise ValueError("no\nsuch")

    with (
        DescriptorCache(tmp_path / "c") as cache,
        pytest.raises(ConfigError, match=r"the descriptor broken failed on image .*00\.png: ValueError: no such"),
    ):
        next(Describer(CAMERA, resolve_component("descriptor", Broken()), cache).describe_frames(frames))


def test_images_under_other_names_are_described_once_and_then_not_even_read(tmp_path, frames, read):
    """As when a sequence was moved, or two have images in common."""
    with DescriptorCache(tmp_path / "c") as cache:
        first = list(Describer(CAMERA, HOG, cache).describe_frames(frames))
    folder = tmp_path / "moved"
    folder.mkdir()
    moved = [Frame(folder / f"x{frame.file}", frame.file) for frame in frames]
    for old, new in zip(frames, moved, strict=True):
        new.path.write_bytes(old.path.read_bytes())
    read.clear()
    for times_read in (40, 0):
        with DescriptorCache(tmp_path / "c") as cache:
            again = list(Describer(CAMERA, HOG, cache).describe_frames(moved))
            assert (cache.hits, cache.misses, len(read)) == (40, 0, times_read)
        read.clear()
        assert all(
            np.array_equal(a.description.position, b.description.position) for a, b in zip(first, again, strict=True)
        )


@pytest.mark.parametrize("cut", [slice(7, None), slice(None, None, 3), slice(30, None, -1)])
def test_a_sequence_that_is_cut_differently_is_known(tmp_path, frames, read, cut):
    with DescriptorCache(tmp_path / "c") as cache:
        list(Describer(CAMERA, HOG, cache).describe_frames(frames))
    read.clear()
    with DescriptorCache(tmp_path / "c") as cache:
        list(Describer(CAMERA, HOG, cache).describe_frames(frames[cut]))
        assert (cache.misses, read) == (0, [])
