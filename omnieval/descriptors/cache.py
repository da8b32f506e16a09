"""Descriptions kept on disk, so that a second replay reads no image.

One SQLite file. A description is found by the digest of the image's bytes and of all else that determines it, code
included; the digest of a file that the file system calls unchanged (`file_state`) is not computed again. Every row
carries a checksum, so that a damaged one is computed again and never used. The cache is a convenience: when it cannot
be read or written, work goes on without it and `DescriptorCache.note` says why.
"""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np

from omnieval.datasets.cachedir import cache_dir
from omnieval.descriptors.database import SpareDatabase
from omnieval.descriptors.description import Description
from omnieval.imaging.glance import file_state
from omnieval.source_code import digest_of, module_digest

DATABASE = "descriptors-3.sqlite"
"""Name of the file within the cache folder; the number is that of its tables."""
_PANORAMA = ("omnieval.imaging.decode", "omnieval.imaging.unwrap", "omnieval.imaging.mask")
"""The modules that make a panorama of the bytes of an image."""
_DISTURBED = ("omnieval.imaging.disturb", "omnieval.seeding")
"""Those that change its pixels before, if they are to be changed."""
_TABLES = """
CREATE TABLE IF NOT EXISTS files (path TEXT PRIMARY KEY, state TEXT, digest TEXT) WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS descriptions (
    digest TEXT, key TEXT, cells INTEGER, position BLOB, orientation BLOB, checksum BLOB, PRIMARY KEY (digest, key)
);
CREATE TABLE IF NOT EXISTS notes (key TEXT PRIMARY KEY, value TEXT, checksum BLOB) WITHOUT ROWID;
"""


def description_key(camera: dict[str, Any], descriptor: dict[str, Any], bits: int | None = None) -> str:
    """Return the key of everything besides the image that determines a description.

    Parameters
    ----------
    camera
        Settings of the camera model; the code that decodes and unwraps is added.
    descriptor
        The descriptor's identity, its code included.
    bits
        How many of 16 bits a channel the images use, None if they have fewer.
    """
    modules = (*_PANORAMA, *(_DISTURBED if "disturbance" in camera else ()))
    code = [module_digest(module) for module in modules]
    depth = {} if bits is None else {"bits": bits}
    return digest_of({"camera": camera, "panorama": code, "descriptor": descriptor, **depth})


def image_digest(data: bytes) -> str:
    """Return the digest of an image's bytes."""
    return hashlib.blake2b(data, digest_size=16).hexdigest()


class DescriptorCache:
    """The cache file, open; a context manager. Also a `Notebook` for what was seen of a camera.

    Parameters
    ----------
    path
        The SQLite file; default `DATABASE` in the cache folder.

    Attributes
    ----------
    hits, misses
        How many lookups found a description and how many did not.
    """

    def __init__(self, path: Path | None = None) -> None:
        self.path = path or cache_dir() / DATABASE
        self.hits = 0
        self.misses = 0
        self._database = SpareDatabase(self.path, _TABLES)

    @property
    def note(self) -> str | None:
        """Why there is no cache, or what was done about a damaged one; None while all is well."""
        return f"descriptor cache: {self._database.note}" if self._database.note else None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def lookup(self, file: Path, key: str) -> tuple[str, Description] | None:
        """Return the digest and description of an image file, None if they are not known (or not saved yet)."""
        found = self._lookup(file, key)
        if found is None:
            self.misses += 1
        else:
            self.hits += 1
        return found

    def store(self, file: Path, state: str, key: str, digest: str, description: Description) -> None:
        """Keep the description of an image file whose bytes have this digest.

        `state` is the file's (`file_state`) before it was read: one that was replaced meanwhile is not found by it.
        """
        cells = len(description.orientation)
        position = description.position.astype("<f4").tobytes()
        orientation = description.orientation.astype("<f4").tobytes()
        self._database.write(
            "INSERT OR REPLACE INTO files VALUES (?, ?, ?)",
            (_text(file), state, digest),
        )
        self._database.write(
            "INSERT OR REPLACE INTO descriptions VALUES (?, ?, ?, ?, ?, ?)",
            (digest, key, cells, position, orientation, _checksum(digest, key, cells, position, orientation)),
        )

    def recall(self, key: str) -> dict[str, Any] | None:
        """See `omnieval.imaging.glance.Notebook`."""
        row = self._database.find("SELECT value, checksum FROM notes WHERE key = ?", (key,))
        if row is None or _checksum(key, row[0]) != row[1]:
            return None
        value: dict[str, Any] = json.loads(row[0])
        return value

    def remember(self, key: str, value: dict[str, Any]) -> None:
        """See `omnieval.imaging.glance.Notebook`."""
        text = json.dumps(value)
        self._database.write("INSERT OR REPLACE INTO notes VALUES (?, ?, ?)", (key, text, _checksum(key, text)))

    def save(self) -> None:
        """Write what is pending."""
        self._database.save()

    def close(self) -> None:
        """Write what is pending and close the file."""
        self._database.close()

    def _lookup(self, file: Path, key: str) -> tuple[str, Description] | None:
        try:
            state = file_state(file)
        except OSError:
            return None  # whoever reads the image will say what is wrong with it
        known = self._database.find(
            "SELECT digest FROM files WHERE path = ? AND state = ?",
            (_text(file), state),
        )
        if known is None:
            return None
        digest = known[0]
        row = self._database.find(
            "SELECT cells, position, orientation, checksum FROM descriptions WHERE digest = ? AND key = ?",
            (digest, key),
        )
        if row is None or _checksum(digest, key, *row[:3]) != row[3]:
            return None
        cells, position, orientation, _ = row
        return digest, Description(
            np.frombuffer(position, "<f4").astype(np.float32),
            np.frombuffer(orientation, "<f4").astype(np.float32).reshape(cells, -1),
        )


def _text(file: Path) -> str:
    """Name a file in the database; file names need not be valid Unicode."""
    return str(file.absolute()).encode("utf-8", "backslashreplace").decode()


def _checksum(*values: object) -> bytes:
    """Return a checksum of a row, whatever types damage may have given its values."""
    content = hashlib.blake2b(digest_size=8)
    for value in values:
        field = value if isinstance(value, bytes) else repr(value).encode("utf-8", "backslashreplace")
        content.update(len(field).to_bytes(8, "little"))
        content.update(field)
    return content.digest()
