"""Where results go: not into others' files, not two at a time, never outside the folder they belong in."""

import contextlib
import json
import os
import shutil
import signal
import zipfile

import numpy as np
import pytest

import omnieval
from omnieval.datasets import load
from omnieval.datasets.sequence import Sequence
from omnieval.results.run_folder import open_run
from tests.cli.test_cli import in_process
from tests.faults.commands import GRID, REPLAY, begun, end, one_line, start, status, wait_for

pytestmark = pytest.mark.faults

HELD = """
import omnieval.loop as loop
row = loop.step_row
def held(step, *rest):
    if step.frame == 20:
        sys.stdin.readline()
    return row(step, *rest)
loop.step_row = held
"""
"""Makes a replay wait in the middle, until it is told to go on."""


@pytest.fixture
def half_done(panoramas, tmp_path):
    """A replay into ``run`` that waits at its twentieth frame."""
    folder = tmp_path / "run"
    process = start(tmp_path, "replay", panoramas, *REPLAY, "--out", folder, prepare=HELD)
    wait_for(lambda: begun(folder) and (folder / "replay.partial.rrd").exists(), process)
    yield process
    with contextlib.suppress(ProcessLookupError):
        os.kill(process.pid, signal.SIGKILL)
    process.communicate()


def test_the_second_of_two_runs_on_a_folder_is_refused_and_the_first_untouched(
    panoramas, replayed, half_done, tmp_path
):
    folder = tmp_path / "run"
    before = (folder / "run.json").read_bytes()
    for overwrite in ((), ("--overwrite",)):
        refused = in_process("replay", panoramas, *REPLAY, "--out", folder, *overwrite, cwd=tmp_path)
        assert (refused.returncode, refused.stdout) == (2, "")
        assert "is being written by another process" in one_line(refused.stderr)
    other_kind = in_process("ablate", panoramas, *GRID, "--out", folder, "--overwrite", cwd=tmp_path)
    assert other_kind.returncode == 2
    assert (folder / "run.json").read_bytes() == before
    assert status(folder, "replay") == "running"
    half_done.stdin.write("go on\n")
    code, _, err = end(half_done)
    assert (code, err) == (0, "")
    assert open_run(folder).content_hash == replayed.content_hash
    assert open_run(folder).recording.exists()


def test_a_run_of_a_dead_process_is_interrupted_and_can_be_replaced(panoramas, replayed, half_done, tmp_path):
    folder = tmp_path / "run"
    os.kill(half_done.pid, signal.SIGKILL)
    half_done.wait()
    assert status(folder, "replay") == "interrupted"
    refused = in_process("replay", panoramas, *REPLAY, "--out", folder, cwd=tmp_path)
    assert "holds a replay already" in one_line(refused.stderr)
    assert in_process("replay", panoramas, *REPLAY, "--out", folder, "--overwrite", cwd=tmp_path).returncode == 0
    assert open_run(folder).content_hash == replayed.content_hash


def test_a_later_process_with_the_number_of_the_dead_one_is_not_mistaken_for_it(panoramas, half_done, tmp_path):
    folder = tmp_path / "run"
    os.kill(half_done.pid, signal.SIGKILL)
    half_done.wait()
    manifest = json.loads((folder / "run.json").read_text())
    manifest["process"]["pid"] = os.getpid()  # as if the system had given us its number
    (folder / "run.json").write_text(json.dumps(manifest))
    assert status(folder, "replay") == "interrupted"
    again = in_process("replay", panoramas, *REPLAY, "--no-rrd", "--out", folder, "--overwrite", cwd=tmp_path)
    assert again.returncode == 0


@pytest.mark.parametrize("command", [("replay", *REPLAY), ("ablate", *GRID)])
@pytest.mark.parametrize("out", ["file", "file/below", "/dev/null/below", "/proc/none", "x" * 300])
def test_where_nothing_can_be_written(panoramas, tmp_path, command, out):
    (tmp_path / "file").write_text("mine")
    name, *settings = command
    result = in_process(name, panoramas, *settings, "--out", out, cwd=tmp_path)
    assert (result.returncode, result.stdout) == (2, "")
    assert "choose another --out" in one_line(result.stderr)
    assert [path.name for path in tmp_path.iterdir()] == ["file"]
    assert (tmp_path / "file").read_text() == "mine"


