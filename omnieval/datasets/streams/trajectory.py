"""Poses over time: between which of them an image was taken, and transforms that follow one another in a tree."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from omnieval.datasets.sequence import Pose
from omnieval.datasets.trajectory.between import Joining, neighbours

BY_DEFAULT = Joining(tolerance_s=0.1, interpolate_s=1.0)
"""How poses of a topic come to images: messages are frequent, and seldom of the moment of an image."""
_NO_ROTATION = 1e-6
"""Quaternions of a smaller norm are none."""


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

    def at(
        self, moments: NDArray[np.int64], how: Joining, *, always: bool = False
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return places, shape (m, 3), and rotations, shape (m, 4), at moments; NaN where the pose is not known.

        Between two poses places are on the straight line, rotations on the shortest turn; zero where one is not known.

        Parameters
        ----------
        moments
            Shape (m,), nanoseconds.
        how
            Which poses tell; what it leaves open is as `BY_DEFAULT`.
        always
            The pose never changes: its first holds at any time.
        """
        if always and len(self.times):
            return np.repeat(self.places[:1], len(moments), axis=0), np.repeat(self.rotations[:1], len(moments), axis=0)
        how = how.or_else(BY_DEFAULT)
        by = neighbours(moments, self.times, how.tolerance_s or 0.0, how.interpolate_s)
        places, rotations = np.full((len(moments), 3), np.nan), np.full((len(moments), 4), np.nan)
        before, after, share = by.before[by.known], by.after[by.known], by.share[by.known]
        places[by.known] = self.places[before] + share[:, None] * (self.places[after] - self.places[before])
        rotations[by.known] = _turned(self.rotations[before], self.rotations[after], share)
        return places, rotations


def _turned(one: NDArray[np.float64], other: NDArray[np.float64], share: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the rotations on the way from some to others, shape (n, 4); zero where one of two is not known."""
    known = np.minimum(np.linalg.norm(one, axis=1), np.linalg.norm(other, axis=1)) > _NO_ROTATION
    turned = np.zeros_like(one)
    first = Rotation.from_quat(one[known])
    turn = (first.inv() * Rotation.from_quat(other[known])).as_rotvec()
    turned[known] = (first * Rotation.from_rotvec(share[known, None] * turn)).as_quat()
    return turned


def poses_at(track: Track, moments: Sequence[int], how: Joining) -> list[Pose | None]:
    """Return the pose in the plane at each moment, None where it is not known; yaw is NaN if no rotation is known."""
    return _in_plane(*track.at(np.array(moments, np.int64), how))


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

    def poses_at(self, frame: str, times: Sequence[int], how: Joining) -> list[Pose | None]:
        """Return the pose in the plane of `frame` within the root at each time, None where it is not known."""
        moments = np.array(times, np.int64)
        place = np.zeros((len(moments), 3))
        turn = Rotation.identity(len(moments))
        path = self.path(frame)
        for edge in pairwise(path):
            places, rotations = self.tracks[edge].at(moments, how, always=edge in self.fixed)
            known = np.isfinite(rotations).all(axis=1) & (np.linalg.norm(rotations, axis=1) > _NO_ROTATION)
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
    if not norm > _NO_ROTATION:
        return math.nan
    yaw = math.atan2(2 * (w * z + x * y), w * w + x * x - y * y - z * z)
    return math.pi if yaw <= -math.pi else yaw
