"""``camera.toml``: what a folder of images says about its camera.

kind = "omnidirectional"      # or "panoramic"

[mirror]                      # optional, omnidirectional only, pixels
cx = 320.0
cy = 240.0
r_in = 45.0
r_out = 230.0
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Iterable
from dataclasses import fields
from typing import Any, Literal

from omnieval.datasets.sequence import Camera, Mirror
from omnieval.errors import DatasetError
from omnieval.wording import did_you_mean, shown

CAMERA_FILE = "camera.toml"
KINDS: tuple[Literal["panoramic", "omnidirectional"], ...] = ("panoramic", "omnidirectional")

_MIRROR_KEYS = tuple(field.name for field in fields(Mirror))


def parse_camera(text: str) -> Camera:
    """Return the camera that a ``camera.toml`` describes.

    Raises
    ------
    DatasetError
        If it is not TOML, a key or kind is unknown, or the mirror is impossible.
    """
    try:
        table = tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        raise DatasetError(f"not valid TOML ({shown(str(error))})") from error
    _refuse_unknown(table, ("kind", "mirror"))
    kind = _kind(table.get("kind"))
    if "mirror" not in table:
        return Camera(kind)
    if kind == "panoramic":
        raise DatasetError("a panoramic camera has no [mirror]; remove it, or set kind = 'omnidirectional'")
    return Camera(kind, _mirror(table["mirror"]))


def _kind(value: object) -> Literal["panoramic", "omnidirectional"]:
    for kind in KINDS:
        if value == kind:
            return kind
    if value is None:
        raise DatasetError(f"no kind; expected kind = '{KINDS[0]}' or '{KINDS[1]}'")
    raise DatasetError(f"unknown kind '{shown(str(value))}'; {did_you_mean(str(value), KINDS)}")


def _mirror(table: Any) -> Mirror:
    if not isinstance(table, dict):
        raise DatasetError(f"mirror is not a table; expected [mirror] with {', '.join(_MIRROR_KEYS)}")
    _refuse_unknown(table, _MIRROR_KEYS)
    for key in _MIRROR_KEYS:
        value = table.get(key)
        if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
            raise DatasetError(f"mirror.{key} must be a number of pixels, got {shown(str(value))}")
    mirror = Mirror(**{key: float(table[key]) for key in _MIRROR_KEYS})
    if not 0 <= mirror.r_in < mirror.r_out:
        raise DatasetError(f"mirror needs 0 <= r_in < r_out, got r_in {mirror.r_in:g}, r_out {mirror.r_out:g}")
    return mirror


def _refuse_unknown(table: Iterable[str], known: tuple[str, ...]) -> None:
    for key in table:
        if key not in known:
            raise DatasetError(f"unknown key '{shown(key)}'; {did_you_mean(key, known)}")