def test_what_is_there_already_is_not_touched(panoramas, replayed, tmp_path):
    (tmp_path / "photos").mkdir()
    (tmp_path / "photos" / "steps.parquet").write_text("mine")
    for name, settings in (("replay", REPLAY), ("ablate", GRID), ("baseline", ())):
        result = in_process(name, panoramas, *settings, "--out", "photos", "--overwrite", cwd=tmp_path)
        assert result.returncode == 2
        assert "holds files that are not" in one_line(result.stderr)
    assert [path.name for path in (tmp_path / "photos").iterdir()] == ["steps.parquet"]
    shutil.copytree(replayed.folder, tmp_path / "run")
    for name, settings in (("ablate", GRID), ("baseline", ())):
        result = in_process(name, panoramas, *settings, "--out", "run", "--overwrite", cwd=tmp_path)
        assert "is a replay, not" in one_line(result.stderr)
    assert open_run(tmp_path / "run").content_hash == replayed.content_hash


@pytest.mark.parametrize("name", ["../escaped", "/tmp/escaped", "..", ".", "é/ü", "a\nb", "-rf", "x" * 300, ""])
def test_no_name_of_a_sequence_leads_out_of_the_runs_folder(panoramas, tmp_path, monkeypatch, name):
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    sequence = load(panoramas).cut(limit=20)
    crafted = Sequence(**{field: getattr(sequence, field) for field in sequence.__dataclass_fields__} | {"name": name})
    run = omnieval.replay(crafted, config=omnieval.configure(n_init=10, n_new=10))
    assert run.folder.resolve().parent == tmp_path / "here" / "runs"
    assert [path.name for path in tmp_path.iterdir()] == ["here"]
    assert [path.name for path in (tmp_path / "here").iterdir()] == ["runs"]
    assert len(list((tmp_path / "here" / "runs").iterdir())) == 1


@pytest.mark.parametrize("name", ["..png", "-o", "a b\tc", "über/uns", "$(touch escaped)", "`touch escaped`"])
def test_no_name_of_a_folder_is_executed_or_leads_out(panoramas, tmp_path, name):
    (tmp_path / "here").mkdir()
    shutil.copytree(panoramas, tmp_path / "data" / name)
    source = f"folder:{tmp_path / 'data' / name}"
    result = in_process("replay", source, *REPLAY, "--no-rrd", "--limit", 20, cwd=tmp_path / "here")
    assert result.returncode == 0, result.stderr
    assert sorted(path.name for path in tmp_path.iterdir()) == ["data", "here"]
    assert [path.name for path in (tmp_path / "here").iterdir()] == ["runs"]
    (folder,) = (tmp_path / "here" / "runs").iterdir()
    assert len(open_run(folder).steps) == 20


def test_names_of_images_in_an_archive_are_only_names(panoramas, tmp_path):
    assert in_process("describe", panoramas, "--limit", 20, "--out", "a.npz", cwd=tmp_path).returncode == 0
    with np.load(tmp_path / "a.npz") as arrays:
        content = dict(arrays)
    content["file"] = np.array(["../../escaped", "/etc/passwd", *content["file"][2:]])
    with (tmp_path / "crafted.npz").open("wb") as stream, zipfile.ZipFile(stream, "w") as archive:
        for name, array in content.items():  # numpy.savez takes no array of the name file
            with archive.open(f"{name}.npy", "w") as member:
                np.lib.format.write_array(member, array, allow_pickle=False)
    (tmp_path / "here").mkdir()
    before = sorted(tmp_path.iterdir())
    result = in_process("map", tmp_path / "crafted.npz", *REPLAY, cwd=tmp_path / "here")
    assert result.returncode in {0, 3}
    assert sorted(tmp_path.iterdir()) == before
