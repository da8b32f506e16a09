"""How the images of a sequence become panoramas: what is known of the camera, resolved."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from omnieval.datasets.belt import Belt, check_belt, parse_belt
from omnieval.datasets.findings import ROOT, Finding
from omnieval.datasets.sequence import Disturbance, Mirror, Sequence
from omnieval.errors import ConfigError, DatasetError, ResultError
from omnieval.imaging.calibrate import MirrorEstimate
from omnieval.imaging.glance import Notebook, image_size, seen_mirror
from omnieval.imaging.mask import MaskFile, PanoramaMask, load_mask, panorama_mask
from omnieval.imaging.settings import ImagingConfig
from omnieval.imaging.unwrap import Resizer, Unwrapper
from omnieval.wording import shown

Kind = Literal["omnidirectional", "panoramic"]

_PANORAMIC_ASPECT = 2.0
"""Images at least this much wider than high are treated as panoramas if it is not said what they are and none shows a
mirror."""


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
        Where kind and geometry are known from, in words.
    size
        (width, height) of the images in pixels; a sequence has images of one size.
    belt
        The rows of panoramic images that are used; None for all.
    mask
        What stays put in the robot's frame; None if nothing is left out.
    findings
        What is odd about the camera, or not known for certain.
    told
        Whether all of it was given; else a part was estimated from the images.
    disturbance
        How pixels are changed before anything is made of them; None if they are not.
    """

    kind: Kind
    mirror: Mirror | None
    rows: int
    columns: int
    origin: str
    size: tuple[int, int]
    belt: Belt | None = None
    mask: MaskFile | None = field(default=None, compare=False)
    findings: tuple[Finding, ...] = field(default=(), compare=False)
    told: bool = field(default=True, compare=False)
    disturbance: Disturbance | None = None

    @property
    def settings(self) -> dict[str, Any]:
        """Everything that determines a panorama and what of it is described, as plain values."""
        mirror = asdict(self.mirror) if self.mirror else None
        settings: dict[str, Any] = {"kind": self.kind, "mirror": mirror, "rows": self.rows, "columns": self.columns}
        if self.belt is not None:
            settings["belt"] = [self.belt.top, self.belt.bottom]
        if self.mask is not None:
            settings["mask"] = self.mask.digest
        if self.disturbance is not None and (changes := self.disturbance.of_pixels):
            settings["disturbance"] = changes
        return settings

    @property
    def about(self) -> dict[str, Any]:
        """What ``run.json`` says of it: its settings, where they are known from, and where a mask lies."""
        mask = {} if self.mask is None else {"mask_file": str(self.mask.file.expanduser().absolute())}
        return {"origin": self.origin, **self.settings, **mask}

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
    def panorama_mask(self) -> PanoramaMask | None:
        """Which pixels of the panoramas show the scene; None if all do."""
        return None if self.mask is None else panorama_mask(self.mask, self._transform.panorama)

    @cached_property
    def _transform(self) -> Unwrapper | Resizer:
        if self.mirror is None:
            return Resizer(self.rows, self.columns, self.belt)
        return Unwrapper(self.mirror, self.rows, self.columns)


def camera_of(about: Mapping[str, Any], size: tuple[int, int]) -> CameraModel:
    """Return the camera that ``run.json`` describes, for images of this size.

    Raises
    ------
    DatasetError
        If its mask cannot be read.
    ResultError
        If its mask has changed.
    """
    mirror = None if about["mirror"] is None else Mirror(**about["mirror"])
    belt = Belt(*about["belt"]) if "belt" in about else None
    mask = load_mask(Path(about["mask_file"]), size) if "mask" in about else None
    if mask is not None and mask.digest != about["mask"]:
        raise ResultError(f"the mask {shown(about['mask_file'])} is not the one that was replayed; replay it again")
    camera = CameraModel(about["kind"], mirror, about["rows"], about["columns"], about["origin"], size, belt, mask)
    return replace(camera, disturbance=Disturbance(**about["disturbance"])) if "disturbance" in about else camera


def camera_in_words(about: Mapping[str, Any]) -> str:
    """Say in one line what a camera is (`CameraModel.about`) and where that is known from.

    Examples
    --------
    >>> mirror = {"cx": 320.0, "cy": 240.5, "r_in": 45.0, "r_out": 230.0}
    >>> camera_in_words({"kind": "omnidirectional", "mirror": mirror, "origin": "camera.toml"})
    'omnidirectional, centre (320, 240.5), rim 230, blind spot 45 px (camera.toml)'
    """
    words = [about["kind"]]
    if mirror := about["mirror"]:
        words.append(f"centre ({mirror['cx']:.5g}, {mirror['cy']:.5g})")
        words.append(f"rim {mirror['r_out']:.4g}")
        words.append(f"blind spot {mirror['r_in']:.4g} px")
    if belt := about.get("belt"):
        words.append(f"rows from {100 * belt[0]:.3g} % to {100 * belt[1]:.3g} % of the height")
    if mask := about.get("mask_file"):
        words.append(f"masked by {shown(Path(mask).name)}")
    return f"{', '.join(words)} ({about['origin']})"


