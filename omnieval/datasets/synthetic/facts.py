"""What is known of the synthetic building without rendering it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from omnieval.datasets.sequence import Mirror
from omnieval.errors import DatasetError
from omnieval.wording import did_you_mean, shown

LIGHTS: Final[tuple[str, ...]] = ("cloudy", "night", "sunny")
"""The days the building can be seen in; the first is the default."""

MIRROR: Final = Mirror(322.0, 239.0, 46.0, 228.0)
"""Where the mirror lies in the images, which are 640 pixels wide and 480 high."""

RENDERER_VERSION: Final = 3
"""Raised with every change of pixels or poses, so that old cached images are never taken for new ones."""

HIGHEST_BUILDING: Final = 9999
"""Buildings are numbered from 1; this is the last."""


@dataclass(frozen=True, slots=True)
class Rendered:
    """Which rendered sequence is meant: the light and the number of the building."""

    light: str
    building: int = 1

    @property
    def words(self) -> tuple[str, ...]:
        """The words of its name: the building only if it is not the first."""
        return (self.light,) if self.building == 1 else (self.light, str(self.building))

    @property
    def source(self) -> str:
        """How it is named on the command line."""
        return ":".join(("synthetic", *self.words))

    @property
    def name(self) -> str:
        """Its name in run folders and tables."""
        return "-".join(("synthetic", *self.words))


def rendered(text: str) -> Rendered:
    """Return what ``LIGHT[:BUILDING]`` names, the part of a source after ``synthetic:``; empty: the first light.

    Raises
    ------
    DatasetError
        If there is no such light or building.
    """
    light, colon, number = text.partition(":")
    light = light or LIGHTS[0]
    if light not in LIGHTS:
        raise DatasetError(f"no light '{shown(light)}' in synthetic:{shown(text)}; {did_you_mean(light, LIGHTS)}")
    if not colon:
        return Rendered(light)
    if not (number.isascii() and number.isdigit() and 1 <= int(number) <= HIGHEST_BUILDING):
        raise DatasetError(
            f"no building '{shown(number)}' in synthetic:{shown(text)}; buildings are numbered 1 to {HIGHEST_BUILDING}"
        )
    return Rendered(light, int(number))
