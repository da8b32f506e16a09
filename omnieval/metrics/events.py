"""Loop closures as events: whether the robot knows a place when it comes back, and only then.

And borders: whether nodes change where rooms do.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from omnieval.metrics.ground import ROUNDING_M, Clock, Ground
from omnieval.metrics.proportion import Proportion, harmonic_mean

BORDER_S = 3.0
"""How far apart in time the change of a room and that of a node may be to be one."""


@dataclass(frozen=True, slots=True)
class Reentries:
    """Counts of visits.

    Attributes
    ----------
    precision
        Of the re-entries, those whose first image lies within theta of some image of an earlier visit of the node.
    recall
        Of the visits with an opportunity, those that are such a re-entry.
    """

    precision: Proportion
    recall: Proportion

    @property
    def f1(self) -> float | None:
        """Harmonic mean of the two."""
        return harmonic_mean(self.precision.value, self.recall.value)


@dataclass(frozen=True, slots=True)
class Borders:
    """Changes of room and of node that are one: among the changes of node, and among those of room."""

    precision: Proportion
    recall: Proportion


def reentries(labels: NDArray[np.int64], ground: Ground, thetas: Sequence[float]) -> dict[float, Reentries]:
    """Count how visits of nodes begin.

    A *visit* is a longest run of images of one node; images without a node are passed over. It is a *re-entry* if its
    node had an earlier visit that ended more than W before it began. It has an *opportunity* if an image more than W
    older, of whatever node, lies within theta of its first image.

    Parameters
    ----------
    labels
        Node of each of the m images of the ground, 0 where unassigned, shape (m,).
    ground
        Where and when they were taken.
    thetas
        Distances within which two images lie at one place, metres.
    """
    stamps, positions = ground.clock.stamps, ground.positions
    first, last = visits(labels)
    ended: dict[int, int] = {}  # when the first visit of a node ended
    again = np.zeros(len(first), np.bool_)
    distances = np.full(len(first), np.inf)
    members = _members(labels)
    for visit, (begin, end) in enumerate(zip(first.tolist(), last.tolist(), strict=True)):
        node = int(labels[begin])
        again[visit] = node in ended and stamps[begin] - ended[node] > ground.apart
        ended.setdefault(node, int(stamps[end]))
        if again[visit]:
            earlier = members[node][: np.searchsorted(members[node], begin)]
            distances[visit] = np.hypot(*(positions[earlier] - positions[begin]).T).min()
    near = ground.near(thetas)
    found = {}
    for theta in thetas:
        right = again & (distances <= theta + ROUNDING_M)
        chance = near[theta].known[first]
        found[theta] = Reentries(
            Proportion(int(right.sum()), int(again.sum())), Proportion(int((right & chance).sum()), int(chance.sum()))
        )
    return found


def visits(labels: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the first and the last image of every visit, in order.

    Examples
    --------
    >>> [ends.tolist() for ends in visits(np.array([1, 1, 0, 1, 2, 0, 1]))]
    [[0, 4, 6], [3, 4, 6]]
    """
    images = np.flatnonzero(labels > 0)
    changes = np.flatnonzero(np.diff(labels[images]))
    begins = np.concatenate([[0], changes + 1]) if len(images) else changes
    ends = np.concatenate([changes, [len(images) - 1]]) if len(images) else changes
    return images[begins], images[ends]


def borders(labels: NDArray[np.int64], rooms: Sequence[str | None], clock: Clock) -> Borders | None:
    """Match changes of room one to one with changes of node at most `BORDER_S` away, as many as can be.

    A change is where its first image was taken; images without a node or a room are passed over.

    Parameters
    ----------
    labels
        Node of every image, 0 where unassigned, shape (n,).
    rooms
        Room of every image, None where unknown, length n.
    clock
        When they were taken.

    Returns
    -------
    None if the room never changes.
    """
    names = {name: code for code, name in enumerate(sorted({room for room in rooms if room is not None}), start=1)}
    codes = np.array([0 if room is None else names[room] for room in rooms], np.int64)
    of_rooms, of_nodes = (clock.stamps[visits(one)[0][1:]] for one in (codes, labels))
    if not len(of_rooms):
        return None
    matched = _matched(of_rooms.tolist(), of_nodes.tolist(), clock.span(BORDER_S))
    return Borders(Proportion(matched, len(of_nodes)), Proportion(matched, len(of_rooms)))


def _matched(ones: list[int], others: list[int], within: int) -> int:
    """Return how many pairs, each of one and one other, can be at most so far apart; both ascend.

    The earliest that can be matched are: nothing that comes later could make more of them.
    """
    matched = one = other = 0
    while one < len(ones) and other < len(others):
        if abs(ones[one] - others[other]) <= within:
            matched += 1
            one += 1
            other += 1
        elif ones[one] < others[other]:
            one += 1
        else:
            other += 1
    return matched


def _members(labels: NDArray[np.int64]) -> dict[int, NDArray[np.int64]]:
    """Return the images of every node, ascending."""
    order = np.argsort(labels, kind="stable")
    cuts = np.flatnonzero(np.diff(labels[order])) + 1
    return {int(labels[images[0]]): images for images in np.split(order, cuts) if len(images)}
