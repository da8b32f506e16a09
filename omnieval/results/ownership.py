"""Who writes a folder: one process at a time, and whether it still lives."""

from __future__ import annotations

import errno
import os
import platform
import sys
import weakref
from pathlib import Path
from typing import Any

if sys.platform != "win32":
    import fcntl

_PROC = Path("/proc")
_ENDED = "ended"
_TAKEN = frozenset({errno.EWOULDBLOCK, errno.EACCES})


class FolderTakenError(Exception):
    """Another writer holds the folder."""


class Hold:
    """The sole right to write a folder, until `release`, or until this process ends, however it ends.

    It is a lock on the folder itself: no lock file can stay behind, and no process id can be mistaken.

    Attributes
    ----------
    certain
        Whether the folder is locked; where the system or the file system has no such locks, ``run.json`` alone says
        who writes.

    Raises
    ------
    FolderTakenError
        If somebody else holds the folder.
    OSError
        If the folder cannot be opened.
    """

    def __init__(self, folder: Path) -> None:
        self.certain = False
        self._close = None
        if sys.platform == "win32":
            return
        descriptor = os.open(folder, os.O_RDONLY)
        self._close = weakref.finalize(self, os.close, descriptor)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            self.certain = True
        except OSError as error:
            if error.errno in _TAKEN:
                self.release()
                raise FolderTakenError(str(folder)) from error
            # Some network file systems lock no folders.

    def release(self) -> None:
        """Let others write. Calling it again does nothing."""
        if self._close:
            self._close()


def this_process() -> dict[str, Any]:
    """Return what tells this process from every other: its id, its machine, and when it was born."""
    return {"pid": os.getpid(), "host": platform.node(), "born": _born(os.getpid())}


def is_alive(process: dict[str, Any]) -> bool:
    """Whether a process of `this_process` still exists, as far as this machine can tell; if it cannot, it does."""
    pid = process.get("pid")
    if os.name != "posix" or process.get("host") != platform.node() or not isinstance(pid, int) or pid < 1:
        return True
    try:
        os.kill(pid, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except PermissionError:
        pass  # exists, of another user
    now, then = _born(pid), process.get("born")
    return now != _ENDED and (now is None or then is None or now == then)


def _born(pid: int) -> str | None:
    """Return the boot and the tick at which a process was born, which no later one with its id shares.

    None where the system does not say; `_ENDED` if it has ended and only waits for its parent to notice.
    """
    try:
        boot = (_PROC / "sys/kernel/random/boot_id").read_text("ascii").strip()
        fields = (_PROC / str(pid) / "stat").read_text("utf-8", "replace").rpartition(")")[2].split()
    except OSError:
        return None
    state, ticks = fields[0], fields[19]
    return _ENDED if state in {"Z", "X"} else f"{boot}/{ticks}"
