"""The viewer of Rerun's wheel, started on recordings or to watch a replay, and the check of what it is given."""

from __future__ import annotations

import importlib.util
import os
import socket
import subprocess
import sys
import tempfile
import time
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import IO, Any
from urllib.parse import quote, urlsplit

from rerun.chunk import RrdReader
from rerun.error_utils import RerunWarning

from omnieval.errors import OmnievalError, ResultError
from omnieval.recording import entities

_LOOPBACK = "127.0.0.1"
_START_SECONDS = 20.0
_SETTLE_SECONDS = 2.0
_POLL_SECONDS = 0.1
_DEFAULT_PORT = 9876
DEFAULT_WEB_PORT = 9090

_HTTP2_GREETING = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n" + bytes((0, 0, 0, 4, 0, 0, 0, 0, 0))
"""The connection preface of HTTP/2, on which gRPC runs, with an empty SETTINGS frame (RFC 9113, 3.4)."""
_SETTINGS_FRAME = 4

_DISPLAYS = ("WAYLAND_DISPLAY", "DISPLAY")
"""What says where windows go, outside Windows and macOS."""

_INSTEAD = "a browser needs neither display nor driver here: omnieval view --web RUN"

_LAUNCHED: list[subprocess.Popen[bytes]] = []
"""Viewers go on without us; Python would complain of a process that is forgotten while it runs."""


def open_viewer(paths: Sequence[Path]) -> None:
    """Open recordings in a viewer that outlives this process.

    Raises
    ------
    ResultError
        If a file holds no recording of omnieval.
    OmnievalError
        If the viewer cannot start, e.g. without a display.
    """
    for path in paths:
        check_recording(path)
    with tempfile.TemporaryFile() as output:
        viewer = _launch(["--port", "auto", *(str(path.resolve()) for path in paths)], output)
        _let_fail(viewer, output, seconds=_SETTLE_SECONDS)


@contextmanager
def web_viewer(paths: Sequence[Path], port: int = DEFAULT_WEB_PORT) -> Iterator[WebViewer]:
    """Serve recordings to browsers on this machine only, until the block ends.

    Parameters
    ----------
    paths
        The recordings.
    port
        Where the page is; the recordings are behind the next one.

    Raises
    ------
    ResultError
        If a file holds no recording of omnieval, or a port is taken.
    OmnievalError
        If the viewer cannot start.
    """
    for path in paths:
        check_recording(path)
    served = WebViewer(port, port + 1)
    for one in (served.page_port, served.data_port):
        _refuse_taken(one)
    serve = ["--serve-web", "--web-viewer-port", str(port), "--port", str(served.data_port)]
    # What does not fit is forgotten from its beginning on; a quarter of the memory holds what a desktop viewer would.
    memory = ["--server-memory-limit", "75%"]
    with tempfile.TemporaryFile() as output:
        viewer = _launch([*serve, *memory, *(str(path.resolve()) for path in paths)], output)
        try:
            deadline = time.monotonic() + _START_SECONDS
            while not all(_answers(_LOOPBACK, one) for one in (served.page_port, served.data_port)):
                _let_fail(viewer, output, seconds=_POLL_SECONDS)
                if time.monotonic() > deadline:
                    raise OmnievalError(f"the viewer did not answer within {_START_SECONDS:g} s; try it with: rerun")
            yield replace(served, process=viewer)
        finally:
            viewer.terminate()
            viewer.wait()


@dataclass(frozen=True)
class WebViewer:
    """A viewer for browsers: the ports of its page and of its recordings, and the process that serves them."""

    page_port: int
    data_port: int
    process: subprocess.Popen[bytes] | None = None

    @property
    def url(self) -> str:
        """The page that shows the recordings."""
        data = quote(f"rerun+http://{_LOOPBACK}:{self.data_port}/proxy", safe="")
        return f"http://{_LOOPBACK}:{self.page_port}/?url={data}"

    def wait(self) -> None:
        """Wait until the viewer ends."""
        if self.process is not None:
            self.process.wait()


def _refuse_taken(port: int) -> None:
    with socket.socket() as probe:
        if sys.platform != "win32":  # a port that was used a moment ago is free
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((_LOOPBACK, port))
        except (OSError, OverflowError) as error:
            raise ResultError(f"port {port} is taken or not allowed; choose another with --port") from error


def start_viewer() -> str:
    """Start a viewer that waits for a replay, reachable from this machine only; return its URL.

    Raises
    ------
    OmnievalError
        If the viewer cannot start, e.g. without a display.
    """
    with socket.socket() as probe:
        probe.bind((_LOOPBACK, 0))
        port = probe.getsockname()[1]
    with tempfile.TemporaryFile() as output:
        viewer = _launch(["--port", str(port), "--expect-data-soon", "--hide-welcome-screen"], output)
        deadline = time.monotonic() + _START_SECONDS
        while not _answers(_LOOPBACK, port):
            _let_fail(viewer, output, seconds=_POLL_SECONDS)
            if time.monotonic() > deadline:
                viewer.terminate()
                raise OmnievalError(f"the viewer did not answer within {_START_SECONDS:g} s; try it with: rerun")
    return f"rerun+http://{_LOOPBACK}:{port}/proxy"


