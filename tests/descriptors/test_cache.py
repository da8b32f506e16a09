"""The descriptor cache: found again, never trusted when damaged, never in the way."""

import contextlib
import os
import sqlite3

import numpy as np
import pytest

from omnieval.descriptors.cache import DescriptorCache, description_key, image_digest
from omnieval.descriptors.description import Description
from omnieval.imaging.glance import file_state

CAMERA = {"kind": "panoramic"}
KEY = description_key(CAMERA, {"name": "a"})


def a_description(seed=0):
    rng = np.random.default_rng(seed)
    return Description(rng.random(6, np.float32), rng.random((4, 3), np.float32))


@pytest.fixture
def image(tmp_path):
    file = tmp_path / "image.png"
    file.write_bytes(b"some pixels")
    return file


def stored(path, image, key=KEY):
    with DescriptorCache(path) as cache:
        cache.store(image, file_state(image), key, image_digest(image.read_bytes()), a_description())
    return a_description()


def test_a_description_is_found_again_bit_for_bit(tmp_path, image):
    expected = stored(tmp_path / "c.sqlite", image)
    with DescriptorCache(tmp_path / "c.sqlite") as cache:
        found = cache.lookup(image, KEY)
        assert (cache.hits, cache.misses) == (1, 0)
    assert found is not None
    digest, description = found
    assert digest == image_digest(b"some pixels")
    assert np.array_equal(description.position, expected.position)
    assert np.array_equal(description.orientation, expected.orientation)


def test_other_settings_or_other_bytes_are_not_found(tmp_path, image):
    stored(tmp_path / "c.sqlite", image)
    with DescriptorCache(tmp_path / "c.sqlite") as cache:
        assert cache.lookup(image, description_key(CAMERA, {"name": "b"})) is None
        assert cache.lookup(image, description_key({"kind": "fisheye"}, {"name": "a"})) is None
        image.write_bytes(b"other pixels")
        assert cache.lookup(image, KEY) is None
        image.unlink()
        assert cache.lookup(image, KEY) is None
        assert cache.misses == 4


def test_a_rewritten_file_of_the_same_size_is_not_found(tmp_path, image):
    stored(tmp_path / "c.sqlite", image)
    image.write_bytes(b"Some pixels")
    os.utime(image, ns=(1, 1))
    with DescriptorCache(tmp_path / "c.sqlite") as cache:
        assert cache.lookup(image, KEY) is None


def in_place(image):
    """As `cp -p` onto a file that is there."""
    image.write_bytes(b"Some pixels")


def replaced(image):
    """As rsync does: another file takes the name."""
    other = image.with_name("other.png")
    other.write_bytes(b"Some pixels")
    other.replace(image)


@pytest.mark.parametrize("change", [in_place, replaced])
def test_a_file_that_keeps_its_size_and_time_is_not_found(tmp_path, image, change):
    stored(tmp_path / "c.sqlite", image)
    before = image.stat()
    change(image)
    os.utime(image, ns=(before.st_atime_ns, before.st_mtime_ns))
    after = image.stat()
    assert (after.st_size, after.st_mtime_ns) == (before.st_size, before.st_mtime_ns)
    with DescriptorCache(tmp_path / "c.sqlite") as cache:
        assert cache.lookup(image, KEY) is None


def test_a_copy_of_a_known_image_is_its_own_file(tmp_path, image):
    """A description belongs to bytes; which bytes a file has is known by file."""
    stored(tmp_path / "c.sqlite", image)
    copy = tmp_path / "copy.png"
    copy.write_bytes(image.read_bytes())
    with DescriptorCache(tmp_path / "c.sqlite") as cache:
        assert cache.lookup(copy, KEY) is None
        cache.store(copy, file_state(copy), KEY, image_digest(copy.read_bytes()), a_description())
        cache.save()
        assert cache.lookup(copy, KEY) is not None
        assert cache.lookup(image, KEY) is not None


def test_the_code_that_makes_panoramas_is_part_of_the_key(monkeypatch):
    before = description_key(CAMERA, {"name": "a"})
    monkeypatch.setattr("omnieval.descriptors.cache.module_digest", lambda name: f"another {name}")
    assert description_key(CAMERA, {"name": "a"}) != before


