"""What holds for every dataset, whatever its reader. A new reader joins by one line in `SOURCES`."""

from __future__ import annotations

from pathlib import Path

import pytest

from omnieval.datasets import load
from omnieval.datasets.check import check
from tests.datasets.innova_trees import make_named
from tests.datasets.trees import cold_names, make_cold, make_folder

FOLDER_POSES = "file,x,y,yaw,room,time\n" + "".join(f"{i}.png,{i},0,0,CR,{i}\n" for i in range(1, 13))

SOURCES = {
    "cold": lambda root: f"cold:{make_cold(root, cold_names(12))}",
    "folder": lambda root: f"folder:{make_folder(root, [f'{i}.png' for i in range(1, 13)], FOLDER_POSES)}",
    "innova": lambda root: f"innova:{make_named(root)}",
}


@pytest.fixture(params=sorted(SOURCES))
def source(request, tmp_path):
    return SOURCES[request.param](tmp_path / "a sequence")


def test_it_is_sound(source):
    assert check(source).findings == ()


def test_frames_are_in_the_order_of_capture(source):
    sequence = load(source)
    times = [frame.time_ns for frame in sequence.frames if frame.time_ns is not None]
    assert len(times) == len(sequence)
    assert times == sorted(times)
    assert sequence.positions is not None
    assert sequence.positions[:, 0].tolist() == sorted(sequence.positions[:, 0])


def test_frames_have_names_of_their_own_that_stay_within_the_sequence(source):
    sequence = load(source)
    files = [frame.file for frame in sequence.frames]
    assert len(set(files)) == len(sequence) == 12
    assert not any(Path(file).is_absolute() or ".." in Path(file).parts for file in files)
    assert all(frame.path.is_relative_to(sequence.root) for frame in sequence.frames)


def test_every_frame_can_be_read(source):
    assert all(frame.read() == frame.path.read_bytes() for frame in load(source).frames)


def test_the_source_is_canonical(source):
    assert load(source).source == source
    assert load(load(source).source).frames == load(source).frames


def test_the_name_is_a_plain_file_name(source):
    assert load(source).name == "a-sequence"


def test_frames_appended_later_change_no_earlier_one(source):
    before = load(source)
    first, last = before.frames[0], before.frames[-1]
    name = last.file.replace("t1152904770", "t1152904990") if last.file.startswith("t") else "99.png"
    (last.path.parent / name).write_bytes(first.read())
    after = load(source)
    assert after.frames[: len(before)] == before.frames
    assert len(after) == len(before) + 1
