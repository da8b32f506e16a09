"""Pictures as they are recorded: turned, scaled and compressed."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from omnieval.imaging.encode import jpeg

PANORAMA_COLUMNS = 512
"""Widest panorama that is recorded, px: the width the descriptors see."""
OMNIDIRECTIONAL_SIZE = 256
"""Longer side of a recorded omnidirectional image, px."""
PANORAMA_QUALITY = 85
OMNIDIRECTIONAL_QUALITY = 80
"""JPEG qualities, 0..100; three pictures a step have to stay within 60 kB."""


@dataclass(frozen=True)
class StepImages:
    """The pictures of a step, compressed to JPEG.

    Attributes
    ----------
    panorama
        The new image, unwrapped.
    omnidirectional
        The new image as the camera took it; None for panoramic input.
    match
        Panorama of the most similar image of the map, turned to the new image's heading; None without a match.
    """

    panorama: bytes
    omnidirectional: bytes | None
    match: bytes | None


def step_images(
    panorama: NDArray[np.uint8],
    omnidirectional: NDArray[np.uint8] | None,
    match: NDArray[np.uint8] | None,
    *,
    shift: int = 0,
    cells: int = 1,
) -> StepImages:
    """Compress the pictures of a step, all uint8 BGR.

    Parameters
    ----------
    panorama
        The new image, unwrapped, shape (h, w, 3).
    omnidirectional
        The new image as the camera took it, shape (H, W, 3); None for panoramic input.
    match
        Panorama of the most similar image of the map, not turned, shape (h, w, 3); None without a match.
    shift, cells
        By how much to turn the match; see `turn`.
    """
    return StepImages(
        encode_panorama(panorama),
        None if omnidirectional is None else encode_omnidirectional(omnidirectional),
        None if match is None else encode_panorama(turn(match, shift, cells)),
    )


def turn(panorama: NDArray[np.uint8], shift: int, cells: int) -> NDArray[np.uint8]:
    """Turn a panorama by the shift that was found between orientation descriptors.

    Parameters
    ----------
    panorama
        Shape (h, w) or (h, w, channels); its columns span the full circle.
    shift
        Cells by which its orientation descriptor is rolled to align with another image's.
    cells
        Number of cells of the orientation descriptor.

    Returns
    -------
    NDArray
        The panorama as it would look from the other image's heading, same shape.
    """
    columns = round(shift * panorama.shape[1] / cells)
    return np.roll(panorama, columns, axis=1)


def encode_panorama(panorama: NDArray[np.uint8]) -> bytes:
    """Compress a panorama, no wider than `PANORAMA_COLUMNS`, to JPEG."""
    scale = min(1.0, PANORAMA_COLUMNS / panorama.shape[1])
    return jpeg(_scaled(panorama, scale), PANORAMA_QUALITY)


def encode_omnidirectional(image: NDArray[np.uint8]) -> bytes:
    """Compress an omnidirectional image, no larger than `OMNIDIRECTIONAL_SIZE`, to JPEG."""
    scale = min(1.0, OMNIDIRECTIONAL_SIZE / max(image.shape[:2]))
    return jpeg(_scaled(image, scale), OMNIDIRECTIONAL_QUALITY)


def _scaled(image: NDArray[np.uint8], scale: float) -> NDArray[np.uint8]:
    if scale == 1.0:
        return image
    rows, columns = (max(1, round(scale * side)) for side in image.shape[:2])
    if scale <= 0.5:  # halving is ten times as fast as another scale
        image = np.asarray(cv2.resize(image, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA), np.uint8)
    return np.asarray(cv2.resize(image, (columns, rows), interpolation=cv2.INTER_AREA), np.uint8)
