"""A recording made again shows what the run decided, or the one that is there stays as it was, to the byte."""

import errno
import os
import shutil

import cv2
import numpy as np
import pytest

from omnieval.archiving import describe_archive
from omnieval.descriptors.archive import load_archive, save_archive
from omnieval.descriptors.description import Description
from omnieval.errors import DatasetError, ResultError
from omnieval.imaging.pictures import SequencePictures
from omnieval.loop import replay
from omnieval.mapping.leader import Leader
from omnieval.recording import RecordingOptions
from omnieval.recording.digest import digest
from omnieval.recording.viewer import check_recording
from omnieval.render import render
from omnieval.results.folder import hold_folder
from omnieval.results.run_folder import open_run
from tests.cli.test_cli import fails, in_process
from tests.recording.readback import rows_per_entity

CONFIG = {"n_init": 10, "n_new": 10, "gamma": 1.0, "omega": 3.5, "merge_y": 0.5}
LIMIT = 60
COLUMNS = """
import numpy as np
from omnieval.descriptors.archive import load_archive, save_archive
from omnieval.descriptors.description import Description

class Columns:
    def describe(self, panorama):
        means = panorama.astype(np.float32).reshape(panorama.shape[0], 32, -1).mean(axis=(0, 2))
        return Description(np.sort(means), means[:, None])
"""


@pytest.fixture
def images(panoramas, tmp_path):
    """A copy of the sequence, to be spoilt."""
    return shutil.copytree(panoramas, tmp_path / "images")


@pytest.fixture
def run(images, tmp_path):
    return recorded(images, tmp_path)


def recorded(source, tmp_path, **options):
    settings = {} if "mapper" in options else CONFIG
    return replay(source, config=settings, limit=LIMIT, out=tmp_path / "run", recording=True, **options)


def rename(images):
    (images / "image20.png").rename(images / "image20b.png")


def replace_one(images):
    cv2.imwrite(str(images / "image20.png"), np.full((64, 256), 90, np.uint8))


def lose_the_last(images):
    for number in range(40, 80):
        (images / f"image{number}.png").unlink()


def cut_one_off(images):
    file = images / "image20.png"
    file.write_bytes(file.read_bytes()[:300])


def stays(run, error, match, **options):
    """Check that rendering fails and leaves the folder as it is, to the byte."""
    before = {path: path.read_bytes() for path in run.folder.rglob("*") if path.is_file()}
    with pytest.raises(error, match=match):
        render(open_run(run.folder), **options)
    assert {path: path.read_bytes() for path in run.folder.rglob("*") if path.is_file()} == before


@pytest.mark.parametrize("mapper", ["roman2020", "leader"])
def test_a_recording_made_again_says_what_that_of_the_replay_says(panoramas, tmp_path, mapper):
    config = CONFIG if mapper == "roman2020" else {}
    run = replay(panoramas, config=config, mapper=mapper, limit=LIMIT, out=tmp_path / "run", recording=True)
    said: list[str] = []
    first = digest(run.recording)
    run.recording.unlink()
    assert render(open_run(run.folder), note=said.append) == run.recording
    assert digest(run.recording) == first
    assert said == []
    tables = {f"{name}.parquet" for name in ("steps", "nodes", "transitions", "quality")}
    assert {path.name for path in run.folder.iterdir()} == {"run.json", "replay.rrd", "map.json", "map.npz", *tables}


@pytest.mark.parametrize(
    ("spoil", "error", "match"),
    [
        (rename, ResultError, r"step \d+ of .* is of image20\.png"),
        (replace_one, ResultError, "are not those that|is decided differently now"),
        (lose_the_last, ResultError, r"is of image40\.png, .* has nothing there"),
        (cut_one_off, DatasetError, r"image20\.png"),
        (shutil.rmtree, DatasetError, "images"),
    ],
)
def test_images_that_have_changed_cost_nothing(run, images, spoil, error, match):
    spoil(images)
    stays(run, error, match)


def test_an_archive_that_has_changed_costs_nothing(panoramas, tmp_path):
    archive = tmp_path / "seen.npz"
    describe_archive(panoramas, archive)
    run = replay(archive, config=CONFIG, out=tmp_path / "run", recording=True)
    seen = load_archive(archive)
    # So little that no decision changes.
    seen.position[-1, 0] = np.nextafter(seen.position[-1, 0], np.float32(9))
    save_archive(archive, seen.frames, seen.position, seen.orientation)
    stays(run, ResultError, "are not those that")


def test_an_interrupt_costs_nothing(run):
    def interrupt(done, total):
        if done == total - 3:
            raise KeyboardInterrupt

    stays(run, KeyboardInterrupt, None, progress=interrupt)


@pytest.mark.parametrize("at", [0, 3])
def test_a_full_disk_costs_nothing(run, monkeypatch, at):
    written, write = [], os.write

    def full(descriptor, block):
        written.append(len(block))
        if len(written) > at:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return write(descriptor, block)

    monkeypatch.setattr("omnieval.recording.pipe.os.write", full)
    stays(run, ResultError, r"cannot write .*replay\.rrd: No space left on device")


