"""The viewer starts on sound recordings, is reachable from this machine only, and says why it does not start."""

import contextlib
import signal
import socket
import stat
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from omnieval.errors import OmnievalError, ResultError
from omnieval.recording import viewer
from omnieval.recording.digest import digest
from omnieval.recording.recorder import Recorder
from omnieval.recording.viewer import check_recording, check_viewer, open_viewer, start_viewer, web_viewer
from tests.recording.replays import image, info, steps

needs_scripts = pytest.mark.skipif(sys.platform == "win32", reason="stands in for the viewer with a script")


@pytest.fixture
def recording(tmp_path):
    path = tmp_path / "replay.rrd"
    with Recorder(path, info(60)) as recorder:
        for a_step in steps(60):
            recorder.log(a_step, image(a_step.frame), 1.5)
    return path


def stand_in(monkeypatch, tmp_path, body):
    """Let a script stand in for the viewer; it finds its arguments in sys.argv."""
    script = tmp_path / "viewer"
    script.write_text(f"#!{sys.executable}\nimport socket, sys, time\n{body}\n")
    script.chmod(script.stat().st_mode | stat.S_IXUSR)
    monkeypatch.setattr(viewer, "_viewer_binary", lambda: script)


def test_a_sound_recording_has_its_steps(recording):
    assert check_recording(recording) == 60


