"""Locks between processes, on systems that lock folders, on those that do not, and where nothing can be locked."""

import errno
import logging
import subprocess
import sys

import pytest

from omnieval import locks
from omnieval.errors import ResultError
from omnieval.locks import kind_of_locks, lock
from omnieval.results import manifest
from omnieval.results.folder import ResultFolder
from omnieval.results.manifest import is_alive, this_process

HOLDER = (
    "import sys\n"
    "from pathlib import Path\n"
    "from omnieval import locks\n"
    "locks._LOCKS_ITSELF = sys.argv[2] == 'itself'\n"
    "with locks.lock(Path(sys.argv[1])):\n"
    "    print('held', flush=True)\n"
    "    sys.stdin.read()\n"
)


@pytest.fixture(
    params=[
        pytest.param("itself", marks=pytest.mark.skipif(sys.platform == "win32", reason="locks no folders")),
        "beside",  # as on Windows
    ]
)
def way(request, monkeypatch):
    monkeypatch.setattr(locks, "_LOCKS_ITSELF", request.param == "itself")
    return request.param


def test_a_lock_is_had_by_one_at_a_time(way, tmp_path):
    assert ("beside" in kind_of_locks()) == (way == "beside")
    (tmp_path / "run").mkdir()
    with lock(tmp_path / "run") as held:
        assert held.certain
        with pytest.raises(BlockingIOError):
            lock(tmp_path / "run")
    with lock(tmp_path / "run"):
        pass
    assert [path.name for path in tmp_path.rglob("*") if path.name != ".run.lock"] == ["run"]


def test_a_lock_ends_with_its_process_however_that_ends(way, tmp_path):
    command = [sys.executable, "-c", HOLDER, str(tmp_path), way]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as holder:
        assert holder.stdout
        assert holder.stdout.readline() == "held\n"
        with pytest.raises(ResultError, match="is being written by another process; wait for it"):
            ResultFolder(tmp_path, "report", {}).__enter__()
        holder.kill()
    with ResultFolder(tmp_path, "report", {}) as folder:
        folder.complete()


def test_where_nothing_can_be_locked_it_is_said(way, tmp_path, monkeypatch, caplog):
    def unsupported(*_, **__):
        raise OSError(errno.ENOLCK, "no locks available")

    if way == "itself":
        monkeypatch.setattr("fcntl.flock", unsupported)
    else:
        monkeypatch.setattr("filelock.FileLock.acquire", unsupported)
    with caplog.at_level(logging.WARNING, "omnieval"), lock(tmp_path) as held:
        assert not held.certain
    assert caplog.messages == [
        f"{tmp_path}: this file system has no locks; make sure that no other process writes there"
    ]


def test_a_process_is_told_from_a_dead_one_where_there_is_no_proc(tmp_path, monkeypatch):
    monkeypatch.setattr(manifest, "_PROC", tmp_path / "none")
    monkeypatch.setattr(manifest, "_POSIX", False)
    ours = this_process()
    assert ours["born"] is not None
    assert is_alive(ours)
    assert not is_alive(ours | {"born": "1.00"})  # its number was given to another
    with subprocess.Popen([sys.executable, "-c", ""]) as ended:
        pass
    assert not is_alive({"pid": ended.pid, "host": ours["host"], "born": ours["born"]})