def test_a_picture_that_cannot_be_had_is_an_error_and_not_half_a_recording(run, monkeypatch):
    panorama = SequencePictures.panorama

    def gone(self, frame):
        if frame == 30:
            raise DatasetError("cannot read image 30")
        return panorama(self, frame)

    monkeypatch.setattr(SequencePictures, "panorama", gone)
    stays(run, DatasetError, "cannot read image 30")
    assert render(run, RecordingOptions(images=False)) == run.recording


def test_a_run_that_is_being_written_is_left_alone(run):
    with hold_folder(run.folder):
        stays(run, ResultError, "is being written by another process")


def test_what_a_killed_replay_left_goes_when_there_is_a_whole_recording(run, images):
    left = [run.folder / "replay.partial.rrd", run.folder / ".replay.rrd.7.tmp"]
    for path in left:
        path.write_bytes(b"some steps")
    file = images / "image20.png"
    before = file.read_bytes()
    replace_one(images)
    stays(run, ResultError, "replay")
    file.write_bytes(before)
    render(run)
    assert not [path for path in left if path.exists()]


def test_a_run_without_its_end_has_the_steps_it_came_to(images, tmp_path):
    def interrupt(done, total):
        if done == 42:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        replay(images, config=CONFIG, out=tmp_path / "run", progress=interrupt)
    assert check_recording(render(open_run(tmp_path / "run"))) == 42


def without_curves(run):
    """Check that the recording that is made again shows everything but curves; return what was said about it."""
    said: list[str] = []
    before = rows_per_entity(run.recording)
    run.recording.unlink()
    render(open_run(run.folder), note=said.append)
    after = rows_per_entity(run.recording)
    assert after == before  # curves are cleared at every step
    assert check_recording(run.recording) == LIMIT
    (sentence,) = said
    assert sentence.startswith("the recording has no similarity curves: the ")
    return sentence


def test_a_descriptor_that_is_gone_costs_the_curves_and_this_is_said(images, tmp_path):
    class Gone:
        def describe(self, panorama):
            means = panorama.astype(np.float32).reshape(panorama.shape[0], 32, -1).mean(axis=(0, 2))
            return Description(np.sort(means), means[:, None])

    run = recorded(images, tmp_path, descriptor=Gone())
    assert "the descriptor gone was an object" in without_curves(run)
    replace_one(images)
    stays(run, ResultError, "are not those that")


def test_a_descriptor_whose_code_was_changed_is_not_the_one_of_the_run(images, tmp_path):
    file = tmp_path / "own.py"
    file.write_text(COLUMNS)
    run = recorded(images, tmp_path, descriptor=f"{file}:Columns")
    file.write_text(COLUMNS.replace("np.sort(means)", "means"))
    assert "has changed since the run (code)" in without_curves(run)


def test_a_mapper_that_is_gone_costs_the_curves_and_this_is_said(images, tmp_path):
    class Gone(Leader):
        name = "gone"

    run = recorded(images, tmp_path, mapper=Gone())
    assert "the mapper gone was an object" in without_curves(run)
    replace_one(images)
    stays(run, ResultError, "are not those that")


def test_the_command_writes_elsewhere_and_leaves_the_run_as_it_is(run, tmp_path):
    before = {path: path.stat().st_mtime_ns for path in run.folder.iterdir()}
    small = ("render", run.folder, "--no-images", "--out", "small.rrd")
    done = in_process(*small, cwd=tmp_path)
    assert (done.returncode, done.stdout) == (0, "small.rrd\n")
    assert check_recording(tmp_path / "small.rrd") == LIMIT
    assert (tmp_path / "small.rrd").stat().st_size < run.recording.stat().st_size
    fails(in_process(*small, cwd=tmp_path), 2, "small.rrd exists; choose another --out or pass --overwrite")
    assert in_process(*small, "--overwrite", cwd=tmp_path).returncode == 0
    assert {path: path.stat().st_mtime_ns for path in run.folder.iterdir()} == before


def test_the_command_says_what_is_missing_beside_what_it_made(images, tmp_path):
    file = tmp_path / "own.py"
    file.write_text(COLUMNS)
    run = recorded(images, tmp_path, descriptor=f"{file}:Columns")
    file.unlink()
    result = in_process("render", run.folder, "--no-images", cwd=tmp_path)
    assert (result.returncode, result.stdout.strip()) == (0, str(run.recording))
    assert result.stderr.startswith("omnieval: the recording has no similarity curves: the descriptor")
    assert len(result.stderr.splitlines()) == 1


@pytest.mark.parametrize(("spoil", "code"), [(rename, 2), (shutil.rmtree, 3)])
def test_the_command_fails_in_one_line(run, images, tmp_path, spoil, code):
    spoil(images)
    before = run.recording.read_bytes()
    result = in_process("render", run.folder, cwd=tmp_path)
    assert (result.returncode, result.stdout) == (code, "")
    assert len(result.stderr.splitlines()) == 1
    assert run.recording.read_bytes() == before