@pytest.mark.parametrize("damage", ["empty", "cut", "other"])
def test_a_damaged_recording_is_refused(recording, damage):
    content = recording.read_bytes()
    recording.write_bytes({"empty": b"", "cut": content[: len(content) // 2], "other": b"not a recording"}[damage])
    with pytest.raises(ResultError, match="render it again"):
        check_recording(recording)


def test_a_recording_without_steps_is_refused(tmp_path):
    path = tmp_path / "replay.rrd"
    Recorder(path, info(60)).close()
    with pytest.raises(ResultError, match="no steps"):
        check_recording(path)


def test_a_missing_recording_is_refused(tmp_path):
    with pytest.raises(ResultError, match="no recording at"):
        check_recording(tmp_path / "none.rrd")
    with pytest.raises(ResultError, match="cannot read"):
        digest(tmp_path / "none.rrd")


KILLED = """
import os, signal, sys
from pathlib import Path
from omnieval.recording.recorder import Recorder
from tests.recording.replays import image, info, steps
recorder = Recorder(Path(sys.argv[1]), info(120))
for step in steps(101):
    recorder.log(step, image(step.frame), 1.5)
os.kill(os.getpid(), signal.SIGKILL)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="has no SIGKILL")
def test_a_killed_process_leaves_a_readable_recording_of_what_was_flushed(tmp_path):
    root = Path(__file__).parents[2]
    command = [sys.executable, "-c", KILLED, str(tmp_path / "replay.rrd")]
    assert subprocess.run(command, cwd=root, check=False).returncode == -signal.SIGKILL
    assert not (tmp_path / "replay.rrd").exists()
    assert check_recording(tmp_path / "replay.partial.rrd") == 100


@needs_scripts
def test_the_viewer_is_given_the_recordings_and_the_loopback_address(monkeypatch, tmp_path, recording):
    stand_in(monkeypatch, tmp_path, f"open({str(tmp_path / 'said')!r}, 'w').write(' '.join(sys.argv[1:]))")
    open_viewer([recording])
    assert (tmp_path / "said").read_text() == f"--bind 127.0.0.1 --port auto {recording}"


@needs_scripts
def test_a_viewer_that_cannot_start_says_why(monkeypatch, tmp_path, recording):
    stand_in(monkeypatch, tmp_path, "print('no driver'); print(); sys.exit(3)")
    monkeypatch.setenv("DISPLAY", ":0")
    for start in (lambda: open_viewer([recording]), start_viewer):
        with pytest.raises(
            OmnievalError, match=r"a graphics driver \(exit code 3, DISPLAY is :0\); .*omnieval view --web"
        ) as no:
            start()
        assert "no driver" not in str(no.value)
        assert "no driver" in str(no.value.__cause__)  # for --debug


@needs_scripts
@pytest.mark.skipif(sys.platform == "darwin", reason="has a display without saying so")
def test_a_viewer_without_a_display_says_so_and_names_no_source_file(monkeypatch, tmp_path, recording):
    stand_in(monkeypatch, tmp_path, "print('Error: winit /root/.cargo/registry/src/lib.rs:42'); sys.exit(1)")
    for variable in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(variable, raising=False)
    with pytest.raises(OmnievalError, match="cannot start: there is no display") as error:
        open_viewer([recording])
    assert "winit" not in str(error.value)
    assert "omnieval view --web RUN" in str(error.value)


def test_a_viewer_that_is_not_there_says_so(monkeypatch, tmp_path, recording):
    monkeypatch.setattr(viewer, "_viewer_binary", lambda: tmp_path / "none")
    with pytest.raises(OmnievalError, match="reinstall rerun-sdk"):
        open_viewer([recording])


def test_the_viewer_is_the_one_of_the_wheel():
    assert viewer._viewer_binary().is_file()


@needs_scripts
def test_a_live_viewer_is_waited_for_and_its_address_returned(monkeypatch, tmp_path):
    listen = "s = socket.create_server((sys.argv[2], int(sys.argv[4]))); s.settimeout(30); s.accept()"
    stand_in(monkeypatch, tmp_path, listen)
    url = start_viewer()
    assert url.startswith("rerun+http://127.0.0.1:")
    assert url.endswith("/proxy")
    assert viewer._LAUNCHED[-1].wait(30) == 0


def two_free_ports():
    """Return the first of two ports in a row that nobody uses."""
    while True:
        with socket.create_server(("127.0.0.1", 0)) as first, contextlib.suppress(OSError):
            port: int = first.getsockname()[1]
            with socket.create_server(("127.0.0.1", port + 1)):
                return port


@needs_scripts
def test_recordings_are_served_to_browsers_on_this_machine_while_the_block_lasts(monkeypatch, tmp_path, recording):
    ports = "[int(sys.argv[sys.argv.index(name) + 1]) for name in ('--web-viewer-port', '--port')]"
    serve = f"import signal; servers = [socket.create_server((sys.argv[2], one)) for one in {ports}]; signal.pause()"
    stand_in(monkeypatch, tmp_path, f"assert sys.argv[-1] == {str(recording)!r}; {serve}")
    port = two_free_ports()
    with web_viewer([recording], port) as served:
        for one in (port, port + 1):
            socket.create_connection(("127.0.0.1", one)).close()
        assert served.url == f"http://127.0.0.1:{port}/?url=rerun%2Bhttp%3A%2F%2F127.0.0.1%3A{port + 1}%2Fproxy"
    assert viewer._LAUNCHED[-1].returncode == -signal.SIGTERM


def test_a_port_that_is_taken_is_named(recording):
    port = two_free_ports()
    for taken in (port, port + 1):
        with (
            socket.create_server(("127.0.0.1", taken)),
            pytest.raises(ResultError, match=f"port {taken} is taken .*--port"),
            web_viewer([recording], port),
        ):
            raise AssertionError


@contextlib.contextmanager
def listening(answer):
    """Somebody who says `answer` to whoever connects second, which is the one who greets; give its URL."""
    with socket.create_server(("127.0.0.1", 0)) as server, ThreadPoolExecutor(1) as thread:
        url = f"rerun+http://127.0.0.1:{server.getsockname()[1]}/proxy"

        def serve():
            server.accept()[0].close()
            with server.accept()[0] as connection:
                connection.recv(1024)
                connection.sendall(answer)

        served = thread.submit(serve)
        yield url
        served.result()


def test_a_viewer_to_connect_to_has_to_listen():
    with listening(b"\0\0\6\4\0\0\0\0\0\0\5\0\0\x40\0") as url:
        check_viewer(url)
    with pytest.raises(ResultError, match="no viewer listens"):
        check_viewer(url)


@pytest.mark.parametrize("answer", [b"", b"HTTP/1.1 400 Bad Request\r\n\r\n", b"SSH"])
def test_who_listens_has_to_be_a_viewer(answer):
    with listening(answer) as url, pytest.raises(ResultError, match="is not a viewer; start one on another port"):
        check_viewer(url)


@pytest.mark.parametrize("url", ["", "localhost:9876", "http://127.0.0.1:9876/proxy", "rerun+http://127.0.0.1:9876"])
def test_a_url_that_is_not_a_viewers_is_refused(url):
    with pytest.raises(ResultError, match="not a viewer's URL"):
        check_viewer(url)


def test_a_port_that_is_none_is_refused():
    with pytest.raises(ResultError, match="no valid port"):
        check_viewer("rerun+http://127.0.0.1:99999/proxy")