def check_viewer(url: str) -> None:
    """Check that a viewer listens at `url`.

    Raises
    ------
    ResultError
        If the URL is not one of a viewer, or no program listens there.
    """
    parts = urlsplit(url)
    if parts.scheme not in {"rerun", "rerun+http", "rerun+https"} or not parts.hostname or parts.path != "/proxy":
        raise ResultError(f"{url!r} is not a viewer's URL; give one like rerun+http://127.0.0.1:9876/proxy")
    try:
        port = parts.port or _DEFAULT_PORT
    except ValueError as error:
        raise ResultError(f"{url!r} has no valid port: {error}") from error
    if not _answers(parts.hostname, port):
        raise ResultError(f"no viewer listens at {url}; start one with: rerun --bind 127.0.0.1 --port {port}")
    if parts.scheme != "rerun+https" and not _speaks_http2(parts.hostname, port):
        raise ResultError(f"the program at {url} is not a viewer; start one on another port with: rerun --port auto")


def check_recording(path: Path) -> int:
    """Return the number of steps in a recording.

    Raises
    ------
    ResultError
        If the file is missing, empty, cut off, or not a recording of omnieval.
    """
    if not path.is_file():
        raise ResultError(f"no recording at {path}; name an .rrd file")
    content = entities.LOG_DECISION
    try:
        with warnings.catch_warnings():
            # The recording of a killed run has no footer, which costs time but no step.
            warnings.simplefilter("ignore", RerunWarning)
            chunks = RrdReader(path).stream().filter(content=content, has_timeline=entities.STEP)
            steps = sum(chunk.num_rows for chunk in chunks)
    except (RuntimeError, ValueError) as error:
        reason = " ".join(str(error).split())
        raise ResultError(f"{path} is empty, cut off or no recording ({reason}); render it again") from error
    if steps == 0:
        raise ResultError(f"{path} holds no steps of omnieval; render it again")
    return steps


def _launch(arguments: Sequence[str], output: IO[bytes]) -> subprocess.Popen[bytes]:
    """Start the viewer in a session of its own; what it says goes to `output`, to explain a failed start."""
    try:
        viewer = subprocess.Popen(
            [str(_viewer_binary()), "--bind", _LOOPBACK, *arguments],
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=subprocess.STDOUT,
            env=os.environ | {"RERUN_APP_ONLY": "true", "NO_COLOR": "1"},
            **_of_its_own(),
        )
    except OSError as error:
        raise OmnievalError(f"cannot start the viewer: {error.strerror or error}; reinstall rerun-sdk") from error
    _LAUNCHED.append(viewer)
    return viewer


def _of_its_own() -> dict[str, Any]:
    """Return the options by which a process is not ended by the Ctrl-C that is meant for this one."""
    if sys.platform == "win32":
        return {"creationflags": subprocess.CREATE_NEW_PROCESS_GROUP}
    return {"start_new_session": True}


def _let_fail(viewer: subprocess.Popen[bytes], output: IO[bytes], *, seconds: float) -> None:
    """Give the viewer time to fail; raise OmnievalError if it does, caused by its last words."""
    try:
        code = viewer.wait(seconds)
    except subprocess.TimeoutExpired:
        return
    if code != 0:
        output.seek(0)
        said = output.read().decode(errors="replace").split("\n")
        last = next((line.strip() for line in reversed(said) if line.strip()), f"exit code {code}")
        raise OmnievalError(f"the viewer cannot start: {_why_no_window(code)}; {_INSTEAD}") from RuntimeError(last)


def _why_no_window(code: int) -> str:
    """Return why the viewer ended early, as far as one can tell; its own words are of places in its source code."""
    known = [f"{name} is {value}" for name in _DISPLAYS if (value := os.environ.get(name))]
    if sys.platform == "linux" and not known:
        return f"there is no display ({' and '.join(_DISPLAYS)} are not set)"
    place = f", {', '.join(known)}" if known else ""
    return f"it needs a display and a graphics driver (exit code {code}{place})"


def _viewer_binary() -> Path:
    """Return the viewer inside the wheel; the ``rerun`` console script is a shim that would stay in between."""
    package = importlib.util.find_spec("rerun_cli")
    if package is None or package.origin is None:
        raise OmnievalError("the viewer is not installed; reinstall rerun-sdk")
    folder = Path(package.origin).parent
    bundled = folder / "Rerun.app" / "Contents" / "MacOS" / "Rerun"
    if sys.platform == "darwin" and bundled.exists():
        return bundled
    return folder / ("rerun.exe" if sys.platform == "win32" else "rerun")


def _answers(host: str, port: int) -> bool:
    try:
        with socket.create_connection((host, port), timeout=2.0):
            return True
    except OSError:
        return False


def _speaks_http2(host: str, port: int) -> bool:
    """Whether a viewer answers; Rerun would wait for ever for any other program."""
    try:
        with socket.create_connection((host, port), timeout=2.0) as connection:
            connection.sendall(_HTTP2_GREETING)
            header = b""
            while len(header) < 4 and (more := connection.recv(4 - len(header))):
                header += more
    except OSError:
        return False
    return len(header) == 4 and header[3] == _SETTINGS_FRAME
