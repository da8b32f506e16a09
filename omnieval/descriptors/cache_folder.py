"""The cache folder as a whole: what is in it, by kind, and removing what has not been used for long or is too much.

Looking changes nothing, not even when a file was last read; removing never touches what a process holds
(`datasets.cachedir.hold`).
"""

from __future__ import annotations

import os
import shutil
import time
from collections.abc import Iterable, Iterator
from contextlib import nullcontext, suppress
from dataclasses import dataclass, field
from pathlib import Path

from omnieval.datasets.cachedir import (
    cache_dir,
    description_folder,
    note_folder,
    stream_folder,
    synthetic_folder,
    unused,
)
from omnieval.datasets.scan import visible_names
from omnieval.datasets.streams.store import INDEX as STREAM_INDEX
from omnieval.datasets.synthetic.write import OUTLINES
from omnieval.descriptors.segments import ENDINGS, INDEX, POSITION, file_of, rows_of

DESCRIPTIONS, NOTES, STREAMS, SYNTHETIC, PAIRS = "descriptions", "notes", "streams", "synthetic", "pairs"
DRAFTS, LEFT, OLD, OTHER = "drafts", "left over", "of older versions", "other"
KINDS = {
    DESCRIPTIONS: "descriptors of images, in segments",
    NOTES: "what was seen of sequences: sizes, mirrors, faults",
    STREAMS: "images of videos and bags",
    SYNTHETIC: "rendered sequences",
    PAIRS: "recordings of two runs side by side",
    DRAFTS: "being written by other processes: never removed",
    LEFT: "of processes that were killed, and damaged segments: nothing reads it",
    OLD: "descriptors of older versions: nothing reads them",
    OTHER: "not of omnieval: never removed",
}
"""The kinds of things in it, in the order in which they are listed."""
_USELESS, _NOT_OURS = {LEFT, OLD}, {DRAFTS, OTHER}
_DAY_S = 86_400.0
_OLD = ("descriptors*.sqlite*", "descriptors*.damaged*")


@dataclass(frozen=True)
class Item:
    """What is kept or removed as one.

    Attributes
    ----------
    kind
        One of `KINDS`.
    paths
        Its files or folders.
    bytes
        Its size.
    used
        When it was last written or, as far as the file system notes that, read; seconds since 1970.
    count
        Of a segment its descriptions, else 1.
    guard
        The file that is held by whoever uses it; None if nobody holds such.
    """

    kind: str
    paths: tuple[Path, ...]
    bytes: int
    used: float
    count: int = 1
    guard: Path | None = None


@dataclass(frozen=True)
class KindState:
    """How much there is of a kind: how many things, and their size."""

    count: int
    bytes: int


@dataclass(frozen=True)
class CacheState:
    """The cache folder as it is.

    Attributes
    ----------
    folder
        Where it is; it need not exist.
    writable
        Whether it, or the nearest folder above it that exists, can be written.
    items
        What is in it.
    """

    folder: Path
    writable: bool
    items: tuple[Item, ...]

    @property
    def bytes(self) -> int:
        """Size of all in it."""
        return sum(item.bytes for item in self.items)

    def of(self, kind: str) -> KindState:
        """How much there is of a kind."""
        some = [item for item in self.items if item.kind == kind]
        return KindState(sum(item.count for item in some), sum(item.bytes for item in some))

    @property
    def segments(self) -> int:
        """In how many segments the descriptions are."""
        return sum(item.kind == DESCRIPTIONS for item in self.items)

    @property
    def sets(self) -> int:
        """For how many ways to describe an image there are descriptions: camera, descriptor, settings, code."""
        return len({item.paths[0].parent for item in self.items if item.kind == DESCRIPTIONS})

    @property
    def integrity(self) -> str:
        """``ok``, ``empty`` when nothing is described yet, or what is wrong."""
        damaged = sum(item.kind == LEFT and len(item.paths) == len(ENDINGS) for item in self.items)
        if damaged:
            return f"{damaged} of {self.segments + damaged} segments damaged: what they lack is described again"
        return "ok" if self.segments else "empty"


@dataclass
class Pruned:
    """What was removed, or would be; and what was to be but is in use."""

    removed: list[Item] = field(default_factory=list)
    in_use: list[Item] = field(default_factory=list)
    bytes_left: int = 0


def cache_state(folder: Path | None = None) -> CacheState:
    """Return the state of a cache folder; default the one in use."""
    folder = folder or cache_dir()
    return CacheState(folder, _writable(folder), tuple(_items(folder)))


