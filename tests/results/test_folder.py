"""A folder of results: one writer at a time, a true status, let go whatever happens, a ``run.json`` at every moment."""

import errno
import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from omnieval.errors import ResultError
from omnieval.results import folder as module
from omnieval.results.folder import ResultFolder, hold_folder
from omnieval.results.manifest import is_alive, kind_of, read_manifest, status_of, this_process
from omnieval.results.run_folder import RunWriter, open_run

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="kills processes as POSIX does")

WRITER = (
    "import sys\n"
    "from omnieval.results.folder import ResultFolder\n"
    "with ResultFolder(sys.argv[1], 'ablation', {}):\n"
    "    print('writing', flush=True)\n"
    "    sys.stdin.read()\n"
)


def begin(folder, *, overwrite=False):
    return ResultFolder(folder, "ablation", {}, files=["table"], overwrite=overwrite)


def replace(folder):
    return begin(folder, overwrite=True)


def reopen(folder):
    return ResultFolder(folder, "ablation", {"again": True}, files=["table"], resume=True)


def ended(folder):
    with begin(folder) as held:
        held.complete()
    (folder / "table").write_text("old")


def said(folder):
    return read_manifest(folder, "ablation")


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
    ended(tmp_path / "out")
    before = said(tmp_path / "out")
    with reopen(tmp_path / "out"):
        after = said(tmp_path / "out")
        assert (after["status"], after["started"], after["again"]) == ("running", before["started"], True)
        assert "resumed" in after
        assert "finished" not in after
        assert not (tmp_path / "out" / "table").exists()


@pytest.mark.parametrize("again", [reopen, replace])
def test_there_is_a_manifest_at_every_moment(tmp_path, monkeypatch, again):
    ended(tmp_path / "out")
    seen = []

    def watched(change):
        def call(path, *rest, **options):
            result = change(path, *rest, **options)
            seen.append(status_of(said(tmp_path / "out")))
            return result

        return call

    for name in ("unlink", "replace"):
        monkeypatch.setattr(Path, name, watched(getattr(Path, name)))
    with again(tmp_path / "out"):
        assert seen
        assert seen[-1] == "running"
    assert "complete" not in seen[1:]


def test_what_is_not_there_is_named_by_what_it_should_be(tmp_path):
    with pytest.raises(ResultError, match="is not an ablation folder: there is no such folder"):
        reopen(tmp_path / "none").__enter__()
    (tmp_path / "empty").mkdir()
    with pytest.raises(ResultError, match=r"is not an ablation folder: it has no run\.json"):
        reopen(tmp_path / "empty").__enter__()
    with pytest.raises(ResultError, match="is not a baseline folder"):
        read_manifest(tmp_path / "empty", "baseline")
    with pytest.raises(ResultError, match="is not a run folder"):
        read_manifest(tmp_path / "empty", "replay")
    ended(tmp_path / "out")
    with pytest.raises(ResultError, match="is an ablation, not a replay; name the folder of a replay"):
        read_manifest(tmp_path / "out", "replay")
    with pytest.raises(ResultError, match="holds an ablation already"):
        begin(tmp_path / "out").__enter__()


@pytest.mark.parametrize("second", [begin, reopen, replace, lambda folder: hold_folder(folder, "ablation")])
def test_a_folder_has_one_writer(tmp_path, other_writer, second):
    before = (tmp_path / "out" / "run.json").read_bytes()
    with pytest.raises(ResultError, match="is being written by another process"):
        second(tmp_path / "out").__enter__()
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
    with reopen(out) as held:
        held.complete()
    assert sorted(path.name for path in out.rglob("*")) == ["parts", "run.json"]


def test_a_killed_beginning_is_no_hindrance(tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / ".run.json.123.tmp").write_text("{")
    with begin(tmp_path / "out") as held:
        held.complete()
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["run.json"]


@pytest.mark.parametrize("name", [".notes.123.tmp", ".run.json.tmp", "run.json.1.tmp"])
def test_what_others_wrote_is_left_alone(tmp_path, name):
    (tmp_path / name).write_text("mine")
    with pytest.raises(ResultError, match="not an ablation of omnieval"):
        replace(tmp_path).__enter__()
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
    for again in (reopen, replace, lambda folder: hold_folder(folder, "ablation")):
        with pytest.raises(ResultError, match=r"still being written by process \d+ on elsewhere"):
            again(tmp_path / "out").__enter__()
    assert json.loads(path.read_text()) == content


def test_a_lock_knows_better_than_the_name_of_a_machine(tmp_path):
    ended(tmp_path / "out")
    path = tmp_path / "out" / "run.json"
    content = json.loads(path.read_text()) | {"status": "running"}
    content["process"]["host"] = "a container that is gone"
    path.write_text(json.dumps(content))
    with hold_folder(tmp_path / "out", "ablation"):
        assert json.loads(path.read_text()) == content
    with replace(tmp_path / "out"):
        assert said(tmp_path / "out")["process"]["host"] == this_process()["host"]


