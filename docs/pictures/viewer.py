"""A picture of the Rerun viewer that shows a recording at a step, without a display.

The viewer of Rerun's wheel draws off screen here, for which it needs a Vulkan driver: with Debian,
``apt install libvulkan1 mesa-vulkan-drivers`` gives one that needs no graphics card.
"""

from __future__ import annotations

import importlib.util
import os
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import rerun.experimental

PATIENCE_S = 120.0
_POLL_S = 0.3
_STILL = 3
"""A picture is final when so many in a row are the same: nothing is loading or moving any more."""


def take_picture(recordings: Sequence[Path], step: int, *, size: tuple[int, int]) -> bytes:
    """Return a PNG of the viewer with recordings open, the last of them shown, its cursor at a step.

    Parameters
    ----------
    recordings
        Recordings of omnieval.
    step
        Where on the timeline ``step``.
    size
        Width and height of the window, pixels.

    Raises
    ------
    RuntimeError
        If the viewer cannot start.
    TimeoutError
        If it does not come to rest.
    """
    deadline = time.monotonic() + PATIENCE_S
    with _viewer(recordings, size) as (url, process):
        client = _connected(url, process, len(recordings), deadline)
        client.set_time("step", sequence=step, play_state="paused")
        return _settled(client, deadline)


@contextmanager
def _viewer(recordings: Sequence[Path], size: tuple[int, int]) -> Iterator[tuple[str, subprocess.Popen[bytes]]]:
    package = importlib.util.find_spec("rerun_cli")
    if package is None or package.origin is None:
        raise RuntimeError("the viewer is not installed; reinstall rerun-sdk")
    binary = Path(package.origin).parent / ("rerun.exe" if sys.platform == "win32" else "rerun")
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    command = [str(binary), "--headless", "--bind", "127.0.0.1", "--port", str(port), "--hide-welcome-screen"]
    window = ["--window-size", f"{size[0]}x{size[1]}"]
    with tempfile.TemporaryDirectory() as runtime:
        environment = {"XDG_RUNTIME_DIR": runtime} | os.environ | {"RERUN_APP_ONLY": "true"}
        process = subprocess.Popen(
            [*command, *window, *map(str, recordings)],
            env=environment,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        try:
            yield f"rerun+http://127.0.0.1:{port}/proxy", process
        finally:
            process.terminate()
            process.wait(PATIENCE_S)


def _connected(url: str, process: subprocess.Popen[bytes], recordings: int, deadline: float) -> Any:
    """Return a client of the viewer, as soon as all recordings are loaded."""
    client: Any = None
    while time.monotonic() < deadline:
        if process.poll() is not None:
            raise RuntimeError(f"the viewer has exited with {process.returncode}; does it have a Vulkan driver?")
        time.sleep(_POLL_S)
        try:
            client = client or rerun.experimental.ViewerClient.connect(url)
            state = client.get_state()
        except (RuntimeError, ConnectionError):  # it is not listening yet
            client = None
            continue
        if not state.loading and sum(bool(one.timelines) for one in state.recordings) >= recordings:
            return client
    raise TimeoutError(f"the viewer has not loaded the recordings within {PATIENCE_S:g} s")


def _settled(client: Any, deadline: float) -> bytes:
    """Return the picture that does not change any more."""
    last, same = b"", 0
    while time.monotonic() < deadline:
        picture: bytes = client.take_screenshot()
        same = same + 1 if picture == last else 1
        if same == _STILL:
            return picture
        last = picture
        time.sleep(_POLL_S)
    raise TimeoutError(f"the picture is still changing after {PATIENCE_S:g} s")
