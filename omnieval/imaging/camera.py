"""How the images of a sequence become panoramas: what is known of the camera, resolved."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from omnieval.datasets.sequence import Mirror, Sequence
from omnieval.errors import ConfigError, DatasetError
from omnieval.imaging.glance import Notebook, image_size, seen_mirror
from omnieval.imaging.settings import ImagingConfig
from omnieval.imaging.unwrap import Resizer, Unwrapper

_PANORAMIC_ASPECT = 2.0
"""Images at least this much wider than high are taken for panoramas when nobody says what they are."""


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
    size
        (width, height) of the images in pixels; a sequence has images of one size.
    """

    kind: Literal["omnidirectional", "panoramic"]
    mirror: Mirror | None
    rows: int
    columns: int
    origin: str
    size: tuple[int, int]

    @property
    def settings(self) -> dict[str, Any]:
        """Everything that determines a panorama, as plain values."""
        mirror = asdict(self.mirror) if self.mirror else None
        return {"kind": self.kind, "mirror": mirror, "rows": self.rows, "columns": self.columns}

    def panorama(self, image: NDArray[np.uint8], *, where: str = "") -> NDArray[np.uint8]:
        """Return the panorama of an image, shape (height, width[, 3]) -> (rows, columns[, 3]).

        Parameters
        ----------
        image
            Grey or colour.
        where
            What to call it in an error.

        Raises
        ------
        DatasetError
            If it has another size than the first image of the sequence.
        """
        height, width = image.shape[:2]
        if (width, height) != self.size:
            raise DatasetError(
                f"image {where} is {width} x {height} pixels, the first one {self.size[0]} x {self.size[1]}; "
                "remove or resize it"
            )
        return self._transform.panorama(image)

    @cached_property
    def _transform(self) -> Unwrapper | Resizer:
        if self.mirror is None:
            return Resizer(self.rows, self.columns)
        return Unwrapper(self.mirror, self.rows, self.columns)


def camera_of(about: Mapping[str, Any], size: tuple[int, int]) -> CameraModel:
    """Return the camera that ``run.json`` tells of, for images of this size."""
    mirror = None if about["mirror"] is None else Mirror(**about["mirror"])
    return CameraModel(about["kind"], mirror, about["rows"], about["columns"], about["origin"], size)


def resolve_camera(sequence: Sequence, config: ImagingConfig, notebook: Notebook | None = None) -> CameraModel:
    """Decide what the images of a sequence are and where the mirror lies in them.

    Numbers in the configuration win over the dataset's, these over an estimate from the first frames of the whole
    sequence.

    Parameters
    ----------
    sequence
        Whose camera.
    config
        What the user says of it.
    notebook
        Where to remember what had to be read from images for this.

    Raises
    ------
    ConfigError
        If the geometry of the configuration contradicts itself or the images.
    DatasetError
        If an image that is needed for this cannot be read.
    """
    given = {name: value for name in ("cx", "cy", "r_in", "r_out") if (value := getattr(config, name)) is not None}
    kind = sequence.camera.kind if config.kind == "auto" else config.kind
    if kind == "auto" and given:
        kind = "omnidirectional"
    size = image_size(sequence, notebook)
    if kind == "auto":
        width, height = size
        kind = "panoramic" if width >= _PANORAMIC_ASPECT * height else "omnidirectional"
    if kind == "panoramic":
        if given:
            raise ConfigError(f"the images are panoramas and have no mirror; leave out imaging.{next(iter(given))}")
        return CameraModel("panoramic", None, config.rows, config.columns, "the images are panoramas", size)
    mirror, origin = _mirror(sequence, given, notebook)
    _check(mirror, origin, size)
    return CameraModel("omnidirectional", mirror, config.rows, config.columns, origin, size)


def _mirror(sequence: Sequence, given: dict[str, float], notebook: Notebook | None) -> tuple[Mirror, str]:
    """Return the mirror and where it comes from: what is given, completed by the dataset's or else by an estimate."""
    if len(given) == 4:
        return Mirror(**given), "configuration"
    if sequence.camera.mirror is not None:
        known, origin = sequence.camera.mirror, f"data card {sequence.card}" if sequence.card else "camera.toml"
    else:
        known, origin = seen_mirror(sequence, notebook)
    if not given:
        return known, origin
    return replace(known, **given), f"configuration ({', '.join(given)}), else {origin}"


def _check(mirror: Mirror, origin: str, size: tuple[int, int]) -> None:
    width, height = size
    if not 0 <= mirror.r_in < mirror.r_out:
        raise ConfigError(
            f"imaging.r_in = {mirror.r_in:g} must be less than imaging.r_out = {mirror.r_out:g} ({origin})"
        )
    if not (0 <= mirror.cx <= width and 0 <= mirror.cy <= height):
        raise ConfigError(
            f"the mirror's centre ({mirror.cx:g}, {mirror.cy:g}) lies outside the images of {width} x {height} pixels "
            f"({origin}); set imaging.cx and imaging.cy"
        )
