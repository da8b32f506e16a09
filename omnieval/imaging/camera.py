"""How the images of a sequence become panoramas: what is known of the camera, resolved."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from omnieval.datasets.sequence import Mirror, Sequence
from omnieval.errors import ConfigError, DatasetError
from omnieval.imaging.calibrate import estimate_mirror
from omnieval.imaging.decode import decode_grey
from omnieval.imaging.settings import ImagingConfig
from omnieval.imaging.unwrap import Resizer, Unwrapper

_PANORAMIC_ASPECT = 2.0
"""Images at least this much wider than high are taken for panoramas when nobody says what they are."""
_ESTIMATED_FROM = 32
"""Images to estimate the mirror from, spread over the calibration frames; more do not sharpen it."""


@dataclass(frozen=True)
class CameraModel:
    """Turns images into panoramas of one size.

    Attributes
    ----------
    kind
        What the images are.
    mirror
        Where the mirror lies; None for panoramic images.
    rows, columns
        Size of the panoramas.
    origin
        Where the geometry comes from, in words.
    """

    kind: Literal["omnidirectional", "panoramic"]
    mirror: Mirror | None
    rows: int
    columns: int
    origin: str

    @property
    def settings(self) -> dict[str, Any]:
        """Everything that determines a panorama, as plain values."""
        mirror = asdict(self.mirror) if self.mirror else None
        return {"kind": self.kind, "mirror": mirror, "rows": self.rows, "columns": self.columns}

    def panorama(self, image: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Return the panorama of an image, shape (height, width[, 3]) -> (rows, columns[, 3])."""
        return self._transform.panorama(image)

    @cached_property
    def _transform(self) -> Unwrapper | Resizer:
        if self.mirror is None:
            return Resizer(self.rows, self.columns)
        return Unwrapper(self.mirror, self.rows, self.columns)


def resolve_camera(sequence: Sequence, config: ImagingConfig) -> CameraModel:
    """Decide what the images of a sequence are and where the mirror lies in them.

    Numbers in the configuration win over the dataset's, these over an estimate from the first frames of the whole
    sequence.

    Raises
    ------
    ConfigError
        If the geometry of the configuration contradicts itself.
    DatasetError
        If an image that is needed for this cannot be read.
    """
    kind = sequence.camera.kind if config.kind == "auto" else config.kind
    given = {name: value for name in ("cx", "cy", "r_in", "r_out") if (value := getattr(config, name)) is not None}
    if kind == "auto":
        height, width = _grey(sequence, 0).shape
        kind = "panoramic" if width >= _PANORAMIC_ASPECT * height and not given else "omnidirectional"
    if kind == "panoramic":
        return CameraModel("panoramic", None, config.rows, config.columns, "the images are panoramas")
    mirror, origin = _known_mirror(sequence, complete=len(given) == 4)
    if given:
        mirror = Mirror(**{**asdict(mirror), **given})
        origin = "configuration" if len(given) == 4 else f"configuration ({', '.join(given)}), else {origin}"
    if not 0 <= mirror.r_in < mirror.r_out:
        raise ConfigError(
            f"imaging.r_in = {mirror.r_in:g} must be less than imaging.r_out = {mirror.r_out:g} ({origin})"
        )
    return CameraModel("omnidirectional", mirror, config.rows, config.columns, origin)


def _known_mirror(sequence: Sequence, *, complete: bool) -> tuple[Mirror, str]:
    """Return the dataset's mirror, or an estimate unless the configuration gives a complete one."""
    if sequence.camera.mirror is not None:
        return sequence.camera.mirror, f"data card {sequence.card}" if sequence.card else "camera.toml"
    if complete:
        return Mirror(0.0, 0.0, 0.0, 1.0), ""
    count = len(sequence.calibration)
    chosen = sorted({round(index) for index in np.linspace(0, count - 1, min(count, _ESTIMATED_FROM))})
    images = [_grey(sequence, index) for index in chosen]
    for index, image in zip(chosen, images, strict=True):
        if image.shape != images[0].shape:
            height, width = image.shape
            raise DatasetError(
                f"image {sequence.calibration[index].path} is {width} x {height} pixels, the first one "
                f"{images[0].shape[1]} x {images[0].shape[0]}; remove or resize it"
            )
    estimate = estimate_mirror(images)
    return estimate.mirror, estimate.note


def _grey(sequence: Sequence, index: int) -> NDArray[np.uint8]:
    frame = sequence.calibration[index]
    return decode_grey(frame.read(), str(frame.path))
