"""The leader: an image joins the nearest node if it is near enough, and else makes one (Hartigan 1975, chapter 3).

The control that every method should beat: it has one level only, and never changes a decision. How near is near enough
is a multiple of how far successive images have been from each other so far (running median), so that it fits any
descriptor.
"""

from __future__ import annotations

import dataclasses
from bisect import insort
from collections.abc import Mapping

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from omnieval.mapping.interface import BranchingMapper, Gate
from omnieval.mapping.journal import Journal
from omnieval.mapping.memory import ImageMemory
from omnieval.mapping.step import EventKind, FinalMap, Match, NodeEvent, Placement, Role, Step


class LeaderSettings(BaseModel):
    """Parameters of `Leader`."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    radius: float = Field(
        3.0, gt=0, le=1e6, description="an image joins the nearest node within so many median distances of neighbours"
    )


class Leader(BranchingMapper):
    """Joins an image to the node with the nearest mean of position descriptors, within a threshold."""

    name = "leader"
    Settings = LeaderSettings
    swept = ("radius",)
    gates = (
        Gate(
            name="distance",
            value="relative distance",
            threshold="radius",
            passing="let it join node {one}",
            refusing="keep it out of node {one}",
            of="node",
            closes=True,
            plot_to=0,
        ),
    )

    def __init__(self, settings: LeaderSettings | None = None, images: ImageMemory | None = None) -> None:
        super().__init__(settings, images)
        self._hops: list[float] = []  # sorted
        self._members: dict[int, tuple[int, ...]] = {}
        self._means = np.empty((0, 0))

    def decide(self, frame: int) -> Step:
        """See `BranchingMapper.decide`."""
        position = self.images.position(frame)
        if frame == 0:
            return self._found(Step(frame, "first", Role.FOUNDING))
        insort(self._hops, float(np.linalg.norm(position - self.images.position(frame - 1))))
        step = self.look(frame)
        if step.node is None:
            return self._found(step)
        members = self._members[step.node]
        self._members[step.node] = (*members, frame)
        self._means = self._means.copy()
        self._means[step.node - 1] += (position - self._means[step.node - 1]) / (len(members) + 1)
        return step

    def look(self, frame: int) -> Step:
        """See `BranchingMapper.look`."""
        position, journal = self.images.position(frame), Journal()
        middle = len(self._hops) // 2
        median = (self._hops[middle] + self._hops[~middle]) / 2 if self._hops else 0.0
        ratios = np.linalg.norm(self._means - position, axis=1) / (median or 1.0)
        nearest, radius = int(ratios.argmin()), self.settings.radius
        ratio, joins = float(ratios[nearest]), bool(ratios[nearest] <= radius)
        between = (ratio, np.inf) if joins else (-np.inf, ratio)
        journal.compare("distance", ratios.tolist(), radius, of=[*self._members], parameter="radius", between=between)
        comparisons = tuple(journal.comparisons)
        if not joins:
            return Step(frame, "too far", Role.REFUSED, comparisons=comparisons)
        members = np.array(self._members[nearest + 1])
        compared = self.images.compare(frame, members)
        best = int(compared.position.argmin())
        match = Match(int(members[best]), nearest + 1, int(compared.shifts[best]))
        return Step(frame, "near", Role.JOINED, nearest + 1, match, comparisons=comparisons)

    def finish(self, placed: Mapping[int, tuple[int, Placement]] | None = None) -> FinalMap:
        """See `Mapper.finish`."""
        labels = np.zeros(len(self.images), np.int64)
        placements = [Placement.LOOP_CLOSURE] * len(labels)
        for node, members in self._members.items():
            labels[list(members)] = node
            placements[members[0]] = Placement.FOUNDING
        nodes = tuple(self._members)
        return FinalMap(labels, tuple(placements), nodes, frozenset(nodes), self._means.copy())

    def _found(self, step: Step) -> Step:
        node = len(self._members) + 1
        self._members[node] = (step.frame,)
        self._means = np.vstack([*self._means, self.images.position(step.frame)])
        events = (NodeEvent(EventKind.CREATED, node, frames=(step.frame,)), NodeEvent(EventKind.ACTIVATED, node))
        return dataclasses.replace(step, node=node, events=events)
