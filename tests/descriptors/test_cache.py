"""The descriptor cache: found again, never trusted when damaged, never in the way."""

import os
import shutil
import signal
import subprocess
import sys

import numpy as np
import pytest

from omnieval.descriptors.cache import DescriptorCache, description_key, image_digest
from omnieval.descriptors.description import DescribedFrame, Description
from omnieval.descriptors.merging import MANY
from omnieval.descriptors.segments import INDEX, ORIENTATION, POSITION, Filler, Shape
from omnieval.imaging.glance import file_state
from tests.faults.disk import FAULTS, every_fault

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


def keep(cache, file, seed=0, key=KEY):
    described = DescribedFrame(a_description(seed), image_digest(file.read_bytes()))
    return cache.store(file, file_state(file), key, described)


def stored(folder, file, key=KEY, seed=0):
    with DescriptorCache(folder) as cache:
        keep(cache, file, seed, key)
    return a_description(seed)


def found(folder, file, key=KEY):
    with DescriptorCache(folder) as cache:
        known = cache.lookup(file, key)
        assert cache.note is None
    return known


def the_file(folder, ending):
    (file,) = (folder / "descriptions" / KEY).glob(f"*{ending}")
    return file


def same(one, other):
    return np.array_equal(one.position, other.position) and np.array_equal(one.orientation, other.orientation)


def test_a_description_is_found_again_bit_for_bit(tmp_path, image):
    expected = stored(tmp_path / "c", image)
    with DescriptorCache(tmp_path / "c") as cache:
        known = cache.lookup(image, KEY)
        assert (cache.hits, cache.misses) == (1, 0)
    assert known is not None
    assert known.digest == image_digest(b"some pixels")
    assert same(known.description, expected)


def test_other_settings_or_other_bytes_are_not_found(tmp_path, image):
    stored(tmp_path / "c", image)
    assert found(tmp_path / "c", image, description_key(CAMERA, {"name": "b"})) is None
    assert found(tmp_path / "c", image, description_key({"kind": "fisheye"}, {"name": "a"})) is None
    image.write_bytes(b"other pixels")
    assert found(tmp_path / "c", image) is None
    image.unlink()
    assert found(tmp_path / "c", image) is None


def test_a_rewritten_file_of_the_same_size_is_not_found(tmp_path, image):
    stored(tmp_path / "c", image)
    image.write_bytes(b"Some pixels")
    os.utime(image, ns=(1, 1))
    assert found(tmp_path / "c", image) is None


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
    stored(tmp_path / "c", image)
    before = image.stat()
    change(image)
    os.utime(image, ns=(before.st_atime_ns, before.st_mtime_ns))
    after = image.stat()
    assert (after.st_size, after.st_mtime_ns) == (before.st_size, before.st_mtime_ns)
    assert found(tmp_path / "c", image) is None


def test_a_copy_of_a_known_image_is_known_once_its_bytes_are(tmp_path, image):
    """A description belongs to bytes; which bytes a file has is known by file."""
    stored(tmp_path / "c", image)
    folder = tmp_path / "elsewhere"
    folder.mkdir()
    copy = folder / "copy.png"
    copy.write_bytes(image.read_bytes())
    with DescriptorCache(tmp_path / "c") as cache:
        assert cache.lookup(copy, KEY) is None
        known = cache.find(image_digest(copy.read_bytes()), KEY)
        assert known is not None
        assert cache.store(copy, file_state(copy), KEY, known).place == known.place
        assert (cache.hits, cache.misses) == (1, 0)
    for file in (copy, image):
        known = found(tmp_path / "c", file)
        assert known is not None
        assert same(known.description, a_description())
    assert sum(file.stat().st_size for file in (tmp_path / "c").rglob(f"*{POSITION}")) == 6 * 4


