"""``omnieval view`` opens one run or several in one viewer; what starts the viewer is put aside here."""

import contextlib
import json
import shutil
import signal
import socket
from pathlib import Path

import pytest

from omnieval.recording import viewer
from omnieval.recording.viewer import check_recording
from tests.cli.test_cli import SMALL, fails, in_process


@pytest.fixture
def opened(monkeypatch, tmp_path):
    """The recordings that the viewer would have been given."""
    given: list[Path] = []
    monkeypatch.setattr(viewer, "open_viewer", given.extend)
    monkeypatch.setenv("OMNIEVAL_CACHE", str(tmp_path / "cache"))
    return given


@pytest.fixture(scope="module")
def recorded(two_runs, panoramas):
    """Run c, as b but with a recording."""
    arguments = ("--set", "gamma=20", "--no-images", "--out", "c")
    assert in_process("replay", f"folder:{panoramas}", *SMALL, *arguments, cwd=two_runs).returncode == 0
    return two_runs


def test_one_run_is_opened_by_itself(two_runs, opened):
    result = in_process("view", "a", cwd=two_runs)
    assert (result.returncode, result.stderr) == (0, "")
    assert opened == [Path("a/replay.rrd")]


def test_a_recording_whose_name_is_misspelt_is_named(two_runs):
    result = in_process("view", "a/replay.rd", cwd=two_runs)
    fails(result, 2, "a/replay.rd is not a run folder: there is no such folder; did you mean replay.rrd?")


def test_two_runs_are_opened_together_and_side_by_side(recorded, opened, tmp_path):
    result = in_process("view", "a", "c", cwd=recorded)
    assert result.returncode == 0
    assert "3 recordings: switch with" in result.stderr
    assert opened[:-1] == [Path("a/replay.rrd"), Path("c/replay.rrd")]
    assert opened[-1].parent == tmp_path / "cache"
    assert check_recording(opened[-1]) == 80


def test_two_pairs_have_files_of_their_own_and_one_pair_always_the_same(recorded, opened, tmp_path):
    for pair in ("ac", "ca", "ac"):
        assert in_process("view", *pair, cwd=recorded).returncode == 0
    one, other, again = opened[2::3]
    assert one == again != other
    assert sorted(tmp_path.glob("cache/side-by-side*")) == sorted([one, other])


def test_a_pair_that_is_recorded_again_does_not_touch_the_file_that_somebody_reads(recorded, opened):
    assert in_process("view", "a", "c", cwd=recorded).returncode == 0
    with opened[-1].open("rb") as read:
        before = opened[-1].read_bytes()
        assert in_process("view", "a", "c", cwd=recorded).returncode == 0
        assert read.read() == before


def test_old_pairs_make_room(recorded, opened, monkeypatch, tmp_path):
    monkeypatch.setattr("omnieval.cli.view._KEPT", 1)
    for pair in ("ac", "ca"):
        assert in_process("view", *pair, cwd=recorded).returncode == 0
    assert list(tmp_path.glob("cache/side-by-side*")) == [opened[-1]]


def test_recordings_are_opened_as_well(recorded, opened):
    assert in_process("view", "a/replay.rrd", "c", cwd=recorded).returncode == 0
    assert opened == [Path("a/replay.rrd"), Path("c/replay.rrd")]


def test_of_several_what_has_no_recording_is_left_out_and_named(recorded, opened):
    (recorded / "notes").mkdir(exist_ok=True)
    result = in_process("view", "a", "b", "notes", "c", cwd=recorded)
    assert result.returncode == 0
    assert opened == [Path("a/replay.rrd"), Path("c/replay.rrd")]
    assert "left out because they have no recording: b, notes; make one with: omnieval render RUN" in result.stderr
    assert "2 recordings: switch with" in result.stderr


def test_of_an_ablation_the_run_that_was_recorded_is_opened(recorded, opened, monkeypatch):
    folder = recorded / "swept"
    monkeypatch.chdir(recorded)
    folder.mkdir(exist_ok=True)
    (folder / "run.json").write_text(json.dumps({"kind": "ablation"}))
    shutil.copytree(recorded / "c", folder / "best", dirs_exist_ok=True)
    assert in_process("view", "swept", cwd=recorded).returncode == 0
    assert opened == [Path("swept/best/replay.rrd")]


def test_on_request_they_are_served_to_a_browser(recorded, opened, monkeypatch):
    served = []

    @contextlib.contextmanager
    def web_viewer(paths, port):
        served.extend(paths)
        yield viewer.WebViewer(port, port + 1)

    monkeypatch.setattr(viewer, "web_viewer", web_viewer)
    monkeypatch.setattr(signal, "signal", lambda *_: None)
    result = in_process("view", "--web", "--port", 9700, "a", cwd=recorded)
    assert result.returncode == 0
    assert result.stdout == "http://127.0.0.1:9700/?url=rerun%2Bhttp%3A%2F%2F127.0.0.1%3A9701%2Fproxy\n"
    assert f"ssh -L 9700:127.0.0.1:9700 -L 9701:127.0.0.1:9701 {socket.gethostname()}" in result.stderr
    assert (opened, served) == ([], [Path("a/replay.rrd")])


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["b"], ["b has no recording", "omnieval render b"]),
        (["b", "sweep"], ["b has no recording", "omnieval render b"]),
        (["sweep"], ["sweep has no recording", "--rrd best"]),
        (["a", "nothing"], ["nothing is not a run folder"]),
        (["nothing"], ["nothing is not a run folder"]),
        (["nothing.rrd"], ["no recording at nothing.rrd"]),
        ([], ["RUN"]),
    ],
)
def test_every_slip_gets_one_line_and_opens_nothing(two_runs, opened, arguments, words):
    (two_runs / "sweep").mkdir(exist_ok=True)
    (two_runs / "sweep" / "run.json").write_text(json.dumps({"kind": "ablation"}))
    fails(in_process("view", *arguments, cwd=two_runs), 2, *words)
    assert opened == []
