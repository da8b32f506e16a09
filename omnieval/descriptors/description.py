"""What a descriptor makes of one panorama, and the interface behind which all descriptors stand."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

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


@dataclass(frozen=True, slots=True)
class Place:
    """Where a description is kept in the array store: the path of its segment, without ending, and the row."""

    segment: str
    row: int


@dataclass(frozen=True)
class DescribedFrame:
    """A description and the digest of what it was made from; its place, if it is kept or about to be."""

    description: Description
    digest: str
    place: Place | None = None


class Descriptor(Protocol):
    """Turns a panorama into a `Description`. Pure: the same panorama gives the same arrays, from any thread.

    A class of your own needs `describe` and nothing else. It may be a `BatchDescriptor` or a `MaskedDescriptor` too,
    and may have

    - ``name``, what it is called in tables (default: made of the class's name),
    - ``Settings``, a pydantic model of its parameters, an object of which the constructor then takes; or ``settings``,
      a dict of plain values,
    - ``weights``, the path of a file that its results depend on,
    - ``colour``: if it is true, panoramas are given in colour, shape (rows, columns, 3), BGR.

    A descriptor without an orientation part returns one cell that is always the same, shape (1, 1): then the position
    level decides alone, and says nothing about headings.
    """

    def describe(self, panorama: NDArray[np.uint8]) -> Description:
        """Describe one grey panorama, shape (rows, columns), uint8."""
        ...


@runtime_checkable
class BatchDescriptor(Protocol):
    """A descriptor that can be given several panoramas at once.

    Attributes
    ----------
    batch
        How many it is given at most.
    """

    batch: int

    def describe_batch(self, panoramas: Sequence[NDArray[np.uint8]]) -> Sequence[Description]:
        """Describe panoramas of one size, as `describe` does each, to the bit, whatever stands beside it."""
        ...


@runtime_checkable
class MaskedDescriptor(Protocol):
    """A descriptor that can leave pixels out; one that cannot is given the panorama with these filled in.

    The orientation descriptor of an image is rolled against others, a mask is not: it stays in the robot's frame. A
    cell that is masked must therefore decide nothing, wherever it comes to lie. It takes the mean of the image's seen
    cells: with m and n the means of two images, q and o their cells less these means, the squared distance at the roll
    s is

        sum_c |q_c|^2 + sum_c |o_c|^2 - 2 sum_c q_c o_(c+s) + cells |m - n|^2

    and only the third term depends on s, to which a masked cell, where q or o is zero, adds nothing. A histogram of
    zeros in its place would favour or punish the roll at which the masks of both images coincide.
    """

    def describe_masked(self, panorama: NDArray[np.uint8], seen: NDArray[np.bool_]) -> Description:
        """Describe the seen pixels of a grey panorama whose others are filled in, both of shape (rows, columns)."""
        ...


LEAST_SEEN = 0.25
"""A cell of which less is seen counts as masked."""


def with_neutral_cells(orientation: NDArray[np.float64], share: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return cells, shape (cells, bins), with the mean of the seen ones in place of those that are masked.

    `share` is how much of each is seen, shape (cells,).
    """
    seen = share >= LEAST_SEEN
    if seen.all() or not seen.any():
        return orientation
    return np.where(seen[:, np.newaxis], orientation, orientation[seen].mean(axis=0))