def test_the_code_that_makes_panoramas_is_part_of_the_key(monkeypatch):
    before = description_key(CAMERA, {"name": "a"})
    monkeypatch.setattr("omnieval.descriptors.cache.module_digest", lambda name: f"another {name}")
    assert description_key(CAMERA, {"name": "a"}) != before


@pytest.mark.parametrize("ending", [POSITION, ORIENTATION, INDEX])
def test_wherever_a_bit_flips_or_an_end_is_lost_it_is_noticed(tmp_path, image, ending):
    stored(tmp_path / "c", image)
    file = the_file(tmp_path / "c", ending)
    whole = file.read_bytes()
    for at in range(0, len(whole), 5):
        file.write_bytes(whole[:at] + bytes([whole[at] ^ 4]) + whole[at + 1 :])
        assert found(tmp_path / "c", image) is None
        file.write_bytes(whole[:at])
        assert found(tmp_path / "c", image) is None
    file.write_bytes(whole)
    assert found(tmp_path / "c", image) is not None


def test_what_is_damaged_is_described_again_and_the_newer_is_found(tmp_path, image):
    stored(tmp_path / "c", image)
    the_file(tmp_path / "c", POSITION).write_bytes(bytes(24))
    assert found(tmp_path / "c", image) is None
    stored(tmp_path / "c", image, seed=1)
    known = found(tmp_path / "c", image)
    assert known is not None
    assert same(known.description, a_description(1))


def test_a_segment_among_those_of_another_key_is_not_believed(tmp_path, image):
    stored(tmp_path / "c", image)
    other = description_key(CAMERA, {"name": "b"})
    shutil.copytree(tmp_path / "c" / "descriptions" / KEY, tmp_path / "c" / "descriptions" / other)
    assert found(tmp_path / "c", image, other) is None


def test_what_a_killed_process_has_written_of_a_batch_is_not_read_and_what_it_finished_is(tmp_path, image):
    """Rows before entries; of the last entry only a part."""
    other = tmp_path / "other.png"
    other.write_bytes(b"x")
    stored(tmp_path / "c", image)
    stored(tmp_path / "whole", other, seed=1)
    torn = [the_file(tmp_path / "whole", ending).read_bytes() for ending in (POSITION, ORIENTATION, INDEX)]
    names = [the_file(tmp_path / "whole", ending).name for ending in (POSITION, ORIENTATION, INDEX)]
    lengths = [(8, 0, 0), (24, 48, 0), (24, 48, 30), (24, 48, 64), (24, 48, 111)]
    for cut in lengths:
        for name, content, length in zip(names, torn, cut, strict=True):
            (tmp_path / "c" / "descriptions" / KEY / name).write_bytes(content[:length])
        assert found(tmp_path / "c", other) is None
        assert found(tmp_path / "c", image) is not None


def test_notes_are_recalled_and_damaged_ones_forgotten(tmp_path):
    with DescriptorCache(tmp_path / "c") as cache:
        assert cache.recall("size") is None
        cache.remember("size", {"width": 640, "height": 480})
    with DescriptorCache(tmp_path / "c") as cache:
        assert cache.recall("size") == {"width": 640, "height": 480}
    (note,) = (tmp_path / "c" / "notes").iterdir()
    for damage in (note.read_text().replace("640", "641"), "[]", note.read_text()[:9]):
        note.write_text(damage)
        with DescriptorCache(tmp_path / "c") as cache:
            assert cache.recall("size") is None


def test_file_names_need_not_be_unicode(tmp_path):
    try:
        file = tmp_path / os.fsdecode(b"caf\xe9.png")
        file.write_bytes(b"some pixels")
    except OSError:
        pytest.skip("this file system takes Unicode names only")
    stored(tmp_path / "c", file)
    assert found(tmp_path / "c", file) is not None


def test_without_a_place_to_write_there_is_no_cache_and_no_error(tmp_path, image):
    (tmp_path / "file").write_text("in the way")
    with DescriptorCache(tmp_path / "file" / "c") as cache:
        cache.store(image, file_state(image), KEY, DescribedFrame(a_description(), image_digest(b"")))
        assert cache.lookup(image, KEY) is None
        cache.save()
        assert cache.note is not None
        assert "nothing more is kept in" in cache.note


