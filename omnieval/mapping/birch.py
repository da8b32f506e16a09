"""Birch: an image joins the nearest node if the radius of the node stays small, and else makes one.

T. Zhang, R. Ramakrishnan, M. Livny, *BIRCH: an efficient data clustering method for very large databases*, SIGMOD 1996,
doi 10.1145/233269.233324; the implementation is scikit-learn's, its tree one leaf, so that the nearest node is exact.
Its threshold is fixed when the tree is made: the first images wait until the distance of successive ones is known.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from statistics import median
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

from omnieval.descriptors.description import Description
from omnieval.errors import ConfigError
from omnieval.mapping.interface import Gate, Mapper
from omnieval.mapping.journal import Journal
from omnieval.mapping.memory import ImageMemory
from omnieval.mapping.step import EventKind, FinalMap, Match, NodeEvent, Placement, Role, Step

MOST_NODES = 2000
"""Most nodes that the one leaf of the tree may hold."""


class BirchSettings(BaseModel):
    """Parameters of `Birch`."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    radius: float = Field(
        2.0, gt=0, le=1e6, description="radius that a node may have, in median distances of successive images"
    )
    warm_up: int = Field(50, ge=2, le=10_000, description="images that this median is taken over; they wait")


class Birch(Mapper):
    """Joins an image to the node with the nearest mean, while the root mean square distance from it stays small."""

    name = "birch"
    Settings = BirchSettings
    gates = (
        Gate(
            name="radius",
            value="relative radius with the image",
            threshold="radius",
            passing="let it join node {one}",
            refusing="keep it out of node {one}",
            of="node",
            closes=True,
            plot_to=0,
        ),
    )

    def __init__(self, settings: BirchSettings | None = None) -> None:
        super().__init__(settings)
        self._images = ImageMemory()
        self._model: Any = None
        self._usual = 1.0
        self._members: list[list[int]] = []
        self._squares: list[float] = []

    def step(self, description: Description) -> Step:
        """See `Mapper.step`."""
        frame = self._images.append(description)
        if frame < self.settings.warm_up - 1:
            return Step(frame, "too early", Role.UNASSIGNED)
        if self._model is None:
            return self._begin(frame)
        journal = Journal()
        joins, node = self._insert(frame, journal)
        comparisons = tuple(journal.comparisons)
        if not joins:
            return Step(frame, "too wide", Role.REFUSED, node, events=_new(node, (frame,)), comparisons=comparisons)
        earlier = np.array(self._members[node - 1][:-1])
        compared = self._images.compare(frame, earlier)
        best = int(compared.position.argmin())
        match = Match(int(earlier[best]), node, int(compared.shifts[best]))
        return Step(frame, "narrow", Role.JOINED, node, match, comparisons=comparisons)

    def finish(self) -> FinalMap:
        """See `Mapper.finish`."""
        labels = np.zeros(len(self._images), np.int64)
        placements = [Placement.UNASSIGNED] * len(labels)
        for node, members in enumerate(self._members, start=1):
            labels[members] = node
            for frame in members:
                founds = frame < self.settings.warm_up or frame == members[0]
                placements[frame] = Placement.FOUNDING if founds else Placement.LOOP_CLOSURE
        nodes = tuple(range(1, len(self._members) + 1))
        means = [self._images.positions(np.array(members)).mean(axis=0) for members in self._members]
        representatives = np.stack(means) if means else np.empty((0, 0))
        return FinalMap(labels, tuple(placements), nodes, frozenset(nodes), representatives)

    def expect(self, descriptions: Sequence[Description]) -> None:
        """See `Mapper.expect`."""
        self._images.expect(descriptions)

    def too_short(self, images: int) -> str | None:
        """See `Mapper.too_short`."""
        if images >= self.settings.warm_up:
            return None
        return (
            f"birch needs {self.settings.warm_up} images to know how far successive ones are apart; set warm_up lower"
        )

    def _begin(self, frame: int) -> Step:
        """Make the tree, and put all images into it that have waited."""
        from sklearn.cluster import Birch as Tree

        positions = self._images.positions(np.arange(frame + 1))
        self._usual = float(median(np.linalg.norm(np.diff(positions, axis=0), axis=1).tolist())) or 1.0
        threshold = self.settings.radius * self._usual
        self._model = Tree(threshold=threshold, branching_factor=MOST_NODES, n_clusters=None, compute_labels=False)
        for waiting in range(frame + 1):
            _, node = self._insert(waiting, Journal())
        events = [event for one, members in enumerate(self._members, start=1) for event in _new(one, tuple(members))]
        return Step(frame, "first", Role.FOUNDING, node, events=tuple(events))

    def _insert(self, frame: int, journal: Journal) -> tuple[bool, int]:
        """Put an image into the tree; return whether it joined a node, and which node it is in."""
        position = self._images.position(frame)
        square, count = float(position @ position), len(self._members)
        if count:
            means: NDArray[np.float64] = self._model.subcluster_centers_
            nearest = int((np.square(means).sum(axis=1) - 2 * means @ position).argmin())
            size = len(self._members[nearest]) + 1
            mean = means[nearest] + (position - means[nearest]) / size
            spread = (self._squares[nearest] + square) / size - float(mean @ mean)
            journal.compare(
                "radius",
                [math.sqrt(max(spread, 0.0)) / self._usual],
                self.settings.radius,
                of=[nearest + 1],
                parameter="radius",
            )
        if count == MOST_NODES:
            raise ConfigError(f"birch makes at most {MOST_NODES} nodes, and has as many at image {frame}; raise radius")
        self._model.partial_fit(position[np.newaxis])
        joins = len(self._model.subcluster_centers_) == count
        if not joins:
            self._members.append([])
            self._squares.append(0.0)
        node = nearest + 1 if joins else count + 1
        self._members[node - 1].append(frame)
        self._squares[node - 1] += square
        return joins, node


def _new(node: int, frames: tuple[int, ...]) -> tuple[NodeEvent, NodeEvent]:
    return NodeEvent(EventKind.CREATED, node, frames=frames), NodeEvent(EventKind.ACTIVATED, node)
