"""The state of the descriptor cache, for people who look for a fault. Looking changes nothing."""

from __future__ import annotations

import os
import sqlite3
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote

from omnieval.datasets.cachedir import cache_dir, stream_folder
from omnieval.datasets.scan import visible_names
from omnieval.descriptors.cache import DATABASE


@dataclass(frozen=True)
class CacheState:
    """The cache folder as it is.

    Attributes
    ----------
    folder
        Where it is; it need not exist.
    writable
        Whether it, or the nearest folder above it that exists, can be written.
    bytes
        Size of all in it: descriptions, rendered sequences, images of videos and bags.
    streams, stream_bytes
        How many folders hold what was taken from videos and bags, and their size.
    descriptions
        How many descriptions are kept; None if they cannot be counted.
    integrity
        ``ok``, ``empty`` when there is none yet, or what is wrong with the database.
    """

    folder: Path
    writable: bool
    bytes: int
    streams: int
    stream_bytes: int
    descriptions: int | None
    integrity: str


def cache_state(folder: Path | None = None) -> CacheState:
    """Return the state of a cache folder; default the one in use."""
    folder = folder or cache_dir()
    descriptions, integrity = _inspect(folder / DATABASE)
    streams = stream_folder(folder)
    count = len(visible_names(streams))
    return CacheState(folder, _writable(folder), _size(folder), count, _size(streams), descriptions, integrity)


def _inspect(database: Path) -> tuple[int | None, str]:
    if not database.exists():
        return 0, "empty"
    try:
        connection = sqlite3.connect(f"file:{quote(str(database.absolute()))}?mode=ro", uri=True)
    except sqlite3.Error as error:
        return None, str(error)
    try:
        found = connection.execute("PRAGMA quick_check(1)").fetchone()[0]
        return connection.execute("SELECT count(*) FROM descriptions").fetchone()[0], str(found)
    except (sqlite3.Error, UnicodeDecodeError) as error:  # the latter when SQLite quotes damaged text
        return None, str(error)
    finally:
        connection.close()


def _writable(folder: Path) -> bool:
    nearest = next((path for path in (folder, *folder.absolute().parents) if path.exists()), folder)
    return nearest.is_dir() and os.access(nearest, os.W_OK | os.X_OK)


def _size(folder: Path) -> int:
    total = 0
    for directory, _, files in os.walk(folder):
        for name in files:
            try:
                total += (Path(directory) / name).lstat().st_size
            except OSError:
                continue  # gone since it was listed: another process uses the cache
    return total
