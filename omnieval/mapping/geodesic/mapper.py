"""A mapper that recognises places by a run of images, and makes nodes of what is near along the way.

1. **Travel.** A distance of two images is the geometric mean of their position and orientation distances. How it grows
   between images 1, 2, 3, 5, ... frames apart turns every distance into frames of travel (`odometer`). The roll that
   aligns an image with the one before it tells how the robot turned (`motion`). Nothing else about descriptor or
   building has to be known.
2. **Keyframes.** An image that was not recognised and is more than `spacing` frames of travel from where the robot was
   last becomes a keyframe, joined to that one by the way between them (`graph`).
3. **Recognition.** A belief over keyframes goes along that graph from image to image (`belief`), and is weighed by how
   like the image is: between its predecessor and images of elsewhere. An image is recognised when the belief about
   one place reaches `sure`; it joins the node of the best keyframe there, and the ways meet at it.
4. **Nodes.** Keyframes within `reach` along the graph are laid out in the plane around a new one, by dead reckoning. It
   joins the node whose keyframes are nearest there, if they are within `extent` on average, and else makes a node.

The parts are well known: keyframes and a Bayes filter over places as in A. Angeli et al., *Fast and Incremental Method
for Loop-Closure Detection Using Bags of Visual Words*, IEEE T-RO 2008, doi 10.1109/TRO.2008.2004514; runs of images as
in M. Milford, G. Wyeth, *SeqSLAM*, ICRA 2012, doi 10.1109/ICRA.2012.6224623.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from statistics import fmean as mean
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from omnieval.descriptors.distance import Distances, Selection
from omnieval.mapping.geodesic.belief import Belief
from omnieval.mapping.geodesic.graph import KeyframeGraph, Way
from omnieval.mapping.geodesic.motion import Motion, angle_of
from omnieval.mapping.geodesic.odometer import LAGS, Odometer, RunningMedian
from omnieval.mapping.geodesic.settings import GeodesicSettings
from omnieval.mapping.interface import BranchingMapper, Column, Gate
from omnieval.mapping.journal import Journal
from omnieval.mapping.memory import ImageMemory
from omnieval.mapping.step import Curves, EventKind, FinalMap, Match, NodeEvent, Placement, Role, Step

PLACE = 8.0
"""Travel around a keyframe that counts as the same place when beliefs are summed."""

_LARGEST_LOG = 6.0
"""Limit of what one image says for or against a place, so that one unusual image cannot decide alone."""


@dataclass(frozen=True)
class _Here:
    """Where the robot was last.

    Attributes
    ----------
    keyframe
        The keyframe that it was at, or left last.
    away
        Travel from there.
    travelled
        In all, at that time.
    pose
        Where it is by now, seen from the keyframe.
    """

    keyframe: int
    away: float
    travelled: float
    pose: Motion


class Geodesic(BranchingMapper):
    """Recognises places by a run of images; nodes are keyframes near each other along the ways travelled."""

    name = "geodesic"
    Settings = GeodesicSettings
    swept = ("extent", "sure")
    gates = (
        Gate(
            name="belief",
            value="belief in the best place",
            threshold="sure",
            passing="recognise the image",
            refusing="leave the image unrecognised",
            closes=True,
            plot_to=1.0,
        ),
        Gate(
            name="keyframe",
            value="travel from where the robot was",
            threshold="spacing",
            passing="make no keyframe of the image",
            refusing="make a keyframe of the image",
            plot_to=0,
        ),
        Gate(
            name="extent",
            value="mean distance from the node's keyframes",
            threshold="extent",
            passing="let the keyframe join node {one}",
            refusing="keep the keyframe out of node {one}",
            of="node",
            plot_to=0,
        ),
    )
    columns = (
        Column(name="travelled", type="float", meaning="travel so far", unit="frames", plotted=True),
        Column(name="belief", type="float", meaning="belief in the best known place", plotted=True),
        Column(name="elsewhere", type="float", meaning="belief in being nowhere known"),
        Column(name="keyframes", type="int", meaning="keyframes in the map, before this image"),
    )
    curves = ("belief",)

    def __init__(self, settings: GeodesicSettings | None = None, images: ImageMemory | None = None) -> None:
        super().__init__(settings, images)
        self._odometer = Odometer()
        self._far = RunningMedian()
        self._graph = KeyframeGraph()
        self._belief = Belief(np.zeros(0))
        self._keyframes = Selection()
        self._frames: list[int] = []
        self._when: list[float] = []
        self._node_of: list[int] = []
        self._keyframes_of: dict[int, tuple[int, ...]] = {}
        self._labels: list[int] = []
        self._founding: list[int] = []
        self._here = _Here(0, 0.0, 0.0, Motion())

    def decide(self, frame: int) -> Step:
        """See `BranchingMapper.decide`."""
        journal = Journal()
        if frame == 0:
            return self._step(frame, "first", Role.FOUNDING, self._keyframe(frame, journal, None), journal)
        earlier = frame - np.array([lag for lag in LAGS if lag <= frame])
        before = self.images.compare(frame, earlier)
        travelled = self._odometer.add(self._distances(before))
        step = Motion.step(travelled, self._turn(before.shifts[0]))
        self._here = replace(self._here, pose=self._here.pose.then(step))
        compared = self.images.compare_selected(frame, self._keyframes)
        distances = self._distances(compared)
        self._believe(distances)
        best, mass = self._best_place()
        measured = {
            "travelled": self._odometer.travelled,
            "belief": mass,
            "elsewhere": self._belief.elsewhere,
            "keyframes": len(distances),
        }
        if mass is not None and journal.reach("belief", mass, self.settings.sure, parameter="sure"):
            shift, away = int(compared.shifts[best]), self._frames_of(distances[best])
            match, seen = Match(self._frames[best], self._node_of[best], shift), Motion(turn=self._turn(shift))
            way = Way(self._from_here(distances) + away, self._here.pose.then(seen.back))
            self._graph.join(self._here.keyframe, best, way)
            self._here = _Here(best, away, self._odometer.travelled, seen)
            return self._step(
                frame, "recognised", Role.JOINED, (), journal, match, measured, self._curves(), self._node_of[best]
            )
        away = self._from_here(distances)
        journal.compare("keyframe", [away], self.settings.spacing)
        if away <= self.settings.spacing:
            self._here = replace(self._here, away=away, travelled=self._odometer.travelled)
            node = self._node_of[self._here.keyframe]
            return self._step(frame, "onward", Role.JOINED, (), journal, None, measured, self._curves(), node)
        events = self._keyframe(frame, journal, away)
        role, verdict = (Role.REFUSED, "new node") if events else (Role.JOINED, "keyframe")
        return self._step(frame, verdict, role, events, journal, None, measured, self._curves())

    def look(self, frame: int) -> Step:
        """Find an image by its nearest keyframe, then the most similar image of that keyframe's node; never refuses.

        One image alone says too little to refuse it: a belief needs a run of them. See `BranchingMapper.look`.
        """
        keyframe = int(self._distances(self.images.compare_selected(frame, self._keyframes)).argmin())
        node = self._node_of[keyframe]
        members = np.flatnonzero(np.array(self._labels) == node)
        compared = self.images.compare(frame, members)
        best = int(self._distances(compared).argmin())
        match = Match(int(members[best]), node, int(compared.shifts[best]))
        return Step(frame, "most similar", Role.JOINED, node, match)

    def finish(self, placed: Mapping[int, tuple[int, Placement]] | None = None) -> FinalMap:
        """See `Mapper.finish`."""
        labels = np.array(self._labels, np.int64)
        placements = [Placement.LOOP_CLOSURE] * len(labels)
        for frame in self._founding:
            placements[frame] = Placement.FOUNDING
        nodes = tuple(self._keyframes_of)
        means = [self.images.positions(np.flatnonzero(labels == node)).mean(axis=0) for node in nodes]
        return FinalMap(labels, tuple(placements), nodes, frozenset(nodes), np.stack(means))

    def fork(self, settings: Any) -> Self:
        """See `BranchingMapper.fork`."""
        other = super().fork(settings)
        other._odometer, other._far, other._graph = self._odometer.copied(), self._far.copied(), self._graph.copied()
        other._keyframes = self._keyframes.copied()
        return other

    def _distances(self, compared: Distances) -> NDArray[np.float64]:
        if self.images.cells == 1:  # there is no orientation part
            return compared.position
        distances: NDArray[np.float64] = np.sqrt(compared.position * compared.orientation)
        return distances

    def _turn(self, shift: int | np.integer) -> float:
        return angle_of(int(shift), self.images.cells)

    def _frames_of(self, distance: float) -> float:
        return self._odometer.frames(distance)

    def _believe(self, distances: NDArray[np.float64]) -> None:
        """Weigh the keyframes by how like they are: between the last image and images of elsewhere."""
        old = np.array(self._when) < self._odometer.travelled - self.settings.gap
        if not old.any():
            return
        self._far.add(float(np.median(distances[old])))
        likelihood = self._likelihood(distances)
        self._belief = self._belief.moved(
            self._graph.edges,
            np.where(old, likelihood, 0.0),
            leave=self.settings.leave,
            enter=self.settings.enter,
        )

    def _likelihood(self, distances: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return how much better each keyframe explains the image than an unknown place does, shape (keyframes,)."""
        near = self._odometer.step
        scale = self._far.value - near
        if scale <= 0.0:  # images of elsewhere are as like as the last: distances say nothing
            return np.ones(len(distances))
        unlike = (distances - near) / scale
        logs = (self.settings.likeness - unlike) / self.settings.sharpness
        likelihood: NDArray[np.float64] = np.exp(np.clip(logs, -_LARGEST_LOG, _LARGEST_LOG))
        return likelihood

    def _best_place(self) -> tuple[int, float | None]:
        """Return the most believed keyframe, and the belief in the place around it; None if there is no old one."""
        places = self._belief.places
        if not places.any():
            return 0, None
        first = int(places.argmax())
        around = np.array([one for one in self._graph.within(first, PLACE) if one < len(places)])
        return first, min(float(places[around].sum()), 1.0)

    def _from_here(self, distances: NDArray[np.float64]) -> float:
        """Return the travel from the keyframe where the robot was: along the way, or across if that is nearer."""
        here = self._here
        along = here.away + self._odometer.travelled - here.travelled
        return min(along, self._frames_of(distances[here.keyframe]))

    def _keyframe(self, frame: int, journal: Journal, away: float | None) -> tuple[NodeEvent, ...]:
        """Make a keyframe of an image, and a node of it if it is far from all; return what happened to nodes."""
        keyframe = self._graph.add()
        self.images.select(frame, self._keyframes)
        self._frames.append(frame)
        self._when.append(self._odometer.travelled)
        if away is not None:
            self._graph.join(self._here.keyframe, keyframe, Way(away, self._here.pose))
        self._here = _Here(keyframe, 0.0, self._odometer.travelled, Motion())
        node = self._nearest_node(keyframe, journal)
        events: tuple[NodeEvent, ...] = ()
        if node is None:
            node = len(self._keyframes_of) + 1
            events = (NodeEvent(EventKind.CREATED, node, frames=(frame,)), NodeEvent(EventKind.ACTIVATED, node))
            self._founding.append(frame)
        self._node_of.append(node)
        self._keyframes_of[node] = (*self._keyframes_of.get(node, ()), keyframe)
        return events

    def _nearest_node(self, keyframe: int, journal: Journal) -> int | None:
        """Return the node whose keyframes are nearest on average, if they are near enough.

        A keyframe out of reach counts as that far away.
        """
        reach = self.settings.reach
        distances = {one: motion.distance for one, motion in self._graph.seen_from(keyframe, reach).items()}
        near = sorted({self._node_of[one] for one in distances if one != keyframe})
        if not near:
            return None
        means = [mean([distances.get(one, reach) for one in self._keyframes_of[node]]) for node in near]
        best, extent = int(np.argmin(means)), self.settings.extent
        joins = means[best] <= extent
        between = (means[best], np.inf) if joins else (-np.inf, means[best])
        journal.compare("extent", means, extent, of=near, parameter="extent", between=between)
        return near[best] if joins else None

    def _curves(self) -> Curves | None:
        """Return the belief over the keyframes, by node and then time."""
        places = self._belief.places
        if not places.any():
            return None
        frames = np.array(self._frames)[: len(places)]
        order = np.lexsort([frames, np.array(self._node_of)[: len(places)]])
        values = places[order]
        return Curves(frames[order], np.arange(len(order)), len(order), {"belief": values}, int(values.argmax()))

    def _step(
        self,
        frame: int,
        verdict: str,
        role: Role,
        events: tuple[NodeEvent, ...],
        journal: Journal,
        match: Match | None = None,
        measured: dict[str, Any] | None = None,
        curves: Curves | None = None,
        node: int | None = None,
    ) -> Step:
        node = self._node_of[-1] if node is None else node
        self._labels.append(node)
        comparisons = tuple(journal.comparisons)
        return Step(frame, verdict, role, node, match, events, comparisons, measured or {}, curves)