def test_two_caches_on_one_folder_see_what_the_other_has_saved(tmp_path, image):
    other = tmp_path / "other.png"
    other.write_bytes(b"x")
    with DescriptorCache(tmp_path / "c") as one, DescriptorCache(tmp_path / "c") as two:
        keep(one, image, 1)
        assert one.lookup(image, KEY) is None
        one.save()
        keep(two, other, 2)
        two.save()
        assert two.lookup(image, KEY) is not None
        keep(one, image, 1)
        one.save()
        assert one.lookup(other, KEY) is not None


def test_descriptions_of_other_shapes_are_kept_beside_each_other(tmp_path, image):
    other = tmp_path / "other.png"
    other.write_bytes(b"x")
    longer = Description(np.arange(7, dtype=np.float32), np.ones((1, 1), np.float32))
    with DescriptorCache(tmp_path / "c") as cache:
        keep(cache, image)
        cache.store(other, file_state(other), KEY, DescribedFrame(longer, image_digest(b"x")))
        nothing = Description(np.zeros(0, np.float32), np.ones((1, 1), np.float32))
        assert cache.store(other, file_state(other), KEY, DescribedFrame(nothing, image_digest(b"y"))).place is None
    assert same(found(tmp_path / "c", image).description, a_description())
    assert same(found(tmp_path / "c", other).description, longer)


def test_a_warm_cache_is_read_without_trying_to_write(tmp_path, image, monkeypatch):
    """As in a folder that one may only read; tests may run as one who may write everywhere."""
    with DescriptorCache(tmp_path / "c") as cache:
        keep(cache, image)
        cache.remember("size", {"width": 640})
    before = sorted((path, path.stat().st_mtime_ns) for path in (tmp_path / "c").rglob("*"))
    tried = []
    auditing = [True]

    def audit(event, arguments):
        if not auditing or not str(arguments[0] if arguments else "").startswith(str(tmp_path / "c")):
            return
        flags = arguments[2] if event == "open" else 0
        writes = event in {"os.mkdir", "os.rename", "os.remove", "os.rmdir", "os.truncate", "os.utime", "os.chmod"}
        if writes or (event == "open" and flags and flags & (os.O_WRONLY | os.O_RDWR | os.O_CREAT)):
            tried.append((event, arguments))

    sys.addaudithook(audit)
    with DescriptorCache(tmp_path / "c") as cache:
        assert cache.recall("size") == {"width": 640}
        assert cache.lookup(image, KEY) is not None
        assert cache.find(image_digest(b"some pixels"), KEY) is not None
        assert cache.find(image_digest(b"others"), KEY) is None
        cache.save()
    assert tried == []
    with DescriptorCache(tmp_path / "c") as cache:
        cache.remember("size", {"width": 641})
    assert tried != []  # it would have been noticed
    auditing.clear()
    after = sorted((path, path.stat().st_mtime_ns) for path in (tmp_path / "c" / "descriptions").rglob("*"))
    assert [one for one in before if "descriptions/" in str(one[0])] == after


def test_others_of_the_group_may_write_where_the_umask_lets_them(tmp_path, image):
    before = os.umask(0o002)
    try:
        stored(tmp_path / "c", image)
        with DescriptorCache(tmp_path / "c") as cache:
            cache.remember("size", {})
    finally:
        os.umask(before)
    made = [tmp_path / "c", *(tmp_path / "c").rglob("*")]
    assert len(made) == 8
    assert all(path.stat().st_mode & 0o020 for path in made)


