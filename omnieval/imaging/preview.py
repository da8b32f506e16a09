"""A picture of what is known of a camera, for people: the image with the mirror's circles, the panorama, and words."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from omnieval.datasets.sequence import Sequence as Frames
from omnieval.errors import ResultError
from omnieval.imaging.camera import CameraModel
from omnieval.imaging.circles import Circle
from omnieval.imaging.decode import decode_colour
from omnieval.imaging.survey import CameraSurvey

_GREEN, _ORANGE, _RED, _WHITE = (80, 220, 60), (0, 165, 255), (60, 60, 240), (240, 240, 240)
_WIDTH_PX = 960
_LINE_PX = 22
_SHIFT = 4
"""Bits of a pixel's fraction that OpenCV draws circles with."""


def write_preview(file: Path, sequence: Frames, survey: CameraSurvey) -> None:
    """Write the picture of a sequence's camera, on the image in the middle of the sequence.

    Raises
    ------
    DatasetError
        If that image cannot be read.
    ResultError
        If the picture cannot be written.
    """
    frame = sequence.frames[len(sequence.frames) // 2]
    image = decode_colour(frame.read(), str(frame.path))
    words = f"{sequence.source}: {frame.file}\n{survey.words}"
    picture = preview(image, survey.camera, words, survey.candidate)
    try:
        file.write_bytes(cv2.imencode(".png", picture)[1].tobytes())
    except OSError as error:
        raise ResultError(f"cannot write {file}: {error.strerror or error}; choose another --preview") from error


def preview(
    image: NDArray[np.uint8], camera: CameraModel | None, words: str, candidate: Circle | None = None
) -> NDArray[np.uint8]:
    """Return a picture, BGR, of a camera on one of its images.

    Parameters
    ----------
    image
        Colour, shape (height, width, 3), BGR.
    camera
        What is known; None if nothing can be trusted.
    words
        What to write below.
    candidate
        Without a camera: the circle that came nearest to being a mirror's rim.
    """
    height, width = image.shape[:2]
    scale = _WIDTH_PX / width
    shown = cv2.resize(image, (_WIDTH_PX, round(height * scale)), interpolation=cv2.INTER_AREA).astype(np.uint8)
    parts: list[NDArray[np.uint8]] = [shown]
    if camera is None:
        if candidate is not None:
            _circle(shown, candidate, scale, _RED)
    else:
        if camera.mask is not None:
            _tinted(shown, cv2.resize(camera.mask.image, shown.shape[1::-1], interpolation=cv2.INTER_NEAREST) == 0)
        if mirror := camera.mirror:
            _circle(shown, Circle(mirror.cx, mirror.cy, mirror.r_out), scale, _GREEN)
            _circle(shown, Circle(mirror.cx, mirror.cy, mirror.r_in), scale, _ORANGE)
            middle = round((mirror.cx + 0.5) * scale), round((mirror.cy + 0.5) * scale)
            cv2.drawMarker(shown, middle, _GREEN, cv2.MARKER_CROSS, 14, 1)
        elif camera.belt is not None:
            rows = camera.belt.rows(len(shown))
            for row in (rows.start, rows.stop - 1):
                cv2.line(shown, (0, row), (_WIDTH_PX, row), _GREEN, 2)
        parts.append(_panorama(image, camera))
    parts.append(_text(words))
    return np.vstack(parts)


def _panorama(image: NDArray[np.uint8], camera: CameraModel) -> NDArray[np.uint8]:
    panorama = camera.panorama(image).copy()
    if camera.panorama_mask is not None:
        _tinted(panorama, ~camera.panorama_mask.seen)
    size = _WIDTH_PX, round(_WIDTH_PX * camera.rows / camera.columns)
    return cv2.resize(panorama, size, interpolation=cv2.INTER_LINEAR).astype(np.uint8, copy=False)


def _circle(picture: NDArray[np.uint8], circle: Circle, scale: float, color: Sequence[int]) -> None:
    fine = 2**_SHIFT
    center = round((circle.cx + 0.5) * scale * fine), round((circle.cy + 0.5) * scale * fine)
    cv2.circle(picture, center, round(circle.radius * scale * fine), color, 1, cv2.LINE_AA, _SHIFT)


def _tinted(picture: NDArray[np.uint8], where: NDArray[np.bool_]) -> None:
    picture[where] = (picture[where] // 2 + np.array(_RED) // 2).astype(np.uint8)


def _text(words: str) -> NDArray[np.uint8]:
    """Return lines of text; OpenCV's font has ASCII letters only."""
    plain = words.encode("ascii", "replace").decode()
    lines = [line for one in plain.splitlines() for line in textwrap.wrap(one, 125)]
    picture: NDArray[np.uint8] = np.full((_LINE_PX * len(lines) + 12, _WIDTH_PX, 3), 32, np.uint8)
    for number, line in enumerate(lines):
        place = 10, _LINE_PX * (number + 1)
        cv2.putText(picture, line, place, cv2.FONT_HERSHEY_SIMPLEX, 0.5, _WHITE, 1, cv2.LINE_AA)
    return picture
