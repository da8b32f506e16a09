"""Descriptions kept on disk, so that a second replay reads no image.

A description is found by the digest of the image's bytes and of all else that determines it, code included; the digest
of a file that the file system calls unchanged (`file_state`) is not computed again. Every description carries a
checksum, so that a damaged one is computed again and never used. The cache is a convenience: when it cannot be written,
what is there is read and work goes on; `DescriptorCache.note` says why.
"""

from __future__ import annotations

import hashlib
import os
import threading
from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from omnieval.datasets.cachedir import cache_dir, description_folder, note_folder
from omnieval.descriptors.description import DescribedFrame, Place
from omnieval.descriptors.notes import Notes
from omnieval.descriptors.shelf import Kept, Shelf
from omnieval.imaging.glance import file_state
from omnieval.source_code import digest_of, module_digest

_PANORAMA = ("omnieval.imaging.decode", "omnieval.imaging.unwrap", "omnieval.imaging.mask")
"""The modules that make a panorama of the bytes of an image."""
_DISTURBED = ("omnieval.imaging.disturb", "omnieval.seeding")
"""Those that change its pixels before, if they are to be changed."""
_BATCH = 64
"""Descriptions that are written at a time; a process that is killed loses no more."""
_GROUPS = 64
"""Into how many groups folders of images are divided, each with segments of its own."""


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
    """The cache folder, open; a context manager. Also a `Notebook` for what was seen of a camera. Threads may share it.

    Parameters
    ----------
    folder
        The cache folder; default the one in use. It is made when there is something to keep.

    Attributes
    ----------
    hits, misses
        How many images had a description and how many did not.
    note
        Why nothing is kept any more; None while all is well.
    """

    def __init__(self, folder: Path | None = None) -> None:
        self.folder = folder or cache_dir()
        self.hits = 0
        self.misses = 0
        self.note: str | None = None
        self._shelves: dict[str, Shelf] = {}
        self._notes = Notes(note_folder(self.folder))
        self._pending = 0
        self._closed = False
        self._lock = threading.RLock()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def lookup(self, file: Path, key: str) -> DescribedFrame | None:
        """Return the description of an image file, which is not read; None if it is not known (or not saved yet)."""
        try:
            state = file_state(file)
        except OSError:
            return None  # whoever reads the image will say what is wrong with it
        with self._lock:
            kept = None if self._closed else self._shelf(key).of_file(*_told(file, state))
            self.hits += kept is not None
        return _described(kept)

    def find(self, digest: str, key: str) -> DescribedFrame | None:
        """Return the description of the image whose bytes have this digest, whatever its file; None if not known."""
        with self._lock:
            kept = None if self._closed else self._shelf(key).of_image(bytes.fromhex(digest))
        return _described(kept)

    def store(self, file: Path, state: str, key: str, described: DescribedFrame) -> DescribedFrame:
        """Keep the description of an image file that `lookup` did not find, and return it with its place.

        Parameters
        ----------
        file
            The file.
        state
            The state (`file_state`) it had before it was read: one that was replaced meanwhile is not found by it.
        key
            See `description_key`.
        described
            The description. If it was found (`find`), only the file is noted.
        """
        with self._lock:
            self.hits += described.place is not None
            self.misses += described.place is None
            if self.note is not None or self._closed:
                return described
            shelf, image = self._shelf(key), bytes.fromhex(described.digest)
            at = *_told(file, state), image
            if described.place is None:
                described = replace(described, place=shelf.add(*at, described.description))
            else:
                shelf.link(*at, described.description)
            self._pending += 1
            if self._pending >= _BATCH:
                self.save()
        return described

    def holds(self, place: Place) -> bool:
        """Whether a description is on disk, and not only about to be written."""
        return self._shelf(Path(place.segment).parent.name).holds(place)

    def recall(self, key: str) -> dict[str, Any] | None:
        """See `omnieval.imaging.glance.Notebook`."""
        return self._notes.recall(key)

    def remember(self, key: str, value: dict[str, Any]) -> None:
        """See `omnieval.imaging.glance.Notebook`."""
        self._write(lambda: self._notes.remember(key, value))

    def save(self) -> None:
        """Write what is pending."""
        with self._lock:
            self._pending = 0
            for shelf in self._shelves.values():
                self._write(shelf.flush)

    def close(self) -> None:
        """Write what is pending and close all files; a thread that still looks ahead finds nothing from then on."""
        with self._lock:
            self.save()
            self._closed = True
            for shelf in self._shelves.values():
                shelf.close()

    def _shelf(self, key: str) -> Shelf:
        if key not in self._shelves:
            self._shelves[key] = Shelf(description_folder(self.folder) / key)
        return self._shelves[key]

    def _write(self, writing: Callable[[], object]) -> None:
        """Write, unless that has failed before."""
        if self.note is not None:
            return
        try:
            writing()
        except OSError as error:
            self.note = f"descriptor cache: nothing more is kept in {self.folder}: {error.strerror or error}"


def _described(kept: Kept | None) -> DescribedFrame | None:
    return None if kept is None else DescribedFrame(kept.description, kept.image.hex(), kept.place)


def _told(file: Path, state: str) -> tuple[str, bytes]:
    """Return the group of a file's folder, and what tells the file and its state; names need not be valid Unicode."""
    text = str(file if file.is_absolute() else file.absolute())
    name = text.encode("utf-8", "backslashreplace")
    group = _group(text.rpartition(os.sep)[0])
    return group, hashlib.blake2b(name + b"\0" + state.encode(), digest_size=16).digest()


@lru_cache(1024)
def _group(folder: str) -> str:
    name = folder.encode("utf-8", "backslashreplace")
    return f"{hashlib.blake2b(name, digest_size=1).digest()[0] % _GROUPS:02x}"