def test_what_failed_half_way_is_written_again_at_its_place(tmp_path, monkeypatch):
    """Also when it is Ctrl-C that comes in between."""
    description = a_description()
    filler = Filler(tmp_path / "00-a", "key", Shape(6, 4, 3))
    filler.add(b"f" * 16, b"i" * 16, description)
    filler.flush()
    filler.add(b"g" * 16, b"j" * 16, a_description(1))
    with monkeypatch.context() as patch:
        written = []

        def half(stream, offset, data):
            written.append(offset)
            stream.seek(offset)
            stream.write(data[: len(data) // 2])
            if len(written) == 2:
                raise KeyboardInterrupt

        patch.setattr("omnieval.descriptors.segments._write_at", half)
        with pytest.raises(KeyboardInterrupt):
            filler.flush()
    assert filler.flush()
    filler.close()
    expected = Filler(tmp_path / "00-b", "key", Shape(6, 4, 3))
    expected.add(b"f" * 16, b"i" * 16, description)
    expected.add(b"g" * 16, b"j" * 16, a_description(1))
    expected.flush()
    expected.close()
    for ending in (POSITION, ORIENTATION, INDEX):
        assert (tmp_path / f"00-a{ending}").read_bytes() == (tmp_path / f"00-b{ending}").read_bytes()


@pytest.mark.parametrize(("code", "lasting"), FAULTS)
def test_whatever_fails_on_the_disk_what_is_found_is_right_and_what_was_saved_is_found(tmp_path, code, lasting):
    files = [tmp_path / f"{number}.png" for number in range(3)]
    for number, file in enumerate(files):
        file.write_bytes(b"%d" % number)
    tried = 0
    for tried, disk in enumerate(every_fault(tmp_path, code, lasting=lasting), start=1):
        folder = tmp_path / f"c{tried}"
        saved = 0
        with disk.mounted(), DescriptorCache(folder) as cache:
            for number, file in enumerate(files):
                keep(cache, file, number)
                cache.save()
                saved += cache.note is None
            cache.remember("size", {"width": 640})
            assert (cache.note is not None) == disk.failed
        assert saved == 3 or disk.failed
        with DescriptorCache(folder) as cache:
            for number, file in enumerate(files):
                known = cache.lookup(file, KEY)
                assert known is not None or number >= saved
                assert known is None or same(known.description, a_description(number))
            assert cache.recall("size") in ({"width": 640}, None)
    assert tried > 12


def grown(folder, tmp_path, count):
    """A store that was filled by as many processes, an image each."""
    files = []
    for number in range(count):
        files.append(tmp_path / f"{number}.png")
        files[-1].write_bytes(b"%d" % number)
        stored(folder, files[-1], seed=number)
    return files


def segments(folder):
    return len(list(folder.rglob(f"*{INDEX}")))


def test_many_small_segments_become_one_and_nothing_is_lost(tmp_path):
    folder = tmp_path / "c"
    files = grown(folder, tmp_path, MANY - 2)
    copy = tmp_path / "copy.png"
    copy.write_bytes(b"3")
    twice = tmp_path / "twice.png"
    twice.write_bytes(b"4")
    stored(folder, twice, seed=4)  # as by a process that filled the store at the same moment
    assert segments(folder) == MANY - 1
    with DescriptorCache(folder) as reader:  # has read the indices, and of segments only the first
        assert reader.lookup(files[0], KEY) is not None
        with DescriptorCache(folder) as cache:
            known = cache.find(image_digest(b"3"), KEY)
            assert known is not None
            cache.store(copy, file_state(copy), KEY, known)
        assert segments(folder) == 2
        for number, file in enumerate(files):
            known = reader.lookup(file, KEY)
            assert known is not None
            assert same(known.description, a_description(number))
    for number, file in (*enumerate(files), (3, copy), (4, twice)):
        assert same(found(folder, file).description, a_description(number))
    assert sum(file.stat().st_size for file in folder.rglob(f"*{POSITION}")) == (MANY - 2) * 24


def test_merging_on_a_full_disk_leaves_all_as_it_is(tmp_path, monkeypatch):
    folder = tmp_path / "c"
    files = grown(folder, tmp_path, MANY - 1)

    def full(*_):
        raise OSError(28, "No space left on device")

    last = tmp_path / "last.png"
    last.write_bytes(b"last")
    with DescriptorCache(folder) as cache:
        keep(cache, last)
        cache.save()
        monkeypatch.setattr("omnieval.descriptors.segments._write_at", full)
    assert segments(folder) == MANY
    assert all(found(folder, file) for file in (*files, last))
    monkeypatch.undo()
    stored(folder, files[0])
    assert segments(folder) == 1


def test_what_is_damaged_or_of_another_shape_is_not_mixed_up_by_merging(tmp_path):
    folder = tmp_path / "c"
    files = grown(folder, tmp_path, MANY - 2)
    damaged = sorted(folder.rglob(f"*{POSITION}"))[5]
    damaged.write_bytes(bytes(24))
    longer = Description(np.arange(7, dtype=np.float32), np.ones((1, 1), np.float32))
    other = tmp_path / "other.png"
    other.write_bytes(b"other")
    with DescriptorCache(folder) as cache:
        cache.store(other, file_state(other), KEY, DescribedFrame(longer, image_digest(b"other")))
    stored(folder, files[0], seed=0)
    assert segments(folder) == 2
    assert [number for number, file in enumerate(files) if found(folder, file) is None] == [5]
    assert same(found(folder, other).description, longer)


FILL = """
import sys
from pathlib import Path
from omnieval.descriptors.cache import DescriptorCache, image_digest
from omnieval.descriptors.description import DescribedFrame
from omnieval.imaging.glance import file_state
from tests.descriptors.test_cache import KEY, a_description

folder, images, part, of = Path(sys.argv[1]), Path(sys.argv[2]), int(sys.argv[3]), int(sys.argv[4])
with DescriptorCache(folder) as cache:
    print("ready", flush=True)
    sys.stdin.readline()
    for number, file in enumerate(sorted(images.iterdir())):
        if number % of == part or number % 3 == 0:
            described = DescribedFrame(a_description(number), image_digest(file.read_bytes()))
            cache.store(file, file_state(file), KEY, described)
            if number == int(sys.argv[5]):
                cache.save()
                cache._shelves[KEY]._fillers.popitem()[1].add(bytes(16), bytes(16), a_description())
                print("writing", flush=True)
                sys.stdin.read()
"""


def filling(folder, images, part, of, stop_at=-1):
    arguments = [sys.executable, "-c", FILL, str(folder), str(images), str(part), str(of), str(stop_at)]
    process = subprocess.Popen(arguments, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    assert process.stdout.readline() == "ready\n"
    return process


@pytest.fixture
def images(tmp_path):
    folder = tmp_path / "images"
    folder.mkdir()
    for number in range(200):
        (folder / f"{number:03d}.png").write_bytes(b"%d" % number)
    return folder


@pytest.mark.slow
def test_processes_that_fill_one_store_at_once_lose_nothing_and_a_killed_one_only_its_last(tmp_path, images):
    """Each describes half of the images, and a third of them both do; one more is killed while it writes."""
    processes = [filling(tmp_path / "c", images, part, 2) for part in (0, 1)]
    killed = filling(tmp_path / "c", images, 0, 1, stop_at=100)
    for process in (*processes, killed):
        process.stdin.write("\n")
        process.stdin.flush()
    assert killed.stdout.readline() == "writing\n"
    killed.send_signal(signal.SIGKILL)
    for process in (*processes, killed):
        process.communicate()
    assert [process.returncode for process in processes] == [0, 0]
    with DescriptorCache(tmp_path / "c") as cache:
        for number, file in enumerate(sorted(images.iterdir())):
            known = cache.lookup(file, KEY)
            assert known is not None
            assert known.digest == image_digest(file.read_bytes())
            assert same(known.description, a_description(number))
    assert len(list((tmp_path / "c").rglob(f"*{INDEX}"))) == 3
