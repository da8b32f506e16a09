"""Many small segments made one, so that a sequence that grows day by day does not become a thousand files."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import ExitStack, suppress
from pathlib import Path

from omnieval.datasets.cachedir import unused
from omnieval.descriptors.segments import ENDINGS, LINK, POSITION, Filler, Segment, Shape, file_of

MANY = 32
"""Small segments of one group, before they are merged."""
_SMALL_BYTES = 4_000_000


def merge(new: Path, names: list[str]) -> bool:
    """Write what small segments hold into new ones and remove them, if there are many and no process uses them.

    Whoever is killed meanwhile leaves some images twice, which does no harm; whoever had read an index that is gone
    looks for the new one.

    Parameters
    ----------
    new
        Path of the new segment, without ending, in the same folder; those of further shapes have a number behind it.
    names
        Of the segments of a group, the newest last.

    Returns
    -------
    bool
        Whether it was done.
    """
    folder = new.parent
    with ExitStack() as held:
        small = [folder / name for name in names if _is_small(folder / name)]
        if len(small) < MANY:
            return False
        free = [segment for segment in small if held.enter_context(unused(file_of(segment, POSITION)))]
        fillers: dict[Shape, Filler] = {}
        copied: set[bytes] = set()
        try:
            for segment in free:
                _copy(Segment(segment, folder.name), new, fillers, copied)
            for filler in fillers.values():
                filler.flush()
        except OSError:  # a disk that is full: what was there stays as it is
            free = []
            _remove(filler.path for filler in fillers.values())
        finally:
            for filler in fillers.values():
                filler.close()
        _remove(free)
    return bool(free)


def _remove(segments: Iterable[Path]) -> None:
    for path in (file_of(segment, ending) for segment in segments for ending in reversed(ENDINGS)):
        with suppress(OSError):
            path.unlink()


def _is_small(segment: Path) -> bool:
    try:
        return sum(file_of(segment, ending).stat().st_size for ending in ENDINGS) <= _SMALL_BYTES
    except OSError:
        return False


def _copy(segment: Segment, new: Path, fillers: dict[Shape, Filler], copied: set[bytes]) -> None:
    """Have each image of a segment kept once in the filler of its shape, but for what is damaged."""
    entries = segment.news()
    shape = segment.shape
    if shape is None:
        return
    if shape not in fillers:
        path = new.with_name(f"{new.name}-{len(fillers)}") if fillers else new
        fillers[shape] = Filler(path, new.parent.name, shape)
    filler = fillers[shape]
    for entry in entries:
        if entry.row == LINK:
            if segment.vouches(entry):
                filler.link(entry.file, entry.image)
        elif (description := segment.description(entry)) is not None:
            if entry.image in copied:
                filler.link(entry.file, entry.image)
            else:
                filler.add(entry.file, entry.image, description)
                copied.add(entry.image)
    segment.close()
