"""Are all images of a sequence fit for use? Found out before the first is mapped, so that no replay ends midway."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Iterable
from collections.abc import Sequence as Frames
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from omnieval.datasets.images import ImageReport, examine_image, inspect_image, usual_size, wrong_size
from omnieval.datasets.sequence import Frame, Sequence
from omnieval.errors import DatasetError
from omnieval.imaging.glance import Notebook, files_key
from omnieval.wording import shown

_MOST_NAMED = 3


@dataclass(frozen=True, slots=True)
class BadImage:
    """An image that cannot be used: its name within the sequence, and what is wrong with it."""

    file: str
    reason: str


def refuse_bad(sequence: Sequence, notebook: Notebook | None = None) -> None:
    """Refuse a sequence with an image that is missing, empty, truncated, no image, or of another size than most.

    Files are read and not decoded, which takes a small part of the time a replay does; those found sound are not even
    read again as long as the notebook remembers them and they are not changed.

    Raises
    ------
    DatasetError
        One line that names the first such image, counts the others, and says what to do.
    """
    try:
        key = files_key("sound", sequence.frames)
    except DatasetError:
        key = None  # a file is not there, which is said below
    if key is not None and notebook is not None and notebook.recall(key) is not None:
        return
    bad = _bad_images(sequence.frames, [examine_image(frame.path) for frame in sequence.frames])
    if bad:
        first, message = next(iter(bad.items()))
        others = f" (and {len(bad) - 1} more bad images)" if len(bad) > 1 else ""
        raise DatasetError(
            f"image {shown(str(first))} {message}{others}; `omnieval dataset check {shown(sequence.source)}` lists "
            "all that is wrong, `omnieval replay --skip-bad` leaves such images out"
        )
    if key is not None and notebook is not None:
        notebook.remember(key, {"sound": True})


def without_bad(sequence: Sequence) -> tuple[Sequence, tuple[BadImage, ...]]:
    """Return a sequence without the images that `refuse_bad` refuses, and these images.

    Every image is decoded for it, so that a fault that only the decoder notices is found too. The camera is
    estimated from sound images only.

    Raises
    ------
    DatasetError
        If no image is left.
    """
    asked = {frame.path: frame for frame in (*sequence.frames, *sequence.calibration)}
    with ThreadPoolExecutor(os.cpu_count() or 1) as pool:
        bad = _bad_images(asked.values(), pool.map(inspect_image, asked))
    frames = tuple(frame for frame in sequence.frames if frame.path not in bad)
    if not frames:
        raise DatasetError(
            f"{sequence.source}: all {len(sequence)} images are bad; "
            f"`omnieval dataset check {shown(sequence.source)}` says what is wrong with each"
        )
    calibration = tuple(frame for frame in sequence.calibration if frame.path not in bad)
    left_out = tuple(BadImage(frame.file, bad[frame.path]) for frame in sequence.frames if frame.path in bad)
    return dataclasses.replace(sequence, frames=frames, calibration=calibration), left_out


def in_words(left_out: Frames[BadImage], count: int) -> str:
    """Say in one line how many of `count` images were left out, and which (the first few).

    Examples
    --------
    >>> in_words([BadImage("image7.png", "has no bytes; copy it again")], 80)
    '1 of 80 images left out: image7.png has no bytes'
    """
    named = [f"{shown(bad.file)} {bad.reason.partition(';')[0]}" for bad in left_out[:_MOST_NAMED]]
    more = len(left_out) - len(named)
    listed = "; ".join([*named, f"and {more} more"] if more else named)
    return f"{len(left_out)} of {count} images left out{': ' if listed else ''}{listed}"


def _bad_images(frames: Iterable[Frame], reports: Iterable[ImageReport]) -> dict[Path, str]:
    """Return what is wrong with each image that cannot be used, in the order of the frames."""
    seen = [(frame.path, report) for frame, report in zip(frames, reports, strict=True)]
    usual = usual_size(report for _, report in seen)
    bad = {}
    for path, report in seen:
        if report.size is None:
            bad[path] = report.message
        elif usual is not None and report.size != usual:
            bad[path] = wrong_size(report.size, usual)
    return bad
