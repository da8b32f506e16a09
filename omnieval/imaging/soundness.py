"""Checks that all images of a sequence can be used, before the first is mapped, so that no replay stops midway."""

from __future__ import annotations

from collections.abc import Mapping
from collections.abc import Sequence as Frames
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass, replace
from pathlib import Path

from omnieval.cores import allotted
from omnieval.datasets.card_findings import size_findings
from omnieval.datasets.findings import Finding
from omnieval.datasets.image_findings import bits_of, image_findings
from omnieval.datasets.images import ImageReport, examine_image, inspect_image, usual_size, wrong_size
from omnieval.datasets.sequence import Sequence
from omnieval.errors import DatasetError
from omnieval.imaging.glance import Notebook, files_key
from omnieval.wording import shown

_MOST_NAMED = 3
_NOTE = "examined 1"
"""Key of what is remembered of images; its number is raised when the content changes."""


@dataclass(frozen=True, slots=True)
class BadImage:
    """An image that cannot be used: its name within the sequence, and what is wrong with it."""

    file: str
    reason: str


def examined(sequence: Sequence, notebook: Notebook | None = None) -> Sequence:
    """Return a sequence with what its images are: their findings, and the bits that they use.

    Files are read and mostly not decoded, which takes a small part of the time a replay does; they are not even read
    again as long as the notebook remembers what was found, and they are not changed.

    Raises
    ------
    DatasetError
        If an image is missing, empty, truncated, no image, or of another size than most: one line that names the first
        such image, counts the others, and says what to do.
    """
    try:
        key = files_key(f"{_NOTE} {sequence.expected_size}", sequence.frames)
    except DatasetError:
        key = None  # a file is not there, which is said below
    known = notebook.recall(key) if key is not None and notebook is not None else None
    if known is None:
        reports = {frame.path: examine_image(frame.path) for frame in sequence.frames}
        findings = image_findings(reports, sequence.root)
        findings += size_findings(usual_size(reports.values()), sequence.expected_size)
        if bad := _bad_images(reports):
            _refuse(bad, sequence)
        known = {"findings": list(map(asdict, findings)), "bits": bits_of(reports.values())}
        if key is not None and notebook is not None:
            notebook.remember(key, known)
    bits = known["bits"]
    return replace(
        sequence,
        frames=tuple(replace(frame, bits=bits) for frame in sequence.frames) if bits else sequence.frames,
        calibration=tuple(replace(frame, bits=bits) for frame in sequence.calibration),
        findings=(*sequence.findings, *(Finding(**finding) for finding in known["findings"])),
    )


def _refuse(bad: dict[Path, str], sequence: Sequence) -> None:
    first, message = next(iter(bad.items()))
    others = f" (and {len(bad) - 1} more bad images)" if len(bad) > 1 else ""
    raise DatasetError(
        f"image {shown(str(first))} {message}{others}; `omnieval dataset check {shown(sequence.source)}` lists "
        "all that is wrong, `omnieval replay --skip-bad` leaves such images out"
    )


def without_bad(sequence: Sequence) -> tuple[Sequence, tuple[BadImage, ...]]:
    """Return a sequence without the images that `examined` refuses, and these images.

    Every image is decoded for it, so that a fault that only the decoder notices is found too. The camera is
    estimated from sound images only.

    Raises
    ------
    DatasetError
        If no image is left.
    """
    asked = {frame.path: frame for frame in (*sequence.frames, *sequence.calibration)}
    with ThreadPoolExecutor(allotted()) as pool:
        bad = _bad_images(dict(zip(asked, pool.map(inspect_image, asked), strict=True)))
    frames = tuple(frame for frame in sequence.frames if frame.path not in bad)
    if not frames:
        raise DatasetError(
            f"{sequence.source}: all {len(sequence)} images are bad; "
            f"`omnieval dataset check {shown(sequence.source)}` says what is wrong with each"
        )
    calibration = tuple(frame for frame in sequence.calibration if frame.path not in bad)
    left_out = tuple(BadImage(frame.file, bad[frame.path]) for frame in sequence.frames if frame.path in bad)
    return replace(sequence, frames=frames, calibration=calibration), left_out


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


def _bad_images(reports: Mapping[Path, ImageReport]) -> dict[Path, str]:
    """Return what is wrong with each image that cannot be used, in their order."""
    usual = usual_size(reports.values())
    bad = {}
    for path, report in reports.items():
        if report.size is None:
            bad[path] = report.message
        elif usual is not None and report.size != usual:
            bad[path] = wrong_size(report.size, usual)
    return bad
