"""Which poses an image goes by that was taken at another time than they: one rule for files, topics and transforms.

A pose of the same moment is the image's. Else, between two poses that are near enough to each other in time, it is
where the way from the one to the other has been gone in part. Else it has the nearest pose, if that is near enough.
Else nobody knows.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from omnieval.errors import DatasetError
from omnieval.wording import shown

SAME_MOMENT_NS = 1_000_000
"""Times no further apart are those of one moment, written with other digits."""


@dataclass(frozen=True)
class Joining:
    """How poses come to images by time.

    Attributes
    ----------
    tolerance_s
        How far an image may be from its pose in time, seconds; None for what suits the images.
    interpolate_s
        Poses that are no further apart, seconds, are interpolated between; None to interpolate nothing.
    """

    tolerance_s: float | None = None
    interpolate_s: float | None = None

    @classmethod
    def of(cls, given: Mapping[str, str], source: str) -> Joining:
        """Return what the options ``poses-tolerance`` and ``poses-interpolate`` of a source say.

        Raises
        ------
        DatasetError
            If one is not a number of seconds; `source` is for the message.
        """
        names = ("poses-tolerance", "poses-interpolate")
        return cls(*(_seconds(given[name], name, source) if name in given else None for name in names))

    @property
    def written(self) -> dict[str, str]:
        """The options as they are written into a source."""
        values = {"poses-tolerance": self.tolerance_s, "poses-interpolate": self.interpolate_s}
        return {name: f"{value:.12g}" for name, value in values.items() if value is not None}

    def or_else(self, other: Joining) -> Joining:
        """Return this, completed by another."""
        return Joining(
            other.tolerance_s if self.tolerance_s is None else self.tolerance_s,
            other.interpolate_s if self.interpolate_s is None else self.interpolate_s,
        )


@dataclass(frozen=True)
class Neighbours:
    """The poses that moments go by.

    Attributes
    ----------
    before, after
        Numbers of the poses, shape (n,): twice the same where one alone tells, -1 where none does.
    share
        How much of the way from the one to the other has been gone, shape (n,), 0 to 1.
    """

    before: NDArray[np.intp]
    after: NDArray[np.intp]
    share: NDArray[np.float64]

    @property
    def known(self) -> NDArray[np.bool_]:
        """Where a pose is known, shape (n,)."""
        return self.before >= 0

    @property
    def between(self) -> int:
        """How many moments lie between two poses."""
        return int((self.before != self.after).sum())


def neighbours(
    moments: NDArray[np.int64], times: NDArray[np.int64], tolerance_s: float, interpolate_s: float | None
) -> Neighbours:
    """Return by which poses each moment goes; see the top of this file.

    Parameters
    ----------
    moments
        Shape (n,), nanoseconds.
    times
        Of the poses, shape (m,), nanoseconds, increasing.
    tolerance_s, interpolate_s
        See `Joining`.
    """
    before = np.full(len(moments), -1, np.intp)
    after, share = before.copy(), np.zeros(len(moments))
    if not len(times):
        return Neighbours(before, after, share)
    right = np.searchsorted(times, moments)
    inside = (right > 0) & (right < len(times))
    left, right = np.maximum(right - 1, 0), np.minimum(right, len(times) - 1)
    to_left, to_right = _apart(times[left], moments), _apart(moments, times[right])
    distance = np.minimum(np.abs(to_left), np.abs(to_right))
    near = distance <= tolerance_s
    before[near] = after[near] = np.where(np.abs(to_left) <= np.abs(to_right), left, right)[near]
    if interpolate_s is not None:
        same = distance <= min(tolerance_s, SAME_MOMENT_NS / 1e9)
        way = inside & ~same & (_apart(times[left], times[right]) <= interpolate_s)
        before[way], after[way] = left[way], right[way]
        share[way] = to_left[way] / (to_left + to_right)[way]
    return Neighbours(before, after, share)


def _apart(one: NDArray[np.int64], other: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return seconds from one time to another, in nanoseconds; roughly for such as 64 bits do not hold."""
    roughly = other.astype(np.float64) - one.astype(np.float64)
    return np.where(np.abs(roughly) < 2.0**62, (other - one).astype(np.float64), roughly) / 1e9


def _seconds(text: str, name: str, source: str) -> float:
    try:
        seconds = float(text)
    except ValueError:
        seconds = -1.0
    if not 0 <= seconds < float("inf"):
        raise DatasetError(f"{name}={shown(text)} in {shown(source)} must be a number of seconds, 0 or more")
    return seconds
