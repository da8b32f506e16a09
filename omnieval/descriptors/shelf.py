"""All descriptions of one key: the union of the segments in a folder, whoever filled them, while others fill theirs."""

from __future__ import annotations

import secrets
import time
from pathlib import Path
from typing import NamedTuple

from omnieval.descriptors.description import Description, Place
from omnieval.descriptors.merging import merge
from omnieval.descriptors.segments import INDEX, LINK, Entry, Filler, Segment, SegmentsOfImages, Shape

_MOST_OPEN = 32
"""Segments that are kept open for reading, two files each."""


class Kept(NamedTuple):
    """A description that was found: the digest of its image's bytes, itself, and where it is kept."""

    image: bytes
    description: Description
    place: Place


class Shelf:
    """The segments of a key. Nothing is written, no folder made, before there is something to keep.

    A segment belongs to a group of folders of images, with whose name its own begins: of a store of many sequences only
    the indices of a part are read. Where the newest of entries for one file or image counts, the names say which it is.

    Parameters
    ----------
    folder
        Called like the key; it need not exist.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._segments: dict[str, Segment] = {}
        self._files: dict[bytes, tuple[Segment, Entry]] = {}
        self._images: dict[bytes, tuple[Segment, Entry]] = {}
        self._groups: set[str] = set()
        self._elsewhere: SegmentsOfImages | None = None
        self._stale = False
        self._fillers: dict[tuple[str, Shape], Filler] = {}

    def of_file(self, group: str, file: bytes) -> Kept | None:
        """Return what is kept for a file, given by what tells it and its state; None if there is nothing, or damage."""
        self._learn(group)
        found = self._files.get(file)
        if found is not None and found[1].row == LINK:
            return self.of_image(found[1].image) if found[0].vouches(found[1]) else None
        return self._read(self._files, file)

    def of_image(self, image: bytes) -> Kept | None:
        """Return what is kept for an image, given by the digest of its bytes; None if there is nothing, or damage."""
        if image not in self._images:
            self._elsewhere = self._elsewhere or SegmentsOfImages(
                self._folder / name for name in self._listed() if _group_of(name) not in self._groups
            )
            for name in self._elsewhere.of(image):
                self._learn(_group_of(name))
        return self._read(self._images, image)

    def add(self, group: str, file: bytes, image: bytes, description: Description) -> Place | None:
        """Have a description kept with the next `flush` and return where; None if it cannot be."""
        shape = Shape.of(description)
        return None if shape is None else self._filler(group, shape).add(file, image, description)

    def link(self, group: str, file: bytes, image: bytes, like: Description) -> None:
        """Have it noted with the next `flush` that a file is an image whose description is kept."""
        if shape := Shape.of(like):
            self._filler(group, shape).link(file, image)

    def flush(self) -> None:
        """Write what is pending.

        Raises
        ------
        OSError
            If it cannot be written.
        """
        for filler in self._fillers.values():
            self._stale |= filler.flush()

    def holds(self, place: Place) -> bool:
        """Whether a description is on disk: one that was found is; one that was added is from its `flush` on."""
        own = next((filler for filler in self._fillers.values() if str(filler.path) == place.segment), None)
        return own is None or place.row < own.kept

    def close(self) -> None:
        """Close all files, and merge small segments if there are many; what is pending is not written."""
        for filler in self._fillers.values():
            filler.close()
        for segment in self._segments.values():
            segment.close()
        for group in {group for group, _ in self._fillers}:
            merge(self._folder / _new_name(group), [name for name in self._listed() if _group_of(name) == group])

    def _filler(self, group: str, shape: Shape) -> Filler:
        known = self._fillers.get((group, shape))
        if known is None:
            known = Filler(self._folder / _new_name(group), self._folder.name, shape)
            self._fillers[group, shape] = known
        return known

    def _read(self, known: dict[bytes, tuple[Segment, Entry]], sought: bytes) -> Kept | None:
        if sought not in known:
            return None
        kept = self._kept(*known[sought])
        gone = known[sought][0]
        if kept is None and gone.path.name in self._segments and not gone.exists:  # merged with others, or removed
            del self._segments[gone.path.name]
            self._refresh()
            kept = self._kept(*known[sought])
        return kept

    def _kept(self, segment: Segment, entry: Entry) -> Kept | None:
        if not segment.is_open and sum(one.is_open for one in self._segments.values()) >= _MOST_OPEN:
            for one in self._segments.values():
                one.close()
        description = segment.description(entry)
        return None if description is None else Kept(entry.image, description, Place(str(segment.path), entry.row))

    def _learn(self, group: str) -> None:
        """Read the indices of a group, as far as they are not known."""
        if group not in self._groups or self._stale:
            self._groups.add(group)
            self._refresh()

    def _refresh(self) -> None:
        """Read what is new in the indices of the groups that are known."""
        self._stale = False
        for name in self._listed():
            if _group_of(name) in self._groups:
                segment = self._segments.setdefault(name, Segment(self._folder / name, self._folder.name))
                self._take(segment, segment.news())

    def _take(self, segment: Segment, entries: list[Entry]) -> None:
        self._files.update((entry.file, (segment, entry)) for entry in entries)
        self._images.update((entry.image, (segment, entry)) for entry in entries if entry.row != LINK)

    def _listed(self) -> list[str]:
        try:
            names = [path.name for path in self._folder.iterdir()]
        except OSError:  # there is none yet, or it cannot be read: then nothing is known
            return []
        return sorted(name.removesuffix(INDEX) for name in names if name.endswith(INDEX))


def _new_name(group: str) -> str:
    return f"{group}-{time.time_ns():016x}-{secrets.token_hex(4)}"


def _group_of(name: str) -> str:
    return name.partition("-")[0]