def resolve_camera(sequence: Sequence, config: ImagingConfig, notebook: Notebook | None = None) -> CameraModel:
    """Decide what the images of a sequence are and where the mirror lies in them.

    Numbers in the configuration win over the dataset's, these over an estimate from the images (`seen_mirror`).

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
        If an image that is needed for this cannot be read, or the images do not show what they are.
    """
    given = {name: value for name in ("cx", "cy", "r_in", "r_out") if (value := getattr(config, name)) is not None}
    size = image_size(sequence, notebook)
    kind, why = _kind(sequence, config, given, size, notebook)
    belt = config.belt or (sequence.camera.belt if kind == "panoramic" else None)
    disturbance = sequence.camera.disturbance
    mask_file = Path(config.mask) if config.mask is not None else sequence.camera.mask
    mask = None if mask_file is None else load_mask(mask_file, size)
    if kind == "panoramic":
        if given:
            raise ConfigError(f"the images are panoramas and have no mirror; leave out imaging.{next(iter(given))}")
        rows = None if belt is None else parse_belt(belt)
        if rows is not None:
            check_belt(rows, size)
        camera = CameraModel("panoramic", None, config.rows, config.columns, why, size, rows, mask)
        if disturbance is not None and any(disturbance.offset):
            raise ConfigError(
                f"{shown(sequence.source)} has panoramas, and no mirror that could lie elsewhere; leave mirror out"
            )
        told = config.kind != "auto" or sequence.camera.kind != "auto"
        findings = tuple(_panoramic_findings(camera))
        return replace(camera, findings=findings, told=told, disturbance=disturbance)
    if config.belt is not None:
        raise ConfigError("imaging.belt is for panoramas; the belt of a mirror lies between imaging.r_in and r_out")
    mirror, origin, findings = _mirror(sequence, given, notebook)
    if disturbance is not None and any(disturbance.offset):
        mirror = replace(mirror, cx=mirror.cx + disturbance.offset[0], cy=mirror.cy + disturbance.offset[1])
        origin += ", moved by the perturbation"
    _check(mirror, origin, size)
    camera = CameraModel("omnidirectional", mirror, config.rows, config.columns, origin, size, None, mask)
    told = len(given) == 4 or sequence.camera.mirror is not None
    return replace(camera, findings=findings, told=told, disturbance=disturbance)


def _kind(
    sequence: Sequence,
    config: ImagingConfig,
    given: Mapping[str, float],
    size: tuple[int, int],
    notebook: Notebook | None,
) -> tuple[Kind, str]:
    """Return what the images are, and how that is known."""
    if config.kind != "auto":
        return config.kind, "configuration"
    if sequence.camera.kind != "auto":
        return sequence.camera.kind, _told_by(sequence)
    if given:
        return "omnidirectional", "configuration"
    width, height = size
    if width < _PANORAMIC_ASPECT * height:
        return "omnidirectional", "by the shape of the images"
    estimate = seen_mirror(sequence, notebook)
    if estimate.two_discs:
        raise _unknown(sequence, estimate)
    if estimate.mirror is not None and estimate.by_edge:
        return "omnidirectional", "the images show a mirror"
    return "panoramic", f"treated as panoramas, because the images are {width / height:.3g} times as wide as high"


def _told_by(sequence: Sequence) -> str:
    if sequence.camera.told_by:
        return sequence.camera.told_by
    return f"data card {sequence.card}" if sequence.card else "camera.toml"


def _mirror(
    sequence: Sequence, given: dict[str, float], notebook: Notebook | None
) -> tuple[Mirror, str, tuple[Finding, ...]]:
    """Return the mirror, where it comes from, and what is odd about it.

    It is what is given, completed by the dataset's or else by an estimate.
    """
    if len(given) == 4:
        return Mirror(**given), "configuration", ()
    findings: tuple[Finding, ...] = ()
    if sequence.camera.mirror is not None:
        known, origin = sequence.camera.mirror, _told_by(sequence)
    else:
        estimate = seen_mirror(sequence, notebook)
        if estimate.mirror is None:
            raise _unknown(sequence, estimate)
        known, origin, findings = estimate.mirror, estimate.note, tuple(_mirror_findings(estimate, given))
    if not given:
        return known, origin, findings
    return replace(known, **given), f"configuration ({', '.join(given)}), else {origin}", findings


def _unknown(sequence: Sequence, estimate: MirrorEstimate) -> DatasetError:
    source = shown(sequence.source)
    return DatasetError(
        f"{source}: where the mirror lies in the images is not known: {estimate.why_not}; if they are panoramas, add "
        f"--set imaging.kind=panoramic; else look at them with `omnieval dataset check {source} --preview FILE.png`, "
        "and describe the camera in camera.toml (or --camera FILE.toml), or by --set imaging.cx=... with cy, r_in and "
        "r_out"
    )


def _mirror_findings(estimate: MirrorEstimate, given: Mapping[str, float]) -> list[Finding]:
    """Return what of an estimate is not seen, or only just."""
    findings = []
    look = "check it with --preview, or set imaging.r_in"
    if not estimate.blind_spot_seen and "r_in" not in given:
        message = f"the blind spot is not seen; its radius is taken to be a third of the rim's: {look}"
        findings.append(Finding("warning", "blind-spot-not-seen", ROOT, message))
    if not estimate.moved:
        message = "nothing moves in the images the mirror is estimated from; check it with --preview"
        findings.append(Finding("warning", "mirror-from-still-images", ROOT, message))
    return findings


def _panoramic_findings(camera: CameraModel) -> list[Finding]:
    width, height = camera.size
    if camera.belt is None and abs(width - 2 * height) <= 2:
        message = "twice as wide as high, as the whole sphere is: imaging.belt=30deg:-50deg leaves sky and ground out"
        return [Finding("info", "whole-sphere", ROOT, message)]
    return []


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
