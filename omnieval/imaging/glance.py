"""What only the images can tell about the camera: their size and, if need be, where the mirror lies.

What was seen once can be remembered, so that a second replay does not read the images again for it.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence as Frames
from dataclasses import asdict
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from omnieval.datasets.sequence import Frame, Sequence
from omnieval.errors import DatasetError
from omnieval.imaging.calibrate import MirrorEstimate, estimate_mirror, estimate_of
from omnieval.imaging.decode import decode_grey

_ESTIMATED_FROM = 32
"""Images to estimate the mirror from, spread over the calibration frames; more do not sharpen it."""
_COMPUTATION = 4
"""Version of the estimate: raised when its results change, so that remembered results of earlier ones are not used."""


class Notebook(Protocol):
    """Remembers small results between processes, or forgets them: both are right."""

    def recall(self, key: str) -> dict[str, Any] | None:
        """Return what was noted under a key, None if nothing is known."""
        ...

    def remember(self, key: str, value: dict[str, Any]) -> None:
        """Note plain values under a key."""
        ...


def image_size(sequence: Sequence, notebook: Notebook | None = None) -> tuple[int, int]:
    """Return (width, height) of a sequence's first image.

    Raises
    ------
    DatasetError
        If it cannot be read.
    """
    first = sequence.calibration[:1]
    key = files_key("size", first)
    known = notebook.recall(key) if notebook is not None else None
    if known is None:
        height, width = _grey(first[0]).shape
        known = {"width": width, "height": height}
        if notebook is not None:
            notebook.remember(key, known)
    return known["width"], known["height"]


def seen_mirror(sequence: Sequence, notebook: Notebook | None = None) -> MirrorEstimate:
    """Estimate the mirror from a sequence's calibration frames.

    The first frames decide alone if they differ enough and show a mirror, so that a sequence that grows keeps its
    camera. Otherwise, as for a robot that stands still at first, frames spread over the whole sequence do.

    Raises
    ------
    DatasetError
        If one of them cannot be read or has another size.
    """
    first, spread = (
        sequence.calibration[: sequence.FIRST_FRAMES],
        sequence.calibration[sequence.FIRST_FRAMES :],
    )
    estimate = _estimate(first, notebook)
    if spread and not (estimate.mirror is not None and estimate.moved and estimate.blind_spot_seen):
        wider = _estimate(spread, notebook)
        if wider.mirror is not None or estimate.mirror is None:
            return wider
    return estimate


def _estimate(calibration: Frames[Frame], notebook: Notebook | None) -> MirrorEstimate:
    count = len(calibration)
    chosen = sorted({round(index) for index in np.linspace(0, count - 1, min(count, _ESTIMATED_FROM))})
    frames = [calibration[index] for index in chosen]
    key = files_key("mirror", frames)
    known = notebook.recall(key) if notebook is not None else None
    if known is not None:
        return estimate_of(known)
    estimate = estimate_mirror(_equal_sized(frames))
    if notebook is not None:
        notebook.remember(key, asdict(estimate))
    return estimate


def _equal_sized(frames: Frames[Frame]) -> list[NDArray[np.uint8]]:
    images = [_grey(frame) for frame in frames]
    for frame, image in zip(frames, images, strict=True):
        if image.shape != images[0].shape:
            height, width = image.shape
            raise DatasetError(
                f"image {frame.path} is {width} x {height} pixels, the first one "
                f"{images[0].shape[1]} x {images[0].shape[0]}; remove or resize it"
            )
    return images


def _grey(frame: Frame) -> NDArray[np.uint8]:
    return decode_grey(frame.read(), str(frame.path), frame.bits)


def file_state(file: Path) -> str:
    """Return what changes with a file, without reading it.

    The time of the last change of the inode is part of it, which no copy that keeps size and time of modification
    (``cp -p``, rsync) can keep.

    Raises
    ------
    OSError
        If it is not there.
    """
    status = file.stat()
    return f"{status.st_size} {status.st_mtime_ns} {status.st_ctime_ns} {status.st_ino}"


def files_key(what: str, frames: Frames[Frame]) -> str:
    """Return a key under which to note `what` is seen of image files; it changes with any file, and reads none.

    Raises
    ------
    DatasetError
        If one of the files is not there.
    """
    files = []
    for frame in frames:
        try:
            state = file_state(frame.path)
        except OSError as error:
            raise DatasetError(f"cannot read image {frame.path}: {error.strerror or error}") from error
        files.append([str(frame.path.absolute()), state])
    text = json.dumps([what, _COMPUTATION, files])
    return hashlib.blake2b(text.encode(), digest_size=16).hexdigest()
