"""Poses over time: between which of them an image was taken, and transforms that follow one another in a tree."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation, Slerp

from omnieval.datasets.sequence import Pose

LONGEST_GAP_NS = 1_000_000_000
"""Between two poses that are further apart in time nobody knows where the robot was."""
TOLERANCE_NS = 100_000_000
"""Before the first pose and after the last, that one is taken if it is no further away in time."""


@dataclass(frozen=True)
class Track:
    """A body's pose over time, or that of one frame of coordinates within another.

    Attributes
    ----------
    times
        Shape (n,), nanoseconds, increasing.
    places
        Shape (n, 3), metres.
    rotations
        Shape (n, 4), quaternions (x, y, z, w); zero where it is not known.
    """

    times: NDArray[np.int64]
    places: NDArray[np.float64]
    rotations: NDArray[np.float64]

    @classmethod
    def of(cls, samples: Sequence[tuple[int, Sequence[float], Sequence[float]]]) -> Track:
        """Return the track through samples (time, place, rotation) in any order; of several at one time, the last."""
        known = {time: (place, rotation) for time, place, rotation in samples if np.isfinite([*place, *rotation]).all()}
        times = sorted(known)
        places = np.array([known[time][0] for time in times], np.float64).reshape(-1, 3)
        rotations = np.array([known[time][1] for time in times], np.float64).reshape(-1, 4)
        return cls(np.array(times, np.int64), places, rotations)

    def at(self, times: NDArray[np.int64], *, always: bool = False) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return places, shape (m, 3), and rotations, shape (m, 4), at `times`; NaN where the pose is not known.

        Places are interpolated linearly, rotations along the shortest turn.

        Parameters
        ----------
        times
            Shape (m,), nanoseconds.
        always
            The pose never changes: its first holds at any time.
        """
        count = len(times)
        if len(self.times) == 0:
            return np.full((count, 3), np.nan), np.full((count, 4), np.nan)
        if always:
            return np.repeat(self.places[:1], count, axis=0), np.repeat(self.rotations[:1], count, axis=0)
        within = np.clip(times, self.times[0], self.times[-1])
        after = np.searchsorted(self.times, within)  # the first that is not before
        before = np.where(self.times[after] == within, after, after - 1)
        gap = self.times[after] - self.times[before]
        share = np.where(gap > 0, (within - self.times[before]) / np.maximum(gap, 1), 0.0)
        places = self.places[before] + share[:, None] * (self.places[after] - self.places[before])
        rotations = self._turned(within)
        unknown = (gap > LONGEST_GAP_NS) | (np.abs(times - within) > TOLERANCE_NS)
        places[unknown] = np.nan
        rotations[unknown] = np.nan
        return places, rotations

    def _turned(self, times: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return the rotations at times within the track; zero everywhere if one of them is not known."""
        if (np.linalg.norm(self.rotations, axis=1) < 1e-6).any():
            return np.zeros((len(times), 4))
        if len(self.times) == 1:
            return np.repeat(self.rotations, len(times), axis=0)
        start = self.times[0]  # seconds since the epoch leave a double too few digits
        turn = Slerp((self.times - start).astype(np.float64), Rotation.from_quat(self.rotations))
        turned: NDArray[np.float64] = turn((times - start).astype(np.float64)).as_quat()
        return turned


def poses_at(track: Track, times: Sequence[int]) -> list[Pose | None]:
    """Return the pose in the plane at each time, None where it is not known; yaw is NaN if no rotation is known."""
    return _in_plane(*track.at(np.array(times, np.int64)))


@dataclass(frozen=True)
class Tree:
    """Frames of coordinates, each but the root given within its parent.

    Attributes
    ----------
    tracks
        The pose of a frame within its parent, by (parent, frame).
    fixed
        Those that never change.
    """

    tracks: Mapping[tuple[str, str], Track]
    fixed: frozenset[tuple[str, str]] = frozenset()

    @property
    def frames(self) -> list[str]:
        """All frames that have a parent, in order of name."""
        return sorted({child for _, child in self.tracks})

    @property
    def bodies(self) -> list[str]:
        """The frames that move and within which none moves: what the robot may be called."""
        moving = {child for parent, child in self.tracks if (parent, child) not in self.fixed}
        carrying = {frame for child in moving for frame in self.path(child)[:-1]}
        return sorted(moving - carrying)

    def path(self, frame: str) -> list[str]:
        """Return the frames from the root to `frame`."""
        parents = {child: parent for parent, child in self.tracks}
        path = [frame]
        while (parent := parents.get(path[0])) is not None and parent not in path:
            path.insert(0, parent)
        return path

    def poses_at(self, frame: str, times: Sequence[int]) -> list[Pose | None]:
        """Return the pose in the plane of `frame` within the root at each time, None where it is not known."""
        moments = np.array(times, np.int64)
        place = np.zeros((len(moments), 3))
        turn = Rotation.identity(len(moments))
        path = self.path(frame)
        for edge in pairwise(path):
            places, rotations = self.tracks[edge].at(moments, always=edge in self.fixed)
            known = np.isfinite(rotations).all(axis=1) & (np.linalg.norm(rotations, axis=1) > 1e-6)
            place = place + turn.apply(places)
            place[~known] = np.nan
            turn = turn * Rotation.from_quat(np.where(known[:, None], rotations, (0.0, 0.0, 0.0, 1.0)))
        return _in_plane(place, turn.as_quat())


def _in_plane(places: NDArray[np.float64], rotations: NDArray[np.float64]) -> list[Pose | None]:
    return [
        Pose(float(place[0]), float(place[1]), _yaw(*rotation)) if np.isfinite(place[:2]).all() else None
        for place, rotation in zip(places, rotations, strict=True)
    ]


def _yaw(x: float, y: float, z: float, w: float) -> float:
    """Return the yaw of a quaternion of any length in (-pi, pi], radians; NaN for zero."""
    norm = math.hypot(x, y, z, w)
    if not norm > 1e-6:
        return math.nan
    yaw = math.atan2(2 * (w * z + x * y), w * w + x * x - y * y - z * z)
    return math.pi if yaw <= -math.pi else yaw
