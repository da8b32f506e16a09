"""The file end of a recording, kept where Rerun cannot hang on it.

Rerun's own file writer stops at the first write error (a full disk, say), and then a flush, and even the end of
the process, may wait for it for ever. So Rerun writes into a pipe that is always read, and a failing file is an
error remembered here.
"""

from __future__ import annotations

import array
import os
import select
import sys
import threading
import time
from pathlib import Path

from omnieval.errors import ResultError
from omnieval.results.atomic import is_temporary, named

if sys.platform != "win32":
    import fcntl
    import termios

_BLOCK = 1 << 16
_POLL_SECONDS = 0.001
PIPES = Path("/dev/fd").is_dir()
"""Whether a pipe can be opened by name; where it cannot (Windows), Rerun writes the partial file itself."""


class PipedFile:
    """A file that receives what another writes to `address`.

    The bytes go to ``NAME.partial.rrd`` beside `path`, which `close` gives its name once all of them are on the
    disk: `path` appears whole or not at all, and a killed process leaves what was flushed, readable, in the
    partial file. What is temporary already (`atomic.replacing`) is written as it is.

    Raises
    ------
    ResultError
        If the file cannot be created.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.partial = path if is_temporary(path) else path.with_name(f"{path.stem}.partial{path.suffix}")
        self.error: OSError | None = None
        if path.is_dir():
            raise ResultError(f"cannot record to {path}: it is a folder; name a file")
        try:
            self._file = os.open(self.partial, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o666)
        except OSError as error:
            said = f"cannot record to {named(path)}: {error.strerror or error}"
            raise ResultError(f"{said}; choose a folder that exists and is writable") from error
        self._lock = threading.Lock()
        self._thread: threading.Thread | None = None
        self._read_end = self._write_end = -1
        if PIPES:
            self._read_end, self._write_end = os.pipe()
            self._thread = threading.Thread(target=self._drain, name="recording", daemon=True)
            self._thread.start()
        else:
            os.close(self._file)

    @property
    def address(self) -> str:
        """What to open for writing, once, and then call `opened`."""
        return f"/dev/fd/{self._write_end}" if self._thread is not None else str(self.partial)

    def opened(self) -> None:
        """Note that the writer has opened `address`: when it closes that, the file is complete."""
        if self._write_end >= 0:
            os.close(self._write_end)
            self._write_end = -1

    def settle(self) -> None:
        """Wait until all that was written to the pipe is in the file, where it survives this process."""
        while self._thread is not None and self._thread.is_alive():
            with self._lock:
                if not self._unread():
                    return
            time.sleep(_POLL_SECONDS)

    def close(self, *, keep: bool) -> None:
        """Wait for the last bytes, and give the file its name if it is to be kept and nothing failed."""
        self.opened()
        if self._thread is not None:
            self._thread.join()
        if keep and self.error is None:
            try:
                self.partial.replace(self.path)
            except OSError as error:
                self.error = error

    def _drain(self) -> None:
        try:
            while self._pass_on():
                pass
            self._sync()
        finally:
            os.close(self._read_end)
            os.close(self._file)

    def _pass_on(self) -> bool:
        """Move a block from the pipe to the file; False at the end."""
        select.select([self._read_end], [], [])  # wait outside the lock, which `settle` needs
        with self._lock:
            block = os.read(self._read_end, _BLOCK)
            self._write(block)
        return bool(block)

    def _unread(self) -> int:
        """Return the number of bytes waiting in the pipe."""
        count = array.array("i", [0])
        fcntl.ioctl(self._read_end, termios.FIONREAD, count)
        return count[0]

    def _write(self, block: bytes) -> None:
        """Write a block; after an error the pipe is still read, so that nobody waits for it."""
        rest = memoryview(block)
        while rest and self.error is None:
            try:
                rest = rest[os.write(self._file, rest) :]
            except OSError as error:
                self.error = error

    def _sync(self) -> None:
        try:
            os.fsync(self._file)
        except OSError as error:
            self.error = self.error or error
