"""What a descriptor makes of one panorama, and the interface behind which all descriptors stand."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Description:
    """The two holistic descriptors of one image (doi 10.3390/app10186480, section 3).

    Attributes
    ----------
    position
        Shape (d,), float32. Invariant to a pure rotation of the robot.
    orientation
        Shape (cells, bins), float32. A rotation of the robot rolls it along the cells.
    """

    position: NDArray[np.float32]
    orientation: NDArray[np.float32]


class Descriptor(Protocol):
    """Turns a panorama into a `Description`. Pure: the same panorama gives the same arrays, from any thread.

    A class of one's own needs `describe` and nothing else. It may also have

    - ``name``, what it is called in tables (default: made of the class's name),
    - ``Settings``, a pydantic model of its parameters, an object of which the constructor then takes; or ``settings``,
      a dict of plain values,
    - ``weights``, the path of a file that its results depend on.
    """

    def describe(self, panorama: NDArray[np.uint8]) -> Description:
        """Describe one grey panorama, shape (rows, columns), uint8."""
        ...
