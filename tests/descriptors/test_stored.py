"""The descriptions of a sequence, handed to another process: the same to the bit, wherever they are."""

import pickle

import numpy as np
import pytest

from omnieval.descriptors.cache import DescriptorCache, image_digest
from omnieval.descriptors.description import DescribedFrame, Description
from omnieval.descriptors.segments import POSITION
from omnieval.descriptors.stored import StoredDescriptions, kept
from omnieval.errors import ConfigError, ResultError
from omnieval.imaging.glance import file_state

KEY = "a" * 32
COUNT = 70


def a_description(number):
    rng = np.random.default_rng(number)
    return Description(rng.random(6, np.float32), rng.random((4, 3), np.float32))


@pytest.fixture
def images(tmp_path):
    """Descriptions of files, and the files."""
    described = []
    for number in range(COUNT):
        file = tmp_path / f"{number}.png"
        file.write_bytes(b"%d" % number)
        described.append((file, DescribedFrame(a_description(number), image_digest(file.read_bytes()))))
    return described


def through(cache, images):
    """Yield as a describer does."""
    for file, described in images:
        known = cache.lookup(file, KEY)
        yield known or cache.store(file, file_state(file), KEY, described)


def check(stored, order):
    expected = [a_description(number) for number in order]
    for one in (stored, pickle.loads(pickle.dumps(stored)), stored.held()):
        assert len(one) == len(expected)
        assert one.orientation_values == 12
        assert np.array_equal(one.array("position"), [each.position for each in expected])
        assert np.array_equal(one.array("orientation"), [each.orientation for each in expected])
        for got, wanted in zip(one, expected, strict=True):
            assert np.array_equal(got.position, wanted.position)
            assert np.array_equal(got.orientation, wanted.orientation)


def test_what_the_cache_keeps_is_read_there_and_nothing_is_copied(tmp_path, images):
    with DescriptorCache(tmp_path / "c") as cache:
        stored = kept(through(cache, images), cache, tmp_path / "own")
    check(stored, range(COUNT))
    assert not (tmp_path / "own").exists()
    assert not stored.array("position").flags.owndata
    assert not stored.array("position").flags.writeable
    assert len(pickle.dumps(stored)) < 3000


def test_images_of_several_segments_in_any_order_come_in_that_order(tmp_path, images):
    for some in (images[40:], images[:40]):
        with DescriptorCache(tmp_path / "c") as cache:
            list(through(cache, some))
    order = [*range(60, 10, -7), 3, 3, 69]
    with DescriptorCache(tmp_path / "c") as cache:
        stored = kept(through(cache, [images[number] for number in order]), cache, tmp_path / "own")
        assert cache.misses == 0
    check(stored, order)
    assert len(stored.segments) == 2


@pytest.mark.parametrize("known", [0, 30])
def test_what_the_cache_cannot_keep_is_kept_in_a_folder(tmp_path, images, monkeypatch, known):
    with DescriptorCache(tmp_path / "c") as cache:
        list(through(cache, images[:known]))

    def full(stream, offset, data):
        if "/c/" in str(stream.name):
            raise OSError(28, "No space left on device")
        stream.seek(offset)
        stream.write(data)

    monkeypatch.setattr("omnieval.descriptors.segments._write_at", full)
    with DescriptorCache(tmp_path / "c") as cache:
        stored = kept(through(cache, images), cache, tmp_path / "own")
        assert cache.note is not None
        assert "No space left" in cache.note
    check(stored, range(COUNT))
    assert len(stored.segments) == 1 + (known > 0)
    assert (tmp_path / "own").exists()


def test_without_a_cache_all_are_in_the_folder(tmp_path, images):
    check(kept((described for _, described in images), None, tmp_path / "own"), range(COUNT))


def test_descriptions_that_are_gone_or_others_are_refused(tmp_path, images):
    stored = kept((described for _, described in images), None, tmp_path / "own")
    elsewhere = pickle.dumps(stored)
    (file,) = (tmp_path / "own").glob(f"*{POSITION}")
    whole = file.read_bytes()
    file.write_bytes(whole[:8] + b"\0" + whole[9:])
    with pytest.raises(ResultError, match="are not what was written; run it again"):
        pickle.loads(elsewhere).array("position")
    file.write_bytes(whole[:-24])
    with pytest.raises(ResultError, match="rows are missing"):
        list(pickle.loads(elsewhere))
    file.unlink()
    with pytest.raises(ResultError, match="No such file"):
        pickle.loads(elsewhere).array("orientation")


def test_descriptions_of_several_shapes_are_refused(tmp_path, images):
    other = DescribedFrame(Description(np.ones(7, np.float32), np.ones((4, 3), np.float32)), image_digest(b""))
    with pytest.raises(ConfigError, match=r"of one shape.* position \(7,\) and orientation \(4, 3\) differ"):
        kept([images[0][1], other], None, tmp_path / "own")


def test_a_folder_that_cannot_be_written_is_an_error(tmp_path, images):
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(ResultError, match=r"cannot write .*file/own: Not a directory; choose another --out"):
        kept([images[0][1]], None, tmp_path / "file" / "own")


def test_it_holds_no_more_than_its_fields_when_it_is_sent(tmp_path, images):
    stored = kept((described for _, described in images), None, tmp_path / "own")
    assert set(stored.__getstate__()) == set(StoredDescriptions.__dataclass_fields__)
