"""The manifest: one writer at a time, a true status, and a ``run.json`` at every moment."""

import errno
import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from omnieval.errors import ResultError
from omnieval.results import manifest as module
from omnieval.results.manifest import Manifest, read_manifest, refuse_running, status_of
from omnieval.results.ownership import is_alive, this_process

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="locks no folders")

WRITER = (
    "import pathlib, sys\n"
    "from omnieval.results.manifest import Manifest\n"
    "manifest = Manifest(pathlib.Path(sys.argv[1]), 'ablation', {}, files=[], overwrite=False)\n"
    "print('writing', flush=True)\n"
    "sys.stdin.read()\n"
)


def begin(folder, *, overwrite=False, files=("table",), **content):
    return Manifest(folder, "ablation", content, files=files, overwrite=overwrite)


def reopen(folder):
    return Manifest.reopen(folder, "ablation", {"again": True}, files=["table"])


def ended(folder, status="complete"):
    begin(folder).close(status, {})
    (folder / "table").write_text("old")


@pytest.fixture
def other_writer(tmp_path):
    command = [sys.executable, "-c", WRITER, str(tmp_path / "out")]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdin
        assert process.stdout
        assert process.stdout.readline() == "writing\n"
        yield process
        process.stdin.close()


def test_a_reopened_folder_keeps_when_it_began_and_drops_what_is_not_true_any_more(tmp_path):
    ended(tmp_path / "out", "interrupted")
    before = read_manifest(tmp_path / "out", "ablation")
    again = reopen(tmp_path / "out")
    after = read_manifest(tmp_path / "out", "ablation")
    assert (after["status"], after["started"], after["again"]) == ("running", before["started"], True)
    assert "resumed" in after
    assert "finished" not in after
    assert not (tmp_path / "out" / "table").exists()
    again.close("complete", {})


@pytest.mark.parametrize("again", [reopen, lambda folder: begin(folder, overwrite=True)])
def test_there_is_a_manifest_at_every_moment(tmp_path, monkeypatch, again):
    ended(tmp_path / "out")
    seen = []

    def watched(change):
        def call(path, *rest, **options):
            result = change(path, *rest, **options)
            seen.append(status_of(read_manifest(tmp_path / "out", "ablation")))
            return result

        return call

    for name in ("unlink", "replace"):
        monkeypatch.setattr(Path, name, watched(getattr(Path, name)))
    again(tmp_path / "out")
    assert seen
    assert seen[-1] == "running"
    assert "complete" not in seen[1:]


def test_what_is_not_there_is_named_by_what_it_should_be(tmp_path):
    with pytest.raises(ResultError, match="is not an ablation folder: there is no such folder"):
        reopen(tmp_path / "none")
    (tmp_path / "empty").mkdir()
    with pytest.raises(ResultError, match=r"is not an ablation folder: it has no run\.json"):
        reopen(tmp_path / "empty")
    with pytest.raises(ResultError, match="is not a baseline folder"):
        read_manifest(tmp_path / "empty", "baseline")
    with pytest.raises(ResultError, match="is not a run folder"):
        read_manifest(tmp_path / "empty", "replay")
    ended(tmp_path / "out")
    with pytest.raises(ResultError, match="is an ablation, not a replay; name the folder of a replay"):
        read_manifest(tmp_path / "out", "replay")
    with pytest.raises(ResultError, match="holds an ablation already"):
        begin(tmp_path / "out")


@pytest.mark.parametrize("second", [begin, reopen, lambda folder: begin(folder, overwrite=True)])
def test_a_folder_has_one_writer(tmp_path, other_writer, second):
    before = (tmp_path / "out" / "run.json").read_bytes()
    with pytest.raises(ResultError, match="is being written by another process"):
        second(tmp_path / "out")
    assert (tmp_path / "out" / "run.json").read_bytes() == before
    assert status_of(json.loads(before)) == "running"


def test_a_dead_writer_leaves_no_lock_and_no_half_files(tmp_path, other_writer):
    os.kill(other_writer.pid, signal.SIGKILL)
    other_writer.wait()
    out = tmp_path / "out"
    assert status_of(read_manifest(out, "ablation")) == "interrupted"
    half = out / f".table.{other_writer.pid}.tmp"
    half.write_text("ha")
    (out / "parts").mkdir()
    (out / "parts" / ".00001.json.77.tmp").write_text("ha")
    reopen(out).close("complete", {})
    assert sorted(path.name for path in out.rglob("*")) == ["parts", "run.json"]


def test_a_killed_beginning_is_no_hindrance(tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / ".run.json.123.tmp").write_text("{")
    begin(tmp_path / "out").close("complete", {})
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["run.json"]


@pytest.mark.parametrize("name", [".notes.123.tmp", ".run.json.tmp", "run.json.1.tmp"])
def test_what_others_wrote_is_left_alone(tmp_path, name):
    (tmp_path / name).write_text("mine")
    with pytest.raises(ResultError, match="not an ablation of omnieval"):
        begin(tmp_path, overwrite=True)
    assert (tmp_path / name).read_text() == "mine"


def test_a_later_process_with_the_same_number_is_another_one():
    process = this_process()
    assert is_alive(process)
    assert not is_alive(process | {"born": f"{process['born']}0"})
    assert is_alive(process | {"born": None})
    assert is_alive(process | {"host": "elsewhere", "pid": 1})
    assert is_alive({})
    assert not is_alive(process | {"pid": 10**30})


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="asks /proc")
def test_a_process_nobody_has_waited_for_is_dead():
    command = [sys.executable, "-c", "print('up', flush=True); input()"]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout
        assert process.stdout.readline() == "up\n"
        assert is_alive({"pid": process.pid, "host": this_process()["host"]})
        process.kill()
        os.waitid(os.P_PID, process.pid, os.WEXITED | os.WNOWAIT)
        assert not is_alive({"pid": process.pid, "host": this_process()["host"]})


def no_locks(monkeypatch):
    def unsupported(descriptor, operation):
        raise OSError(errno.ENOLCK, os.strerror(errno.ENOLCK))

    monkeypatch.setattr("fcntl.flock", unsupported)


def test_where_there_are_no_locks_a_run_on_another_machine_is_not_replaced(tmp_path, monkeypatch):
    no_locks(monkeypatch)
    ended(tmp_path / "out")
    path = tmp_path / "out" / "run.json"
    content = json.loads(path.read_text()) | {"status": "running"}
    content["process"]["host"] = "elsewhere"
    path.write_text(json.dumps(content))
    for again in (reopen, lambda folder: begin(folder, overwrite=True), lambda folder: refuse_running(folder, content)):
        with pytest.raises(ResultError, match=r"still being written by process \d+ on elsewhere"):
            again(tmp_path / "out")
    assert json.loads(path.read_text()) == content


def test_a_lock_knows_better_than_the_name_of_a_machine(tmp_path):
    ended(tmp_path / "out")
    path = tmp_path / "out" / "run.json"
    content = json.loads(path.read_text()) | {"status": "running"}
    content["process"]["host"] = "a container that is gone"
    path.write_text(json.dumps(content))
    refuse_running(tmp_path / "out", content)
    begin(tmp_path / "out", overwrite=True)
    assert read_manifest(tmp_path / "out", "ablation")["process"]["host"] == this_process()["host"]


def test_a_status_that_could_not_be_written_is_not_believed(tmp_path, monkeypatch):
    manifest = begin(tmp_path / "out")

    def full(content, path):
        raise ResultError("no space")

    monkeypatch.setattr(module, "write_json", full)
    with pytest.raises(ResultError):
        manifest.close("complete", {})
    assert manifest.content["status"] == "running"
