"""The contract of datasets: ours and a third party's pass, and every way to break it is called by its name."""

import dataclasses
import hashlib
import math
import struct
from pathlib import Path

import numpy as np
import pytest

from omnieval.datasets import load
from omnieval.datasets.sequence import Camera, Frame, Pose, Sequence
from omnieval.errors import DatasetError
from omnieval.testing import check_dataset
from tests.datasets.trees import cold_names, make_cold, make_folder

FOLDER_POSES = "file,x,y,yaw,room,time\n" + "".join(f"{i}.png,{i},0,0,CR,{i}\n" for i in range(1, 13))


def ours(root, kind):
    if kind == "cold":
        return load(f"cold:{make_cold(root, cold_names(12))}")
    poses = FOLDER_POSES if kind == "folder" else None
    return load(f"folder:{make_folder(root, [f'{i}.png' for i in range(1, 13)], poses)}")


@pytest.mark.parametrize("kind", ["cold", "folder", "folder-without-poses"])
def test_our_sequences_pass_whole_and_cut(kind, tmp_path):
    sequence = ours(tmp_path / "sequence", kind)
    check_dataset(sequence)
    check_dataset(sequence.cut(start=2, stride=3))
    check_dataset(sequence.cut(limit=1))


def load_raw(source):
    """A third party's dataset: ``raw:PATH``, files ``<milliseconds>.raw`` that begin with x, y, yaw."""
    root = Path(source.removeprefix("raw:"))
    files = sorted(root.glob("*.raw"), key=lambda file: int(file.stem))
    frames = tuple(
        Frame(file, file.name, int(file.stem) * 10**6, Pose(*struct.unpack("3d", file.read_bytes()[:24])), "hall")
        for file in files
    )
    return Sequence(root.name, source, root, frames, Camera("panoramic"))


@pytest.fixture
def raw(tmp_path):
    for number in range(9):
        (tmp_path / f"{100 * number}.raw").write_bytes(struct.pack("3d", number, 0.5, 0.1) + b"pixels")
    return load_raw(f"raw:{tmp_path}")


def test_a_third_partys_sequence_passes(raw):
    check_dataset(raw, load=load_raw)


def test_a_source_nobody_can_load_is_refused(raw):
    with pytest.raises(DatasetError, match="unknown source"):
        check_dataset(raw)


def with_frame(sequence, index, **changes):
    frames = list(sequence.frames)
    frames[index] = dataclasses.replace(frames[index], **changes)
    return dataclasses.replace(sequence, frames=tuple(frames))


class Noisy(Frame):
    def read(self):
        noise = hashlib.sha256(np.random.default_rng().bytes(8)).digest()
        return super().read() + noise


class WithoutCut(Sequence):
    def cut(self, *, start=0, stride=1, limit=None):
        return self


class AnyCut(Sequence):
    def cut(self, *, start=0, stride=1, limit=None):
        kept = self.frames[start::stride][:limit]
        return dataclasses.replace(self, frames=kept, cut_from=(start, stride, limit))


def as_kind(kind, sequence):
    return kind(**{field.name: getattr(sequence, field.name) for field in dataclasses.fields(sequence)})


@pytest.mark.parametrize(
    ("break_it", "message"),
    [
        (lambda raw: dataclasses.replace(raw, name="a/b"), "name must be a plain file name, got 'a/b'"),
        (lambda raw: dataclasses.replace(raw, frames=()), "the sequence has no frames"),
        (lambda raw: with_frame(raw, 3, file="100.raw"), "unique files, but '100.raw' occurs twice"),
        (lambda raw: with_frame(raw, 3, file="/data/300.raw"), "relative to the sequence, .* got '/data/300.raw'"),
        (lambda raw: with_frame(raw, 3, file="../300.raw"), "relative to the sequence"),
        (lambda raw: with_frame(raw, 3, file="raw\\300.raw"), "with / as separator"),
        (
            lambda raw: with_frame(raw, 3, pose=Pose(0, math.nan, 0)),
            r"300\.raw: a position must be finite, or the pose None",
        ),
        (lambda raw: with_frame(raw, 3, pose=Pose(0, 0, 4)), r"300\.raw: yaw must lie in \(-pi, pi\], got 4"),
        (lambda raw: with_frame(raw, 3, room=""), "an unknown room must be None, not empty"),
        (lambda raw: with_frame(raw, 3, time_ns=0.3), "time_ns must be an int, got 0.3"),
        (lambda raw: with_frame(raw, 3, time_ns=0), r"order of capture, but '300\.raw' is earlier than '200\.raw'"),
        (lambda raw: dataclasses.replace(raw, frames=raw.frames[::-1]), "order of capture"),
        (lambda raw: dataclasses.replace(raw, frames=raw.frames[1:]), "must load the same sequence again"),
        (lambda raw: with_frame(raw, 3, room="kitchen"), "must load the same sequence again"),
        (lambda raw: as_kind(WithoutCut, raw), r"cut\(start=1, stride=2, limit=3\) must keep those frames"),
        (lambda raw: as_kind(AnyCut, raw), r"cut\(start=9\) leaves no frame and must raise DatasetError"),
    ],
)
def test_a_broken_sequence_is_told_what_is_wrong(break_it, message, raw):
    with pytest.raises(AssertionError, match=message) as raised:
        check_dataset(break_it(raw), load=load_raw)
    assert "\n" not in str(raised.value)


def test_images_are_read(raw):
    raw.frames[-1].path.write_bytes(b"")
    with pytest.raises(AssertionError, match=r"800\.raw: read must give the bytes of an image"):
        check_dataset(raw, load=lambda _: raw)
    raw.frames[-1].path.unlink()
    with pytest.raises(DatasetError, match=r"800\.raw"):
        check_dataset(raw, load=lambda _: raw)


def test_an_image_that_changes_between_readings_is_noticed(raw):
    first = raw.frames[0]
    noisy = Noisy(first.path, first.file, first.time_ns, first.pose, first.room)
    with pytest.raises(AssertionError, match=r"0\.raw: read must give the same bytes twice"):
        check_dataset(dataclasses.replace(raw, frames=(noisy, *raw.frames[1:])), load=load_raw)