def prune(
    folder: Path | None = None, *, older_s: float | None = None, most_bytes: int | None = None, dry: bool = False
) -> Pruned:
    """Remove what nothing reads any more, what was not used for long, and then what was not used for longest.

    What is in use stays: what a process holds and, where the file system has no locks, what was used within a day.

    Parameters
    ----------
    folder
        The cache folder; default the one in use.
    older_s
        Remove what was last used longer ago, seconds.
    most_bytes
        Remove until no more is left.
    dry
        Only say what would be removed.
    """
    state = cache_state(folder)
    now, pruned = time.time(), Pruned(bytes_left=state.bytes)
    for item in sorted(state.items, key=lambda item: (item.kind not in _USELESS, item.used)):
        too_old = older_s is not None and now - item.used > older_s
        too_much = most_bytes is not None and pruned.bytes_left > most_bytes
        if item.kind in _NOT_OURS or not (item.kind in _USELESS or too_old or too_much):
            continue
        if _remove(item, now, dry=dry):
            pruned.removed.append(item)
            pruned.bytes_left -= item.bytes
        else:
            pruned.in_use.append(item)
    if not dry:
        for path in description_folder(state.folder).glob("*"):
            with suppress(OSError):  # it is not empty
                path.rmdir()
    return pruned


def _remove(item: Item, now: float, *, dry: bool) -> bool:
    """Remove an item unless it is in use; say whether it is gone, or would be."""
    with nullcontext(None) if item.guard is None else unused(item.guard) as free:
        sure = free or (free is None and (now - item.used > _DAY_S or item.guard is None))
        if not sure or dry:
            return sure
        # An index goes first: rows without one are not looked for.
        for path in reversed(item.paths):
            if path.is_dir() and not path.is_symlink():
                shutil.rmtree(path, ignore_errors=True)
            else:
                with suppress(OSError):
                    path.unlink()
    return not any(map(os.path.lexists, item.paths))


def _items(folder: Path) -> Iterator[Item]:
    known = {path.name for path in (description_folder(folder), note_folder(folder))}
    yield from _segments(description_folder(folder))
    for path in sorted(_inside(note_folder(folder))):
        yield _item(NOTES, path)
    for kind, place, guard in (
        (STREAMS, stream_folder(folder), STREAM_INDEX),
        (SYNTHETIC, synthetic_folder(folder), OUTLINES),
    ):
        known.add(place.name)
        for path in sorted(_inside(place)):
            if path.suffix != ".lock":  # whoever waits for one would wait for another than the next
                yield _item(kind, path, path / guard)
    old = {path for pattern in _OLD for path in folder.glob(pattern)}
    for path in sorted(_inside(folder)):
        if path.name not in known:
            pair = path.name.startswith("side-by-side-")
            yield _item(OLD if path in old else PAIRS if pair else OTHER, path)


def _segments(folder: Path) -> Iterator[Item]:
    for key in visible_names(folder):
        names = {path.name.rpartition(".")[0] for path in _inside(folder / key) if path.suffix in ENDINGS}
        for name in sorted(names):
            segment = folder / key / name
            paths = tuple(path for path in (file_of(segment, ending) for ending in ENDINGS) if os.path.lexists(path))
            count = rows_of(segment) if file_of(segment, INDEX) in paths else None
            size, used = _measured(paths)
            kind = LEFT if count is None else DESCRIPTIONS
            yield Item(kind, paths, size, used, 1 if count is None else count, file_of(segment, POSITION))


def _item(kind: str, path: Path, guard: Path | None = None) -> Item:
    size, used = _measured([path])
    if path.name.startswith("."):
        kind = LEFT if time.time() - used > _DAY_S else DRAFTS
    return Item(kind, (path,), size, used, guard=guard if guard is not None and guard.exists() else None)


def _measured(paths: Iterable[Path]) -> tuple[int, float]:
    """Return the size of files and folders with all in them, and when any of it was last used."""
    size, used = 0, 0.0
    for top in paths:
        below = (Path(directory) / name for directory, _, files in os.walk(top) for name in files)
        for path in (top, *below) if not top.is_dir() else below:
            try:
                status = path.lstat()
            except OSError:
                continue  # gone since it was listed: another process uses the cache
            size += status.st_size
            used = max(used, status.st_mtime, status.st_atime)
    return size, used


def _inside(folder: Path) -> list[Path]:
    try:
        return list(folder.iterdir())
    except OSError:
        return []


def _writable(folder: Path) -> bool:
    nearest = next((path for path in (folder, *folder.absolute().parents) if path.exists()), folder)
    return nearest.is_dir() and os.access(nearest, os.W_OK | os.X_OK)
