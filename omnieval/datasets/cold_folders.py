"""Where the images of a COLD sequence lie, as people keep them.

As published::

    seq2_cloudy3/
      omni_cam/t1152904768.652404_x-1.511887_y1.036311_a1.348328.jpeg

A folder per room, as the authors of the paper keep their training sets::

    cloudy/
      1PO-A/t1152902971.600254_x-8.677760_y2.892667_a2.975968.jpeg
      2PO1-A/...

Or all of them in one folder. Each of these may be the only folder in the one that is named.
"""

from __future__ import annotations

import os
import re
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path, PurePath
from typing import Literal

from omnieval.datasets.findings import ROOT, Finding
from omnieval.datasets.scan import has_image_suffix, missing_folder, visible_names
from omnieval.wording import shown

OMNI_FOLDER = "omni_cam"
ENDING = ".jpeg"
KNOWN_LAYOUTS = (
    f"known layouts are {OMNI_FOLDER}/<images>, <ROOM>-<PART>/<images> for each room, and <images> in one folder, "
    "with names as in COLD"
)

_NAME = re.compile(r"t\d+\.\d{6}_x-?\d+\.\d{6}_y-?\d+\.\d{6}_a-?\d+\.\d{6}", re.ASCII)
_TIME = re.compile(r"t(\d{1,18})\.")
_ROOM_AND_PART = re.compile(r"[^\W_]+-[^\W_]+")
"""How COLD calls a room; `cold.scan_places` takes more for a label."""
_LONGEST_PAUSE_S = 600
"""A robot does not stand longer between two rooms: folders of other names that lie further apart are sequences."""

Layout = Literal["published", "rooms", "flat"]


@dataclass(frozen=True, slots=True)
class ImageFolders:
    """The folders that hold the images of one sequence, relative to its `root`, sorted; the root itself is empty."""

    root: Path
    layout: Layout
    folders: tuple[str, ...]


def find_images(path: Path) -> ImageFolders | Finding:
    """Return where the images of the sequence in `path`, or in its only folder, lie; or why there is no such."""
    fault = missing_folder(path)
    if fault:
        return fault
    if path.name == OMNI_FOLDER:
        return ImageFolders(path.parent, "published", (OMNI_FOLDER,))
    if (found := _sequence_at(path)) is not None:
        return found
    inside = [one for name in _subfolders(path) if (one := _sequence_at(path / name)) is not None]
    return inside[0] if len(inside) == 1 else _none(path, [one.root.name for one in inside])


def cold_stem(name: str) -> str:
    """Return the name of an image without its ending, which a conversion may have changed."""
    return PurePath(name).stem if has_image_suffix(name) else name


def _sequence_at(path: Path) -> ImageFolders | None:
    """Return the sequence that `path` itself is, None if it is none or holds several."""
    if (path / OMNI_FOLDER).is_dir():
        return ImageFolders(path, "published", (OMNI_FOLDER,))
    if _times(path):
        return ImageFolders(path, "flat", ("",))
    folders = _subfolders(path)
    if any((path / folder / OMNI_FOLDER).is_dir() for folder in folders):
        return None
    rooms = {folder: times for folder in folders if (times := _times(path / folder))}
    return None if not rooms or _are_sequences(rooms) else ImageFolders(path, "rooms", tuple(rooms))


def _are_sequences(times: dict[str, list[int]]) -> bool:
    """Tell whether folders are drives of their own rather than rooms of one, by their names and times (seconds)."""
    if len(times) < 2 or all(map(_ROOM_AND_PART.fullmatch, times)):
        return False
    seconds = sorted(time for of_folder in times.values() for time in of_folder)
    return any(later - earlier > _LONGEST_PAUSE_S for earlier, later in pairwise(seconds))


def _times(folder: Path) -> list[int]:
    """Return the times in the names of a folder's images, seconds; none unless most are named as in COLD."""
    images = [cold_stem(name) for name in visible_names(folder) if has_image_suffix(name)]
    named = [int(match[1]) for stem in images if _NAME.fullmatch(stem) and (match := _TIME.match(stem))]
    return named if 2 * len(named) > len(images) else []


def _subfolders(path: Path) -> list[str]:
    """Return the names of the folders in `path` that are not hidden, sorted."""
    try:
        with os.scandir(path) as entries:
            return sorted(entry.name for entry in entries if entry.is_dir() and not entry.name.startswith("."))
    except OSError:
        return []


def _none(path: Path, sequences: list[str]) -> Finding:
    if not visible_names(path):
        return Finding("error", "empty", ROOT, "the folder is empty; name the sequence folder of a COLD download")
    if not sequences and (apart := [name for name in _subfolders(path) if _times(path / name)]):
        sequences = apart
    if sequences:
        first = ", ".join(shown(name) for name in sequences[:3])
        more = ", ..." if len(sequences) > 3 else ""
        message = f"holds {len(sequences)} sequences ({first}{more}); name one of them"
        return Finding("error", "several-sequences", ROOT, message)
    message = f"no {OMNI_FOLDER} folder and no images named as in COLD; {KNOWN_LAYOUTS}"
    return Finding("error", "missing-omni-cam", ROOT, message)
