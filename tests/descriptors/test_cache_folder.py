"""The cache folder: counted by kind, and pruned of what is old, too much or useless, but not of what is used."""

import os
import time
from pathlib import Path

import numpy as np
import pytest

from omnieval.datasets.cachedir import hold
from omnieval.descriptors.cache import DescriptorCache, image_digest
from omnieval.descriptors.cache_folder import DESCRIPTIONS, DRAFTS, KINDS, LEFT, OLD, OTHER, cache_state, prune
from omnieval.descriptors.description import DescribedFrame, Description
from omnieval.descriptors.segments import INDEX, ORIENTATION, POSITION
from omnieval.imaging.glance import file_state
from tests.trust.inputs import listing

DAY_S = 86_400


def describe(folder, file, key):
    description = Description(np.ones(6, np.float32), np.ones((4, 3), np.float32))
    with DescriptorCache(folder) as cache:
        cache.store(file, file_state(file), key, DescribedFrame(description, image_digest(file.read_bytes())))


def aged(folder, days):
    """Let all files of a folder be as old as that."""
    then = time.time() - days * DAY_S
    for path in folder.rglob("*"):
        os.utime(path, (then, then))


@pytest.fixture
def cache(tmp_path):
    """A cache with something of every kind."""
    folder, images = tmp_path / "cache", tmp_path / "images"
    images.mkdir()
    for number, key in enumerate(("a" * 32, "a" * 32, "b" * 32)):
        (images / f"{number}.png").write_bytes(b"%d" % number)
        describe(folder, images / f"{number}.png", key)
    with DescriptorCache(folder) as cache:
        cache.remember("size", {"width": 640})
    files = {
        "streams/one/index.json": 20,
        "streams/one/frame000000.png": 30,
        "streams/.one.lock": 0,
        "streams/.two-draft/images/frame000000.png": 40,
        "synthetic/v1-cloudy/building.json": 50,
        "synthetic/v1-cloudy/omni_cam/t1.jpeg": 60,
        "side-by-side-0123.rrd": 70,
        "descriptors-3.sqlite": 80,
        "descriptors-3.sqlite-wal": 90,
        "my notes.txt": 100,
    }
    for name, size in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(bytes(size))
    return folder


def counts(folder):
    return {kind: (state.count, state.bytes) for kind in KINDS if (state := cache_state(folder).of(kind)).count}


def test_a_cache_that_is_not_there_yet(tmp_path):
    state = cache_state(tmp_path / "none")
    assert (state.writable, state.bytes, state.sets, state.integrity) == (True, 0, 0, "empty")
    assert prune(tmp_path / "none", most_bytes=0).removed == []
    assert list(tmp_path.iterdir()) == []


def test_a_file_in_its_place_cannot_be_written(tmp_path):
    (tmp_path / "cache").write_text("in the way")
    assert not cache_state(tmp_path / "cache").writable


def test_all_is_counted_by_kind_and_looking_changes_nothing(cache):
    before = listing(cache)
    state = cache_state(cache)
    found = counts(cache)
    note = found.pop("notes")
    assert note[0] == 1
    assert found == {
        "descriptions": (3, 3 * (24 + 48 + 64 + 48)),
        "streams": (1, 50),
        "synthetic": (1, 110),
        "pairs": (1, 70),
        "drafts": (1, 40),
        "of older versions": (2, 170),
        "other": (1, 100),
    }
    assert (state.sets, state.segments, state.integrity) == (2, 3, "ok")
    assert state.bytes == sum(path.stat().st_size for path in cache.rglob("*") if path.is_file())
    assert listing(cache) == before


def test_without_a_rule_only_what_is_useless_goes(cache):
    useless = {OLD: 2}
    pruned = prune(cache)
    assert {item.kind for item in pruned.removed} == set(useless)
    assert pruned.bytes_left == cache_state(cache).bytes
    assert OLD not in counts(cache)
    aged(cache / "streams" / ".two-draft", 2)
    assert [item.kind for item in prune(cache).removed] == [LEFT]
    assert (cache / "streams" / ".one.lock").exists()


