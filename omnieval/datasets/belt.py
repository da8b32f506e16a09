"""Which rows of a panorama are used: all, or a belt.

A spherical camera sees up and down as far as straight; a mirror sees a belt about the horizon. The rest of an
equirectangular image, sky and ground stretched over whole rows, says little of the place.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field

from omnieval.errors import ConfigError

_FORM = re.compile(r"\s*([-+]?[0-9.]+)\s*(deg)?\s*:\s*([-+]?[0-9.]+)\s*(deg)?\s*")


@dataclass(frozen=True, slots=True)
class Belt:
    """Rows between two shares of an image's height, from the top, 0 to 1.

    `degrees` says that they were given as elevations, which only an image of the whole sphere has.
    """

    top: float
    bottom: float
    degrees: bool = field(default=False, compare=False)

    def rows(self, height: int) -> slice:
        """Return the rows of an image of this height, at least one."""
        first = min(round(self.top * height), height - 1)
        return slice(first, max(round(self.bottom * height), first + 1))


def parse_belt(text: str) -> Belt:
    """Read ``TOP:BOTTOM``: shares of the height from the top (0.3:0.8), or elevations (30deg:-50deg).

    Raises
    ------
    ValueError
        If it has not this form, or the top is not above the bottom.

    Examples
    --------
    >>> parse_belt("45deg:-45deg").rows(1000)
    slice(250, 750, None)
    """
    found = _FORM.fullmatch(text)
    try:
        first, degrees, last, too = float(found[1]), bool(found[2]), float(found[3]), bool(found[4])  # type: ignore[index]
    except (TypeError, ValueError):
        raise ValueError(f"TOP:BOTTOM such as 0.3:0.8 or 30deg:-50deg, not {text!r}") from None
    if degrees != too:
        raise ValueError("both ends as shares of the height, or both as elevations with deg")
    top, bottom = ((90 - first) / 180, (90 - last) / 180) if degrees else (first, last)
    if not 0 <= top < bottom <= 1:
        raise ValueError("the top above the bottom, both within the image (shares 0 to 1, elevations 90deg to -90deg)")
    return Belt(top, bottom, degrees)


def check_belt(belt: Belt, size: tuple[int, int]) -> None:
    """Refuse elevations in an image that is not of the whole sphere.

    Raises
    ------
    ConfigError
        If it is not twice as wide as high, to a pixel or two.
    """
    width, height = size
    if belt.degrees and abs(width - 2 * height) > 2:
        raise ConfigError(
            f"a belt in degrees needs images of the whole sphere, twice as wide as high, not {width} x {height}; give "
            "shares of the height, for example imaging.belt=0.3:0.8"
        )
