"""`omnieval.mapping.geodesic` once more, one number at a time: no arrays, nothing kept that can be computed again."""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable
from statistics import median

LAGS = (1, 2, 3, 5, 8, 13, 21, 34)


Pose = tuple[complex, float]
"""Where, in frames of travel, and in which direction, radians."""


def then(one: Pose, more: Pose) -> Pose:
    """Return where `more`, seen from `one`, is."""
    return one[0] + cmath.exp(1j * one[1]) * more[0], one[1] + more[1]


def back(pose: Pose) -> Pose:
    """Return where one is seen from, from a pose that it sees."""
    return -cmath.exp(-1j * pose[1]) * pose[0], -pose[1]


class PlainGeodesic:
    """Decides about images whose distances a function tells.

    Attributes
    ----------
    nodes
        Node of every image so far.
    recognised
        The image of the map that an image was recognised as, None where it was not.
    beliefs
        Belief in the best place at every image, None where there was none.
    """

    def __init__(
        self,
        distance: Callable[[int, int], float],
        turn: Callable[[int, int], float],  # of an image against an earlier one
        *,
        extent: float = 10.0,
        reach: float = 30.0,
        spacing: float = 2.0,
        gap: float = 40.0,
        sure: float = 0.8,
        likeness: float = 0.5,
        sharpness: float = 0.05,
        leave: float = 0.02,
        enter: float = 0.002,
    ) -> None:
        self.distance, self.turn = distance, turn
        self.extent, self.reach = extent, reach
        self.spacing, self.gap, self.sure = spacing, gap, sure
        self.likeness, self.sharpness, self.leave, self.enter = likeness, sharpness, leave, enter
        self.nodes: list[int] = []
        self.recognised: list[int | None] = []
        self.beliefs: list[float | None] = []
        self.travelled = 0.0
        self.far: list[float] = []
        self.keyframes: list[tuple[int, float, int]] = []  # image, travelled, node
        self.lengths: dict[tuple[int, int], float] = {}
        self.seen: dict[tuple[int, int], Pose] = {}
        self.belief: list[float] = []
        self.elsewhere = 1.0
        self.here = (0, 0.0, 0.0)  # keyframe, how far away, travelled
        self.pose: Pose = (0j, 0.0)  # seen from that keyframe

    def step(self, frame: int) -> None:
        """Decide about the next image."""
        if frame == 0:
            self._add(frame, None)
            self._note(self.keyframes[0][2], None, None)
            return
        self.curve = self._curve(frame)
        hop = self._hop(frame)
        self.travelled += hop
        turn = self.turn(frame, frame - 1)
        turn = turn if abs(turn) <= 0.5 else 0.0
        self.pose = then(self.pose, (hop * cmath.exp(0.5j * turn), turn))
        self._believe(frame)
        best, mass = self._best()
        if mass is not None and mass >= self.sure:
            image, _, node = self.keyframes[best]
            away = self._frames(self.distance(frame, image))
            there: Pose = (0j, self.turn(frame, image))
            self._join(self.here[0], best, self._from_here(frame) + away, then(self.pose, back(there)))
            self.here, self.pose = (best, away, self.travelled), there
            self._note(node, image, mass)
            return
        away = self._from_here(frame)
        if away <= self.spacing:
            self.here = (self.here[0], away, self.travelled)
            self._note(self.keyframes[self.here[0]][2], None, mass)
            return
        self._add(frame, away)
        self._note(self.keyframes[-1][2], None, mass)

    def _note(self, node: int, recognised: int | None, belief: float | None) -> None:
        self.nodes.append(node)
        self.recognised.append(recognised)
        self.beliefs.append(belief)

    def _curve(self, frame: int) -> list[tuple[float, int]]:
        """Return (distance, lag), the distance never falling, from (0, 0) on."""
        curve = [(0.0, 0)]
        for lag in LAGS:
            if lag <= frame:
                middle = median(self.distance(one, one - lag) for one in range(lag, frame + 1))
                curve.append((max(middle, curve[-1][0]), lag))
        return curve

    def _frames(self, distance: float) -> float:
        if distance <= 0:
            return 0.05
        for (low, before), (high, after) in zip(self.curve, self.curve[1:], strict=False):
            if low <= distance < high:
                return max(before + (after - before) * (distance - low) / (high - low), 0.05)
        return float(self.curve[-1][1])

    def _hop(self, frame: int) -> float:
        distance = self.distance(frame, frame - 1)
        usual = median(self.distance(one, one - 1) for one in range(1, frame + 1))
        return math.sqrt(min(self._frames(distance), 2.0)) if distance > usual / 2 else 0.05

    def _believe(self, frame: int) -> None:
        old = [when < self.travelled - self.gap for _, when, _ in self.keyframes]
        if not any(old):
            return
        distances = [self.distance(frame, image) for image, _, _ in self.keyframes]
        self.far.append(median(one for one, is_old in zip(distances, old, strict=True) if is_old))
        near = median(self.distance(one, one - 1) for one in range(1, frame + 1))
        far = median(self.far)
        before = self.belief + [0.0] * (len(self.keyframes) - len(self.belief))
        after = []
        for keyframe, distance in enumerate(distances):
            if not old[keyframe]:
                after.append(0.0)
                continue
            reached = 0.5 * before[keyframe]
            for other in self._neighbours(keyframe):
                reached += 0.5 / len(self._neighbours(other)) * before[other]
            log = 0.0
            if far > near:
                log = (self.likeness - (distance - near) / (far - near)) / self.sharpness
            likelihood = math.exp(min(max(log, -6.0), 6.0))
            after.append((reached * (1 - self.leave) + self.elsewhere * self.enter / sum(old)) * likelihood)
        elsewhere = sum(before) * self.leave + self.elsewhere * (1 - self.enter)
        total = sum(after) + elsewhere
        self.belief, self.elsewhere = [one / total for one in after], elsewhere / total

    def _best(self) -> tuple[int, float | None]:
        if not any(self.belief):
            return 0, None
        best = max(range(len(self.belief)), key=lambda one: (self.belief[one], -one))
        return best, sum(one for k, one in enumerate(self.belief) if self._travel(best)[k] <= 8.0)

    def _from_here(self, frame: int) -> float:
        keyframe, away, travelled = self.here
        return min(away + self.travelled - travelled, self._frames(self.distance(frame, self.keyframes[keyframe][0])))

    def _add(self, frame: int, away: float | None) -> None:
        new = len(self.keyframes)
        self.keyframes.append((frame, self.travelled, 0))
        if away is not None:
            self._join(self.here[0], new, away, self.pose)
        self.here, self.pose = (new, 0.0, self.travelled), (0j, 0.0)
        around = self._around(new)
        means = []
        for node in sorted({node for keyframe, (_, _, node) in enumerate(self.keyframes[:-1]) if keyframe in around}):
            own = [around.get(k, self.reach) for k, (_, _, other) in enumerate(self.keyframes[:-1]) if other == node]
            means.append((sum(own) / len(own), node))
        node = min(means)[1] if means and min(means)[0] <= self.extent else 1 + max(self.nodes, default=0)
        self.keyframes[-1] = (frame, self.travelled, node)

    def _join(self, one: int, other: int, length: float, seen: Pose) -> None:
        if one != other:
            for pair, pose in (((one, other), seen), ((other, one), back(seen))):
                self.lengths[pair] = min(length, self.lengths.get(pair, math.inf))
                self.seen.setdefault(pair, pose)

    def _around(self, start: int) -> dict[int, float]:
        """Return how far, straight, the keyframes within reach are from one: the nearest left is the next."""
        length, poses = {start: 0.0}, {start: (0j, 0.0)}
        while True:
            left = [
                (length[one] + way, other, one)
                for (one, other), way in self.lengths.items()
                if one in length and other not in length and length[one] + way <= self.reach
            ]
            if not left:
                return {keyframe: abs(at) for keyframe, (at, _) in poses.items()}
            way, other, one = min(left)
            length[other], poses[other] = way, then(poses[one], self.seen[one, other])

    def _neighbours(self, keyframe: int) -> list[int]:
        return [other for one, other in self.lengths if one == keyframe]

    def _travel(self, start: int) -> list[float]:
        """Return the shortest ways to all keyframes (Bellman and Ford)."""
        found = [math.inf] * len(self.keyframes)
        found[start] = 0.0
        changed = True
        while changed:
            changed = False
            for (one, other), length in self.lengths.items():
                if found[one] + length < found[other]:
                    found[other], changed = found[one] + length, True
        return found