def test_a_flipped_bit_is_noticed(tmp_path, image):
    stored(tmp_path / "c.sqlite", image)
    with sqlite3.connect(tmp_path / "c.sqlite") as database:
        (blob,) = database.execute("SELECT position FROM descriptions").fetchone()
        database.execute("UPDATE descriptions SET position = ?", (bytes([blob[0] ^ 1]) + blob[1:],))
    database.close()
    with DescriptorCache(tmp_path / "c.sqlite") as cache:
        assert cache.lookup(image, KEY) is None


def test_a_file_that_is_no_database_is_put_aside(tmp_path, image):
    path = tmp_path / "c.sqlite"
    path.write_bytes(b"this is not a database, whatever its name says" * 100)
    expected = stored(path, image)
    with DescriptorCache(path) as cache:
        found = cache.lookup(image, KEY)
    assert found is not None
    assert np.array_equal(found[1].position, expected.position)
    assert (tmp_path / "c.damaged").exists()


def test_every_column_of_a_row_is_guarded(tmp_path, image):
    stored(tmp_path / "c.sqlite", image)
    for column, value in [("cells", 3), ("cells", None), ("orientation", "text"), ("checksum", None)]:
        path = tmp_path / f"{column}-{value}.sqlite"
        path.write_bytes((tmp_path / "c.sqlite").read_bytes())
        with contextlib.closing(sqlite3.connect(path)) as database, database:
            database.execute(f"UPDATE descriptions SET {column} = ?", (value,))
        with DescriptorCache(path) as cache:
            assert cache.lookup(image, KEY) is None
            assert cache.note is None


def test_damage_met_while_working_is_put_aside_too(tmp_path, image):
    path = tmp_path / "c.sqlite"
    stored(path, image)
    pages = bytearray(path.read_bytes())
    pages[4096:] = b"\xff" * (len(pages) - 4096)
    path.write_bytes(bytes(pages))
    with DescriptorCache(path) as cache:
        assert cache.lookup(image, KEY) is None
        assert cache.note is not None
        assert "begun anew" in cache.note
    stored(path, image)
    with DescriptorCache(path) as cache:
        assert cache.lookup(image, KEY) is not None
        assert cache.note is None
    assert (tmp_path / "c.damaged").exists()


def test_what_is_not_saved_yet_does_not_lock_others_out(tmp_path, image):
    with DescriptorCache(tmp_path / "c.sqlite") as waiting:
        waiting.store(image, file_state(image), KEY, "1", a_description(1))
        with contextlib.closing(sqlite3.connect(tmp_path / "c.sqlite", timeout=0)) as other, other:
            other.execute("DELETE FROM descriptions")


def test_notes_are_recalled_and_damaged_ones_forgotten(tmp_path):
    path = tmp_path / "c.sqlite"
    with DescriptorCache(path) as cache:
        assert cache.recall("size") is None
        cache.remember("size", {"width": 640, "height": 480})
    with DescriptorCache(path) as cache:
        assert cache.recall("size") == {"width": 640, "height": 480}
    with contextlib.closing(sqlite3.connect(path)) as database, database:
        database.execute("UPDATE notes SET value = replace(value, '640', '641')")
    with DescriptorCache(path) as cache:
        assert cache.recall("size") is None


def test_file_names_need_not_be_unicode(tmp_path):
    try:
        file = tmp_path / os.fsdecode(b"caf\xe9.png")
        file.write_bytes(b"some pixels")
    except OSError:
        pytest.skip("this file system takes Unicode names only")
    stored(tmp_path / "c.sqlite", file)
    with DescriptorCache(tmp_path / "c.sqlite") as cache:
        assert cache.lookup(file, KEY) is not None


def test_without_a_place_to_write_there_is_no_cache_and_no_error(tmp_path, image):
    (tmp_path / "file").write_text("in the way")
    with DescriptorCache(tmp_path / "file" / "c.sqlite") as cache:
        cache.store(image, file_state(image), KEY, "digest", a_description())
        assert cache.lookup(image, KEY) is None
        assert cache.note is not None
        assert "is not used" in cache.note


def test_two_caches_on_one_file(tmp_path, image):
    other = tmp_path / "other.png"
    other.write_bytes(b"x")
    with DescriptorCache(tmp_path / "c.sqlite") as one, DescriptorCache(tmp_path / "c.sqlite") as two:
        one.store(image, file_state(image), KEY, "1", a_description(1))
        one.save()
        two.store(other, file_state(other), KEY, "2", a_description(2))
        two.save()
        assert one.lookup(other, KEY) is not None
        assert two.lookup(image, KEY) is not None
