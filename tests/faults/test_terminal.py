"""Terminals, pipes and closed streams: the exit code is right and nobody sees a traceback."""

import os
import pty
import shutil
import subprocess
import sys

import pytest

from omnieval.results.run_folder import open_run
from tests.cli.test_cli import in_process
from tests.faults.commands import REPLAY

pytestmark = pytest.mark.faults

MAIN = f"{sys.executable} -c 'from omnieval.cli import main; main()'"


def shell(cwd, command, **environment):
    script = f"set -o pipefail; {command}"
    return subprocess.run(
        ["bash", "-c", script], cwd=cwd, capture_output=True, text=True, check=False, env=dict(os.environ) | environment
    )


@pytest.fixture(scope="module")
def many(replayed, tmp_path_factory):
    """More runs than fit into a pipe when they are compared."""
    cwd = tmp_path_factory.mktemp("many")
    for number in range(150):
        folder = cwd / f"run-with-a-long-name-so-that-its-row-is-long-too-{number}"
        folder.mkdir()
        (folder / "run.json").write_bytes((replayed.folder / "run.json").read_bytes())
    return cwd


@pytest.mark.parametrize("options", ["", "--json"])
def test_whoever_reads_may_leave(many, options):
    result = shell(many, f"{MAIN} compare run* {options} | head -n 1; echo ${{PIPESTATUS[0]}} >&2")
    assert result.stdout.count("\n") == 1
    assert result.stderr.strip() in {"1", "141"}


@pytest.mark.parametrize("closed", [">&-", "2>&-", "<&- >&- 2>&-"])
def test_closed_streams(panoramas, replayed, tmp_path, closed):
    words = " ".join(REPLAY)
    result = shell(tmp_path, f"{MAIN} replay {panoramas} {words} --no-rrd --out run {closed}")
    assert (result.returncode, result.stderr) == (0, "")
    assert ("silhouette" in result.stdout) == (">&-" not in closed.replace("2>&-", ""))
    assert open_run(tmp_path / "run").content_hash == replayed.content_hash


@pytest.mark.parametrize("closed", ["<&-", ">&-", "2>&-", "<&- >&- 2>&-"])
def test_closed_streams_when_it_fails(tmp_path, closed):
    result = shell(tmp_path, f"{MAIN} compare nothing {closed}")
    assert result.returncode == 2
    assert result.stdout == ""
    assert "Traceback" not in result.stderr


def test_a_full_output_device_is_an_error(many):
    result = shell(many, f"{MAIN} compare run* > /dev/full")
    assert result.returncode not in {0, 139}
    assert "Traceback" not in result.stderr
    assert len(result.stderr.splitlines()) <= 1


@pytest.mark.parametrize(
    "environment",
    [
        {"TERM": "dumb", "LANG": "C", "LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"},
        {"PYTHONIOENCODING": "ascii", "COLUMNS": "1", "NO_COLOR": "1"},
    ],
    ids=lambda environment: " ".join(f"{name}={value}" for name, value in environment.items()),
)
def test_poor_terminals(panoramas, replayed, tmp_path, environment):
    umlaut = tmp_path / "Gebäude"
    shutil.copytree(panoramas, umlaut)
    words = " ".join(REPLAY)
    result = shell(tmp_path, f"{MAIN} replay folder:{umlaut} {words} --no-rrd --out run", **environment)
    assert (result.returncode, result.stderr) == (0, "")
    assert open_run(tmp_path / "run").content_hash == replayed.content_hash
    failing = shell(tmp_path, f"{MAIN} replay folder:{tmp_path}/Gebäudé --out none", **environment)
    assert failing.returncode == 3
    assert len(failing.stderr.splitlines()) == 1
    assert "Traceback" not in failing.stderr


def test_in_a_terminal_progress_is_shown_and_the_exit_code_is_right(panoramas, tmp_path):
    ours, theirs = pty.openpty()
    command = [sys.executable, "-c", "from omnieval.cli import main; main()", "replay", panoramas]
    with subprocess.Popen(
        [*map(str, command), *REPLAY, "--no-rrd", "--out", "run"],
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=theirs,
        env=dict(os.environ) | {"TERM": "xterm"},
        text=True,
    ) as process:
        os.close(theirs)
        shown = b"".join(iter(lambda: _read(ours), b""))
        out, _ = process.communicate(timeout=60)
    os.close(ours)
    assert process.returncode == 0
    assert b"replaying" in shown
    assert "silhouette" in out
    assert "\x1b" not in out


def _read(descriptor):
    try:
        return os.read(descriptor, 1 << 16)
    except OSError:  # how Linux says that nobody has the other end open any more
        return b""


def test_not_a_terminal_nothing_but_results(panoramas, tmp_path):
    result = in_process("replay", panoramas, *REPLAY, "--no-rrd", "--out", "run", cwd=tmp_path)
    assert result.stderr == ""
    assert "\x1b" not in result.stdout
