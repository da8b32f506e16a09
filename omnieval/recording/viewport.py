"""Where the view of the map looks, and where its legend stands."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Extent = tuple[float, float, float, float]
"""(x min, y min, x max, y max) of the capture positions, metres."""

Origin = tuple[float, float]
"""Where the map has its (0, 0), metres."""

_FAR = 10_000.0
"""Coordinates up to which single precision keeps a millimetre, metres."""
_GRID = 100.0
"""What an origin is a multiple of, metres, so that one can do the sum in one's head."""
_ASPECT = 2.0
"""Width over height of the map view."""
_MARGIN = 0.06
"""Free border on every side, as a share of the height of the building."""
_LEGEND = 0.14
"""Room for the legend below the building, likewise."""
_SCALE = 0.14
"""Most of the width that the scale takes."""
_SCALE_FROM = 0.03
"""Where the scale begins, as a share of the width."""
_ROUND_LENGTHS = tuple(digit * 10.0**power for power in range(-1, 4) for digit in (1, 2, 5))
"""Lengths that a scale may have, metres."""


@dataclass(frozen=True, slots=True)
class Window:
    """A rectangle of the map, metres, y up."""

    x_min: float
    y_min: float
    x_max: float
    y_max: float

    @property
    def width(self) -> float:
        """Its width, metres."""
        return self.x_max - self.x_min

    @property
    def height(self) -> float:
        """Its height, metres."""
        return self.y_max - self.y_min

    def legend(self, entries: int) -> NDArray[np.float64]:
        """Return where so many entries of a legend stand: in a row at the lower border, shape (entries, 2), metres.

        The row begins with the scale.
        """
        x = self.x_min + self.width * (np.arange(entries) + 1.5) / (entries + 1)
        return np.stack([x, np.full(entries, self._legend_y)], axis=1)

    def scale(self) -> tuple[float, NDArray[np.float64]]:
        """Return the length of the scale, a round number of metres, and its two ends, shape (2, 2), metres."""
        length = max((one for one in _ROUND_LENGTHS if one <= _SCALE * self.width), default=_ROUND_LENGTHS[0])
        x = self.x_min + _SCALE_FROM * self.width
        return length, np.array([[x, self._legend_y], [x + length, self._legend_y]])

    @property
    def _legend_y(self) -> float:
        return self.y_min + 0.09 * self.height


def extent_of(positions: NDArray[np.float64]) -> Extent | None:
    """Return the extent of capture positions, shape (n, 2), metres, NaN where unknown; None if none is known."""
    positions = positions[np.isfinite(positions).all(axis=1)]
    if not len(positions):
        return None
    (x_min, y_min), (x_max, y_max) = positions.min(axis=0).tolist(), positions.max(axis=0).tolist()
    return (x_min, y_min, x_max, y_max)


def origin_of(extent: Extent | None) -> Origin:
    """Return what is subtracted from positions before they are drawn: nothing, but of a place far from (0, 0).

    Recordings are in single precision, which of coordinates such as UTM's would leave decimetres.

    Examples
    --------
    >>> origin_of((-3.0, 0.0, 40.0, 9.0)), origin_of((465123.4, 5249321.0, 465170.2, 5249360.5))
    ((0.0, 0.0), (465100.0, 5249300.0))
    """
    if extent is None or max(map(abs, extent)) <= _FAR:
        return (0.0, 0.0)
    x_min, y_min, x_max, y_max = extent
    return (round((x_min + x_max) / 2 / _GRID) * _GRID, round((y_min + y_max) / 2 / _GRID) * _GRID)


def around(extent: Extent | None, origin: Origin) -> Extent | None:
    """Return an extent as seen from `origin`."""
    if extent is None:
        return None
    (x, y), (x_min, y_min, x_max, y_max) = origin, extent
    return (x_min - x, y_min - y, x_max - x, y_max - y)


def map_window(extent: Extent) -> Window:
    """Return the window that shows all capture positions in the middle and the legend below them."""
    x_min, y_min, x_max, y_max = extent
    building = max(y_max - y_min, (x_max - x_min) / _ASPECT / (1 + _LEGEND), 1.0)
    x, y = (x_min + x_max) / 2, (y_min + y_max) / 2
    top, bottom = y + building * (0.5 + _MARGIN), y - building * (0.5 + _MARGIN + _LEGEND)
    half = max((top - bottom) * _ASPECT, (x_max - x_min) * (1 + 2 * _MARGIN)) / 2
    return Window(x - half, bottom, x + half, top)