def test_what_was_not_used_for_long_goes(cache):
    for path in ("streams", "descriptions/" + "a" * 32):
        aged(cache / path, 31)
    assert counts(cache)[LEFT] == (1, 40)
    prune(cache, older_s=30 * DAY_S)
    found = counts(cache)
    assert found[DESCRIPTIONS] == (1, 184)
    assert not (cache / "descriptions" / ("a" * 32)).exists()
    assert "streams" not in found
    assert found["synthetic"] == (1, 110)


def test_what_is_too_much_goes_beginning_with_what_was_used_least_lately(cache):
    prune(cache)
    for days, path in enumerate(("synthetic", "streams", "descriptions"), start=1):
        aged(cache / path, days)
    before = cache_state(cache).bytes - 40  # of a draft that nobody works on any more
    prune(cache, most_bytes=before - 3 * 184)
    assert set(counts(cache)) == {"notes", "streams", "synthetic", "pairs", OTHER}
    prune(cache, most_bytes=before - 3 * 184 - 1)
    assert "streams" not in counts(cache)
    prune(cache, most_bytes=0)
    assert set(counts(cache)) <= {OTHER, DRAFTS}


def test_a_dry_run_says_the_same_and_removes_nothing(cache):
    before = listing(cache)
    told = prune(cache, most_bytes=0, dry=True)
    assert listing(cache) == before
    done = prune(cache, most_bytes=0)
    assert [item.paths for item in told.removed] == [item.paths for item in done.removed]
    assert told.bytes_left == done.bytes_left == cache_state(cache).bytes


def test_what_is_read_or_filled_stays(cache, tmp_path):
    key, files = "a" * 32, sorted((tmp_path / "images").iterdir())
    description = Description(np.ones(6, np.float32), np.ones((4, 3), np.float32))
    with DescriptorCache(cache) as reader, DescriptorCache(cache) as filler:
        assert reader.lookup(files[0], key) is not None
        filler.store(files[2], file_state(files[2]), key, DescribedFrame(description, image_digest(b"2")))
        filler.save()
        pruned = prune(cache, most_bytes=0)
        assert [item.kind for item in pruned.in_use] == [DESCRIPTIONS] * 2
        assert counts(cache)[DESCRIPTIONS][0] == 2
        assert reader.lookup(files[0], key) is not None
        filler.store(files[1], file_state(files[1]), key, DescribedFrame(description, image_digest(b"1")))
    with DescriptorCache(cache) as later:
        assert all(later.lookup(file, key) for file in files)
    prune(cache, most_bytes=0)
    assert DESCRIPTIONS not in counts(cache)


def test_images_that_a_process_uses_stay(cache):
    with (cache / "streams/one/index.json").open("rb") as stream:
        assert hold(stream.fileno())
        assert "streams" in {item.kind for item in prune(cache, most_bytes=0).in_use}
    assert (cache / "streams/one/frame000000.png").exists()
    prune(cache, most_bytes=0)
    assert not (cache / "streams/one").exists()


def test_where_there_are_no_locks_what_was_used_today_stays(cache, monkeypatch):
    def none(*_):
        raise OSError(95, "Operation not supported")

    monkeypatch.setattr("omnieval.datasets.cachedir.fcntl.flock", none)
    aged(cache / "synthetic", 2)
    prune(cache, most_bytes=0)
    assert set(counts(cache)) == {DESCRIPTIONS, "streams", DRAFTS, OTHER}


def test_what_cannot_be_removed_is_told_as_in_use(cache, monkeypatch):
    def refused(*_):
        raise OSError(13, "Permission denied")

    monkeypatch.setattr(Path, "unlink", refused)
    pruned = prune(cache)
    assert pruned.removed == []
    assert len(pruned.in_use) == 2


@pytest.mark.parametrize("spoil", [(INDEX, 0), (INDEX, 30), (POSITION, 8), (ORIENTATION, 0), (INDEX, None)])
def test_damage_is_told_and_not_touched_until_it_is_pruned(cache, spoil):
    ending, length = spoil
    file = next((cache / "descriptions" / ("b" * 32)).glob(f"*{ending}"))
    if length is None:
        file.unlink()
    else:
        file.write_bytes(file.read_bytes()[:length])
    before = listing(cache)
    state = cache_state(cache)
    assert (state.integrity != "ok") == (length is not None)
    assert state.of(LEFT).count == 1
    assert listing(cache) == before
    prune(cache)
    state = cache_state(cache)
    assert (state.segments, state.integrity, state.of(LEFT).count) == (2, "ok", 0)
