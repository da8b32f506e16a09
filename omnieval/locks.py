"""Locks between processes: on a folder or file itself where the system can do that, else on a file beside it.

A lock is held until it is released or its process ends, however it ends, so that none stays behind. Where
there is no fcntl, as on Windows, filelock stands in for it. Shared locks, which only prevent pruning, are those of
`datasets.cachedir`.
"""

from __future__ import annotations

import errno
import importlib.util
import logging
import os
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from types import TracebackType
from typing import Self

_LOCKS_ITSELF = importlib.util.find_spec("fcntl") is not None
_TAKEN = frozenset({errno.EWOULDBLOCK, errno.EACCES})
_LOG = logging.getLogger("omnieval")


def _nothing() -> None:
    """Release nothing."""


@dataclass(frozen=True)
class Lock:
    """A lock, which a ``with`` block releases.

    Attributes
    ----------
    certain
        Whether other processes are really kept out: some file systems have no locks.
    release
        Releases it; to be called once.
    """

    certain: bool = False
    release: Callable[[], None] = field(default=_nothing, repr=False)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.release()


def lock(path: Path, *, wait: bool = False) -> Lock:
    """Keep other processes that ask for the same lock out of a folder or file.

    Where the file system has no locks a warning of the logger ``omnieval`` says so.

    Parameters
    ----------
    path
        A folder or file that is there.
    wait
        Whether to wait while another process has the lock.

    Raises
    ------
    BlockingIOError
        If another process has it, and `wait` is false.
    OSError
        If the folder or file cannot be opened.
    """
    return _lock_itself(path, wait=wait) if _LOCKS_ITSELF else _lock_beside(path, wait=wait)


def kind_of_locks() -> str:
    """Return how this system locks, in words for a bug report."""
    return "on folders (flock)" if _LOCKS_ITSELF else "by files beside folders (filelock)"


def _lock_itself(path: Path, *, wait: bool) -> Lock:
    import fcntl

    descriptor = os.open(path, os.O_RDONLY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
    except OSError as error:
        os.close(descriptor)
        if error.errno in _TAKEN:
            raise BlockingIOError(errno.EWOULDBLOCK, "another process has the lock", str(path)) from error
        return _without(path)
    except BaseException:  # an interrupt while it waits
        os.close(descriptor)
        raise
    return Lock(certain=True, release=partial(os.close, descriptor))


def _lock_beside(path: Path, *, wait: bool) -> Lock:
    from filelock import FileLock, Timeout

    held = FileLock(path.absolute().with_name(f".{path.absolute().name}.lock"), thread_local=False)
    try:
        held.acquire(timeout=-1 if wait else 0)
    except Timeout as error:
        raise BlockingIOError(errno.EWOULDBLOCK, "another process has the lock", str(path)) from error
    except (OSError, NotImplementedError):
        return _without(path)
    return Lock(certain=True, release=held.release)


def _without(path: Path) -> Lock:
    _LOG.warning("%s: this file system has no locks; make sure that no other process writes there", path)
    return Lock()