def test_a_status_that_could_not_be_written_is_not_believed(tmp_path, monkeypatch):
    def full(content, path):
        raise ResultError("no space")

    with begin(tmp_path / "out") as held:
        with monkeypatch.context() as patch:
            patch.setattr(module, "write_json", full)
            with pytest.raises(ResultError):
                held.complete()
        assert held.content["status"] == "running"
    assert said(tmp_path / "out")["status"] == "failed"


@pytest.mark.parametrize(
    ("error", "status", "reason"),
    [
        (KeyboardInterrupt(), "interrupted", "interrupted by the user"),
        (ResultError("cannot write x: no space"), "failed", "cannot write x: no space"),
        (MemoryError(), "failed", "MemoryError"),
        (OSError(5, "Input/output\nerror"), "failed", "OSError: [Errno 5] Input/output error"),
        (SystemExit(3), "failed", "SystemExit: 3"),
    ],
)
def test_whatever_ends_it_early_is_its_reason_and_lets_others_write(tmp_path, error, status, reason):
    with pytest.raises(type(error)), begin(tmp_path / "out"):
        raise error
    assert (said(tmp_path / "out")["status"], said(tmp_path / "out")["reason"]) == (status, reason)
    with replace(tmp_path / "out") as held:
        held.complete()
    assert "reason" not in said(tmp_path / "out")


def test_what_is_left_before_it_is_complete_is_not(tmp_path):
    with begin(tmp_path / "out"):
        pass
    assert (said(tmp_path / "out")["status"], said(tmp_path / "out")["reason"]) == (
        "failed",
        "it was left before its end",
    )


def test_what_is_complete_stays_so(tmp_path):
    def complete_and_fail():
        with begin(tmp_path / "out") as held:
            held.complete({"metrics": {"nodes": 3}})
            raise MemoryError

    with pytest.raises(MemoryError):
        complete_and_fail()
    assert said(tmp_path / "out")["status"] == "complete"
    assert "reason" not in said(tmp_path / "out")
    assert kind_of(tmp_path / "out") == "ablation"


def test_a_beginning_that_fails_lets_others_write(tmp_path, monkeypatch):
    def full(content, path):
        raise ResultError("no space")

    with monkeypatch.context() as patch:
        patch.setattr(module, "write_json", full)
        with pytest.raises(ResultError, match="no space"):
            begin(tmp_path / "out").__enter__()
    assert not (tmp_path / "out").exists()
    ended(tmp_path / "out")


def test_what_was_only_held_is_as_it_was(tmp_path):
    with pytest.raises(MemoryError), ResultFolder(tmp_path / "new", "report"):
        raise MemoryError
    assert not (tmp_path / "new").exists()
    ended(tmp_path / "out")
    before = {path: path.read_bytes() for path in (tmp_path / "out").iterdir()}
    with ResultFolder(tmp_path / "out", "ablation", files=["table"], overwrite=True):
        with pytest.raises(ResultError, match="being written by another process; wait for it or choose another --out"):
            replace(tmp_path / "out").__enter__()
        with pytest.raises(ResultError, match=r"being written by another process; wait for it$"):
            hold_folder(tmp_path / "out", "ablation").__enter__()
    assert {path: path.read_bytes() for path in (tmp_path / "out").iterdir()} == before


def test_a_run_that_is_being_recorded_is_not_written_again(tmp_path):
    with RunWriter(tmp_path / "run", {}) as writer:
        with pytest.raises(ResultError, match="is being written by another process; wait for it"):
            hold_folder(tmp_path / "run").__enter__()
        writer.finish({}, {})
    before = (tmp_path / "run" / "run.json").read_bytes()
    with hold_folder(tmp_path / "run"):
        with pytest.raises(ResultError, match="is being written by another process"):
            RunWriter(tmp_path / "run", {}, overwrite=True).__enter__()
        (tmp_path / "run" / "replay.rrd").write_bytes(b"again")
    assert (tmp_path / "run" / "run.json").read_bytes() == before
    with pytest.raises(ResultError, match="is not a run folder"):
        hold_folder(tmp_path / "none").__enter__()
    assert not (tmp_path / "none").exists()


def test_home_is_where_the_tilde_says(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    monkeypatch.chdir(tmp_path)
    with RunWriter("~/run", {"frames": 3}) as writer:
        run = writer.finish({}, {})
    assert run.folder == tmp_path / "home" / "run"
    assert open_run("~/run").folder == run.folder
    assert kind_of("~/run") == "replay"
    assert [path.name for path in tmp_path.iterdir()] == ["home"]
    with pytest.raises(ResultError, match="no such home folder; write the path without ~"):
        RunWriter("~nobody-has-this-name/run", {})
