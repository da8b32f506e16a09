"""The incremental mapper: one image in, one decision out (Algorithm 1).

V. Román, S. Cebollada, L. Payá, O. Reinoso, *Creating Incremental Models of Indoor Environments through
Omnidirectional Imaging*, Appl. Sci. 2020, 10(18), 6480, doi 10.3390/app10186480.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from omnieval.descriptors.description import Description
from omnieval.errors import ConfigError
from omnieval.mapping.conditions import (
    centroid_bound,
    centroid_shift,
    gate_threshold,
    mean_distance,
    mean_pairwise_distance,
)
from omnieval.mapping.config import Gate, MapperConfig
from omnieval.mapping.journal import Journal
from omnieval.mapping.matching import match_image
from omnieval.mapping.memory import ImageMemory
from omnieval.mapping.node import Node, fit_node
from omnieval.mapping.step import (
    Centroid,
    EventKind,
    FinalMap,
    Match,
    NodeEvent,
    NodeGate,
    Placement,
    Step,
    Verdict,
)


class Mapper:
    """Groups images into nodes, each image looked at once, as it comes.

    Arrays in, decisions out: the mapper opens no file and depends on nothing but its configuration and the
    descriptions it was given, in their order.

    Examples
    --------
    >>> import numpy as np
    >>> from omnieval.descriptors.description import Description
    >>> rng = np.random.default_rng(0)
    >>> mapper = Mapper(MapperConfig(n_init=10, n_new=10))
    >>> for _ in range(30):
    ...     step = mapper.step(Description(rng.random(4, np.float32), rng.random((8, 2), np.float32)))
    >>> step.frame
    29
    """

    def __init__(self, config: MapperConfig | None = None) -> None:
        self.config = config or MapperConfig()
        self._images = ImageMemory()
        self._nodes: dict[int, Node] = {}
        self._active: set[int] = set()
        self._run: list[int] = []
        self._created = 0
        self._placements: dict[int, Placement] = {}

    def step(self, description: Description) -> Step:
        """Decide about the next image.

        Raises
        ------
        ConfigError
            If the description's arrays are not finite or not shaped like the earlier ones.
        """
        frame = self._images.append(description)
        if frame < self.config.n_init:
            return self._initial_step(frame)
        journal = Journal()
        examination = self._examine(frame, journal)
        verdict = examination.verdict
        node: int | None
        if verdict is Verdict.ASSIGNED:
            node, run = self._join(examination.node, frame, Placement.LOOP_CLOSURE, journal), 0
        elif (pending := self._first_pending(frame, examination.gate.x, journal)) is not None:
            verdict = Verdict.PENDING
            node, run = self._join(pending, frame, Placement.PENDING, journal), 0
        else:
            node, run = self._refuse(frame, verdict, journal)
        return self._report(frame, verdict, node, run, journal, examination)

    def finish(self) -> FinalMap:
        """Return the partition of all images so far; leftovers of broken runs are placed as configured.

        The map itself stays as it is: `step` may go on afterwards.

        Raises
        ------
        ConfigError
            If there were fewer images than the first node needs.
        """
        count = len(self._images)
        if count < self.config.n_init:
            raise ConfigError(
                f"the first node needs n_init = {self.config.n_init} images but there are only {count}; "
                "lower n_init or give a longer sequence"
            )
        labels = np.zeros(count, np.int64)
        for node in self._nodes.values():
            labels[node.frames] = node.id
        placements = dict(self._placements)
        for frame in np.flatnonzero(labels == 0).tolist():
            labels[frame], placements[frame] = self._place_leftover(frame)
        return FinalMap(
            labels=labels,
            placements=tuple(placements[frame] for frame in range(count)),
            nodes=tuple(self._nodes),
            active=frozenset(self._active),
            representatives=np.stack([node.representative for node in self._nodes.values()]),
        )

    # -- looking at an image; nothing here changes the map ------------------------------------------------

    def _examine(self, frame: int, journal: Journal) -> _Examination:
        """Hold an image against the active nodes: gate, match, prominence, centroid."""
        config = self.config
        gate = self._gate(frame)
        journal.compare("node", gate.ratios, gate.x)
        if not len(gate.candidates):
            return _Examination(Verdict.NO_CANDIDATE, gate)
        match = self._match(frame, gate.candidates.tolist())
        journal.compare_best(match, [len(self._nodes[node].frames) for node in gate.candidates.tolist()])
        if match.peaks >= 2:
            journal.compare("prominence", match.prominence_ratio, config.gamma)
            prominent = match.prominence_ratio >= config.gamma
        else:
            prominent = config.single_peak == "accept"
        if not prominent:
            return _Examination(Verdict.PROMINENCE, gate, match)
        node = self._nodes[match.node]
        centroid = Centroid(
            shift=centroid_shift(self._images.position(frame), node.representative, len(node.frames)),
            bound=centroid_bound(self._images.positions(node.frames), node.representative),
        )
        journal.compare("centroid", centroid.shift, centroid.bound)
        verdict = Verdict.ASSIGNED if centroid.shift <= centroid.bound else Verdict.CENTROID
        return _Examination(verdict, gate, match, centroid)

    def _gate(self, frame: int) -> NodeGate:
        """Node-level loop closure (Eq. 4)."""
        nodes = sorted(self._active)
        position = self._images.position(frame)
        ratios = np.array([self._nodes[node].ratio(position) for node in nodes])
        if self.config.node_gate == "two-sided":
            ratios = np.abs(ratios)
        return NodeGate(gate_threshold(self.config.omega, len(nodes)), np.array(nodes, np.int64), ratios)

    def _match(self, frame: int, candidates: Iterable[int]) -> Match:
        members = {node.id: node.frames for node in self._nodes.values()}
        return match_image(self._images, frame, members, candidates, prominence_mean=self.config.prominence_mean)

    def _first_pending(self, frame: int, x: float, journal: Journal) -> int | None:
        """Return the nearest pending node whose gate lets the image in."""
        position = self._images.position(frame)
        ratios = {node.id: node.ratio(position) for node in self._nodes.values() if node.id not in self._active}
        return _nearest(ratios, self.config.node_gate, x, "pending", journal)

    # -- changing the map ---------------------------------------------------------------------------------

    def _initial_step(self, frame: int) -> Step:
        journal = Journal()
        self._run.append(frame)
        if len(self._run) == self.config.n_init:
            self._create(journal)
        self._placements[frame] = Placement.FOUNDING
        return self._report(frame, Verdict.INITIAL, 1, 0, journal, None)

    def _refuse(self, frame: int, verdict: Verdict, journal: Journal) -> tuple[int | None, int]:
        """Leave the image unassigned and make a node of the run when it is long enough (section 4.5)."""
        if self.config.run_counts == "no-candidate" and verdict is not Verdict.NO_CANDIDATE:
            return None, len(self._run)
        self._run.append(frame)
        run = len(self._run)
        return (self._create(journal) if run == self.config.n_new else None), run

    def _create(self, journal: Journal) -> int:
        """Make a node of the run; return the node its images end in."""
        self._created += 1
        node = self._created
        self._fit(node, np.array(self._run, np.int64))
        journal.events.append(NodeEvent(EventKind.CREATED, node, frames=tuple(self._run)))
        self._placements.update(dict.fromkeys(self._run, Placement.FOUNDING))
        self._run.clear()
        return self._settle(node, journal, created=True)

    def _join(self, node: int, frame: int, placement: Placement, journal: Journal) -> int:
        """Put the image into a node, which ends the run; return the node the image ends in."""
        self._run.clear()
        self._placements[frame] = placement
        self._fit(node, np.append(self._nodes[node].frames, frame))
        return self._settle(node, journal, created=False)

    def _fit(self, node: int, frames: NDArray[np.int64]) -> None:
        old = self._nodes.get(node)
        keep = old.gate if old is not None and self.config.gate_refit == "creation" else None
        self._nodes[node] = fit_node(node, frames, self._images.positions(frames), self.config, gate=keep)

    def _settle(self, node: int, journal: Journal, *, created: bool) -> int:
        """After a node was created or has grown: merge it, or test its activation (sections 4.5 and 4.6)."""
        always = self.config.merge_when == "always"
        while created or always:
            into = self._merge_target(node, journal)
            if into is None:
                break
            merged = self._nodes.pop(node)
            self._active.discard(node)
            self._fit(into, np.sort(np.concatenate([self._nodes[into].frames, merged.frames])))
            journal.events.append(NodeEvent(EventKind.MERGED, node, into=into))
            node, created = into, False
        if node not in self._active and self._stands_apart(node, journal):
            self._active.add(node)
            journal.events.append(NodeEvent(EventKind.ACTIVATED, node))
        return node

    def _merge_target(self, node: int, journal: Journal) -> int | None:
        """Return the active node that absorbs this one (Eq. 11)."""
        representative = self._nodes[node].representative
        ratios = {other: self._nodes[other].ratio(representative) for other in sorted(self._active - {node})}
        return _nearest(ratios, self.config.merge_gate, self.config.merge_y, "merge", journal)

    def _stands_apart(self, node: int, journal: Journal) -> bool:
        """Activation: at least as far from the active nodes as these are from each other (section 4.5)."""
        others = sorted(self._active - {node})
        if len(others) < 2:
            return True
        representatives = np.stack([self._nodes[other].representative for other in others])
        distance = mean_distance(self._nodes[node].representative, representatives)
        bound = mean_pairwise_distance(representatives)
        journal.compare("activation", distance, bound)
        return distance >= bound

    # -- the end ------------------------------------------------------------------------------------------

    def _place_leftover(self, frame: int) -> tuple[int, Placement]:
        """Place an image that belongs to no node, against the map as it stands."""
        if self.config.leftovers == "unassigned":
            return 0, Placement.UNASSIGNED
        unrecorded = Journal()
        examination = self._examine(frame, unrecorded)
        if examination.verdict is Verdict.ASSIGNED:
            return examination.node, Placement.RETEST
        pending = self._first_pending(frame, examination.gate.x, unrecorded)
        if pending is not None:
            return pending, Placement.RETEST
        return self._match(frame, self._nodes).node, Placement.FORCED

    def _report(
        self,
        frame: int,
        verdict: Verdict,
        node: int | None,
        run: int,
        journal: Journal,
        examination: _Examination | None,
    ) -> Step:
        return Step(
            frame=frame,
            verdict=verdict,
            node=node,
            gate=examination.gate if examination else None,
            match=examination.match if examination else None,
            centroid=examination.centroid if examination else None,
            run=run,
            events=tuple(journal.events),
            active=len(self._active),
            pending=len(self._nodes) - len(self._active),
            margin=journal.margin,
        )


@dataclass(frozen=True)
class _Examination:
    """What the active nodes say of an image."""

    verdict: Verdict
    gate: NodeGate
    match: Match | None = None
    centroid: Centroid | None = None

    @property
    def node(self) -> int:
        """The node of the best match; only asked for when there is one."""
        assert self.match is not None
        return self.match.node


def _nearest(ratios: dict[int, float], gate: Gate, threshold: float, name: str, journal: Journal) -> int | None:
    """Return the node with the smallest signed ratio among those whose gate lets in; ties go to the lower id."""
    tested = {node: abs(ratio) if gate == "two-sided" else ratio for node, ratio in sorted(ratios.items())}
    journal.compare(name, list(tested.values()), threshold)
    return min((node for node in tested if tested[node] <= threshold), key=ratios.__getitem__, default=None)
