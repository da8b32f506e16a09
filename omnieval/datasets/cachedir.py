"""Where what can be computed again is kept, and how one process tells others that it uses a file of it."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import platformdirs

from omnieval.datasets.scan import canonical_path

if sys.platform != "win32":
    import fcntl

_HELD: dict[Path, int] = {}
"""The files that this process holds until it ends."""
_MOST_HELD = 128
"""More would use up the files that a process may have open; of others the age tells whether they are used."""


def cache_dir() -> Path:
    """Return the cache folder: ``OMNIEVAL_CACHE`` if set, else the user's cache folder. It may not exist yet."""
    override = os.environ.get("OMNIEVAL_CACHE")
    return canonical_path(override or platformdirs.user_cache_dir("omnieval", appauthor=False))


def stream_folder(cache: Path) -> Path:
    """Return the folder within a cache that holds the images of videos and bags."""
    return cache / "streams"


def synthetic_folder(cache: Path) -> Path:
    """Return the folder within a cache that holds rendered sequences."""
    return cache / "synthetic"


def description_folder(cache: Path) -> Path:
    """Return the folder within a cache that holds descriptions."""
    return cache / "descriptions"


def note_folder(cache: Path) -> Path:
    """Return the folder within a cache that holds what was seen of sequences."""
    return cache / "notes"


def hold(descriptor: int) -> bool:
    """Tell other processes that an open file is used, while it stays open. Where there are no locks, none is taken.

    No process ever waits for it: it only keeps `unused` from saying that the file may go.

    Returns
    -------
    bool
        Whether it may be used: not if another process is about to remove it.
    """
    if sys.platform != "win32":
        try:
            fcntl.flock(descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
        except OSError:
            return True
    return True


def hold_for_good(file: Path) -> bool:
    """Hold a file until this process ends; say whether it is there and may be used (`hold`)."""
    if file in _HELD:
        return file.exists()
    try:
        descriptor = os.open(file, os.O_RDONLY)
    except OSError:
        return False
    if not hold(descriptor):
        os.close(descriptor)
        return False
    if len(_HELD) >= _MOST_HELD:
        os.close(descriptor)
    else:
        _HELD[file] = descriptor
    return file.exists()


@contextmanager
def unused(file: Path) -> Iterator[bool | None]:
    """Say whether no process holds a file (`hold`), and keep it so within the block; None where that is not known."""
    if sys.platform == "win32":
        yield None
        return
    try:
        stream = file.open("rb+")
    except OSError:
        yield None
        return
    with stream:
        try:
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            answer: bool | None = False
        except OSError:  # a file system without locks
            answer = None
        else:
            answer = True
        yield answer
