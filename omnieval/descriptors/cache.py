"""Descriptions kept on disk, so that a second replay reads no image.

One SQLite file. A description is found by the digest of the image's bytes and of all else that determines it; the
digest of a file whose path, size and time of change are as before is not computed again. Every row carries a checksum,
so that a damaged one is computed again and never used. The cache is a convenience: when it cannot be read or written,
work goes on without it and `DescriptorCache.note` says why.
"""

from __future__ import annotations

import hashlib
import json
import sqlite3
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np

from omnieval.datasets.cachedir import cache_dir
from omnieval.descriptors.description import Description

_FORMAT = 1
_TABLES = """
CREATE TABLE IF NOT EXISTS files (path TEXT PRIMARY KEY, size INTEGER, mtime_ns INTEGER, digest TEXT) WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS descriptions (
    digest TEXT, key TEXT, cells INTEGER, position BLOB, orientation BLOB, checksum BLOB, PRIMARY KEY (digest, key)
);
"""
_BATCH = 64


def description_key(settings: dict[str, Any]) -> str:
    """Return the key of everything besides the image that determines a description."""
    text = json.dumps({"format": _FORMAT, **settings}, sort_keys=True)
    return hashlib.blake2b(text.encode(), digest_size=16).hexdigest()


def image_digest(data: bytes) -> str:
    """Return the digest of an image's bytes."""
    return hashlib.blake2b(data, digest_size=16).hexdigest()


class DescriptorCache:
    """The cache file, open; a context manager.

    Parameters
    ----------
    path
        The SQLite file; default ``descriptors.sqlite`` in the cache folder.
    """

    def __init__(self, path: Path | None = None) -> None:
        self.path = path or cache_dir() / "descriptors.sqlite"
        self.hits = 0
        self.misses = 0
        self.note: str | None = None
        self._unsaved = 0
        self._database = self._open()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def lookup(self, file: Path, key: str) -> tuple[str, Description] | None:
        """Return the digest and description of an image file, None if they are not known."""
        try:
            found = self._lookup(file, key)
        except sqlite3.Error as error:
            self._give_up(error)
            found = None
        if found is None:
            self.misses += 1
        else:
            self.hits += 1
        return found

    def store(self, file: Path, key: str, digest: str, description: Description) -> None:
        """Keep the description of an image file whose bytes have this digest."""
        if self._database is None:
            return
        position = description.position.astype("<f4").tobytes()
        orientation = description.orientation.astype("<f4").tobytes()
        row = (digest, key, len(description.orientation), position, orientation, _checksum(position, orientation))
        try:
            status = file.stat()
            self._database.execute(
                "INSERT OR REPLACE INTO files VALUES (?, ?, ?, ?)",
                (str(file.absolute()), status.st_size, status.st_mtime_ns, digest),
            )
            self._database.execute("INSERT OR REPLACE INTO descriptions VALUES (?, ?, ?, ?, ?, ?)", row)
            self._unsaved += 1
        except (sqlite3.Error, OSError) as error:
            self._give_up(error)
        if self._unsaved >= _BATCH:
            self.save()

    def save(self) -> None:
        """Write what is pending."""
        self._unsaved = 0
        if self._database is None:
            return
        try:
            self._database.commit()
        except sqlite3.Error as error:
            self._give_up(error)

    def close(self) -> None:
        """Write what is pending and close the file."""
        self.save()
        if self._database is not None:
            self._database.close()
            self._database = None

    def _lookup(self, file: Path, key: str) -> tuple[str, Description] | None:
        if self._database is None:
            return None
        try:
            status = file.stat()
        except OSError:
            return None  # whoever reads the image will say what is wrong with it
        known = self._database.execute(
            "SELECT digest FROM files WHERE path = ? AND size = ? AND mtime_ns = ?",
            (str(file.absolute()), status.st_size, status.st_mtime_ns),
        ).fetchone()
        if known is None:
            return None
        row = self._database.execute(
            "SELECT cells, position, orientation, checksum FROM descriptions WHERE digest = ? AND key = ?",
            (known[0], key),
        ).fetchone()
        if row is None or _checksum(row[1], row[2]) != row[3]:
            return None
        cells, position, orientation, _ = row
        return known[0], Description(
            np.frombuffer(position, "<f4").astype(np.float32),
            np.frombuffer(orientation, "<f4").astype(np.float32).reshape(cells, -1),
        )

    def _open(self) -> sqlite3.Connection | None:
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            try:
                return self._connect()
            except sqlite3.DatabaseError as error:
                if isinstance(error, sqlite3.OperationalError):
                    raise
                # Not a database any more: put it aside for whoever wants to know why, and begin anew.
                self.path.replace(self.path.with_suffix(".damaged"))
                return self._connect()
        except (sqlite3.Error, OSError) as error:
            self.note = f"no descriptor cache: {error}"
            return None

    def _connect(self) -> sqlite3.Connection:
        database = sqlite3.connect(self.path, timeout=30.0, check_same_thread=False)
        database.execute("PRAGMA journal_mode = WAL")
        database.execute("PRAGMA synchronous = NORMAL")
        database.executescript(_TABLES)
        return database

    def _give_up(self, error: Exception) -> None:
        self.note = f"no descriptor cache: {error}"
        if self._database is not None:
            self._database.close()
            self._database = None


def _checksum(position: bytes, orientation: bytes) -> bytes:
    content = hashlib.blake2b(position, digest_size=8)
    content.update(orientation)
    return content.digest()
