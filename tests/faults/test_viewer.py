"""A viewer that is not one, goes away, or is not there at all: the tables are those of a replay without it."""

import contextlib
import signal
import socket
import subprocess

import pytest

from omnieval.recording.viewer import _answers, _viewer_binary
from omnieval.results.run_folder import open_run
from tests.cli.test_cli import in_process
from tests.faults.commands import OFTEN, REPLAY, begun, end, one_line, start, steps_recorded, wait_for

pytestmark = pytest.mark.faults

HOST = "127.0.0.1"


def url(port):
    return f"rerun+http://{HOST}:{port}/proxy"


@pytest.fixture
def viewer():
    """A process that receives recordings as the viewer does, without a window, and its port."""
    with socket.socket() as probe:
        probe.bind((HOST, 0))
        port = probe.getsockname()[1]
    command = [str(_viewer_binary()), "--bind", HOST, "--port", str(port), "--serve-grpc"]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
        while not _answers(HOST, port):
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(timeout=0.02)
                raise AssertionError("the viewer has ended")
        yield process, port
        process.kill()


def test_a_viewer_that_watches_changes_nothing(panoramas, replayed, viewer, tmp_path):
    _, port = viewer
    process = start(tmp_path, "replay", panoramas, *REPLAY, "--out", "run", "--connect", url(port))
    code, _, err = end(process)
    assert (code, err) == (0, "")
    assert open_run(tmp_path / "run").content_hash == replayed.content_hash
    assert steps_recorded(tmp_path / "run" / "replay.rrd") == len(replayed.steps)


def test_a_viewer_that_is_closed_costs_nothing_but_the_view(panoramas, replayed, viewer, tmp_path):
    watching, port = viewer
    folder = tmp_path / "run"
    arguments = ("replay", panoramas, *REPLAY, "--out", folder, "--connect", url(port))
    process = start(tmp_path, *arguments, prepare=OFTEN)
    wait_for(lambda: len(list((folder / "parts").glob("steps*"))) > 3, process)
    watching.kill()
    code, _, err = end(process)
    assert code == 0
    ours = [line for line in err.splitlines() if line.startswith("omnieval: ")]
    assert len(ours) == 1
    assert "(the tables are complete): the viewer was lost" in ours[0]
    assert "Traceback" not in err
    assert open_run(folder).content_hash == replayed.content_hash
    assert steps_recorded(folder / "replay.rrd") == len(replayed.steps)


IMPATIENT = """
import omnieval.recording.rerun_stream as stream
import omnieval.sinks as sinks
stream._FLUSH_SECONDS = sinks._PATIENCE_S = 0.5
"""


def test_a_viewer_that_is_frozen_does_not_keep_the_replay_from_ending(panoramas, replayed, viewer, tmp_path):
    watching, port = viewer
    folder = tmp_path / "run"
    arguments = ("replay", panoramas, *REPLAY, "--out", folder, "--connect", url(port))
    process = start(tmp_path, *arguments, prepare=OFTEN + IMPATIENT)
    wait_for(lambda: len(list((folder / "parts").glob("steps*"))) > 3, process)
    watching.send_signal(signal.SIGSTOP)
    code, _, err = end(process)
    assert code == 0
    ours = [line for line in err.splitlines() if line.startswith("omnieval: ")]
    assert len(ours) == 1
    assert "the recording may be incomplete (the tables are complete): the viewer has not responded" in ours[0]
    assert "Traceback" not in err
    assert open_run(folder).content_hash == replayed.content_hash
    assert in_process("render", folder, "--no-images", cwd=tmp_path).returncode == 0
    assert steps_recorded(folder / "replay.rrd") == len(replayed.steps)


def test_a_port_that_somebody_else_has_is_refused_at_once(panoramas, tmp_path):
    with socket.create_server((HOST, 0)) as silent:
        port = silent.getsockname()[1]
        arguments = ("replay", panoramas, *REPLAY, "--out", "run", "--connect", url(port))
        result = in_process(*arguments, cwd=tmp_path)
    assert (result.returncode, result.stdout) == (2, "")
    assert "is not a viewer" in one_line(result.stderr)
    nobody = in_process(*arguments, *(("--overwrite",) if begun(tmp_path / "run") else ()), cwd=tmp_path)
    assert nobody.returncode == 2
    assert "no viewer listens" in one_line(nobody.stderr)


def test_a_recording_that_cannot_be_written_costs_nothing_but_the_view(panoramas, replayed, tmp_path, monkeypatch):
    def unwritable(descriptor, block):
        raise OSError(5, "Input/output error")

    monkeypatch.setattr("omnieval.recording.pipe.os.write", unwritable)
    result = in_process("replay", panoramas, *REPLAY, "--out", "run", cwd=tmp_path)
    monkeypatch.undo()
    assert result.returncode == 0
    assert "the recording may be incomplete (the tables are complete): " in one_line(result.stderr)
    assert open_run(tmp_path / "run").content_hash == replayed.content_hash
    assert not open_run(tmp_path / "run").recording.exists()
