"""Where the view of the map looks, and where its legend stands."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Extent = tuple[float, float, float, float]
"""(x min, y min, x max, y max) of the capture positions, metres."""

_ASPECT = 1.7
"""Width over height of the map view."""
_MARGIN = 0.06
"""Free border on every side, as a share of the height of the building."""
_LEGEND = 0.14
"""Room for the legend below the building, likewise."""


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
        """Return where so many entries of a legend stand: in a row at the lower border, shape (entries, 2), metres."""
        x = self.x_min + self.width * (np.arange(entries) + 0.5) / entries
        return np.stack([x, np.full(entries, self.y_min + 0.09 * self.height)], axis=1)


def map_window(extent: Extent) -> Window:
    """Return the window that shows all capture positions in the middle and the legend below them."""
    x_min, y_min, x_max, y_max = extent
    building = max(y_max - y_min, (x_max - x_min) / _ASPECT / (1 + _LEGEND), 1.0)
    x, y = (x_min + x_max) / 2, (y_min + y_max) / 2
    top, bottom = y + building * (0.5 + _MARGIN), y - building * (0.5 + _MARGIN + _LEGEND)
    half = max((top - bottom) * _ASPECT, (x_max - x_min) * (1 + 2 * _MARGIN)) / 2
    return Window(x - half, bottom, x + half, top)
