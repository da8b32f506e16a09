"""The incremental mapper: one image in, one decision out (Algorithm 1).

V. Román, S. Cebollada, L. Payá, O. Reinoso, *Creating Incremental Models of Indoor Environments through
Omnidirectional Imaging*, Appl. Sci. 2020, 10(18), 6480, doi 10.3390/app10186480.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from omnieval.descriptors.description import Description
from omnieval.errors import ConfigError
from omnieval.mapping.interface import BranchingMapper
from omnieval.mapping.journal import Journal
from omnieval.mapping.memory import AHEAD, ImageMemory, blocks
from omnieval.mapping.roman2020.conditions import (
    centroid_bound,
    centroid_shift,
    gate_floor,
    gate_threshold,
    mean_distance,
    mean_pairwise_distance,
)
from omnieval.mapping.roman2020.evidence import COLUMNS, CURVES, GATES, ROLES, Centroid, ImageMatch, NodeGate, Verdict
from omnieval.mapping.roman2020.matching import match_image
from omnieval.mapping.roman2020.node import Node, NodeBank, fit_node, grow_node
from omnieval.mapping.roman2020.screened import Effort, ScreenedMatch, screened_best, screened_match
from omnieval.mapping.roman2020.settings import PRESETS, Roman2020Settings, Sides
from omnieval.mapping.step import Comparison, Curves, EventKind, FinalMap, Match, NodeEvent, Number, Placement, Step


class Roman2020(BranchingMapper):
    """Groups images into nodes by the method of Román et al.

    Arrays in, decisions out: the mapper opens no file and depends on nothing but its settings and the descriptions it
    was given, in their order.

    Parameters
    ----------
    settings
        Parameters of the method.
    images
        The images, where several mappers share them; see `sweep`.

    Examples
    --------
    >>> import numpy as np
    >>> from omnieval.descriptors.description import Description
    >>> rng = np.random.default_rng(0)
    >>> mapper = Roman2020(Roman2020Settings(n_init=10, n_new=10))
    >>> for _ in range(30):
    ...     step = mapper.step(Description(rng.random(4, np.float32), rng.random((8, 2), np.float32)))
    >>> step.frame
    29
    """

    name = "roman2020"
    Settings = Roman2020Settings
    presets = PRESETS
    gates = GATES
    columns = COLUMNS
    curves = CURVES
    swept = ("omega", "merge_y", "gamma", "n_new")
    screens = True

    def __init__(self, settings: Roman2020Settings | None = None, images: ImageMemory | None = None) -> None:
        super().__init__(settings, images)
        self._nodes: dict[int, Node] = {}
        self._active = NodeBank([])
        self._run: list[int] = []
        self._created = 0
        self._placements: list[Placement] = []
        self._effort = Effort()

    def too_short(self, images: int) -> str | None:
        """See `Mapper.too_short`."""
        if images >= self.settings.n_init:
            return None
        return (
            f"the first node needs n_init = {self.settings.n_init} images but there are only {images}; lower n_init "
            "or give a longer sequence"
        )

    def decide(self, frame: int) -> Step:
        """Decide about the next image, which is among the images already."""
        self._placements.append(Placement.UNASSIGNED)
        journal = Journal()
        if frame < self.settings.n_init:
            return self._initial_step(frame, journal)
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

    def finish(self, placed: Mapping[int, tuple[int, Placement]] | None = None) -> FinalMap:
        """Return the partition of all images so far; leftovers of broken runs are placed as configured.

        The map itself stays as it is: `step` may be called afterwards.

        Parameters
        ----------
        placed
            Where the leftovers end, if `place` was asked already.

        Raises
        ------
        ConfigError
            If there were fewer images than the first node needs.
        """
        placements = list(self._placements)
        if fault := self.too_short(len(placements)):
            raise ConfigError(fault)
        labels = np.zeros(len(placements), np.int64)
        for node in self._nodes.values():
            labels[node.frames] = node.id
        if placed is None:
            placed = {}
            for block in blocks(self.leftovers, AHEAD):
                self.images.anticipate(block)
                placed |= {frame: self.place(frame, Journal()) for frame in block}
        for frame, (label, placement) in placed.items():
            labels[frame], placements[frame] = label, placement
        return FinalMap(
            labels=labels,
            placements=tuple(placements),
            nodes=tuple(self._nodes),
            active=frozenset(self._active.ids.tolist()),
            representatives=np.stack([node.representative for node in self._nodes.values()]),
        )

    @property
    def leftovers(self) -> list[int]:
        """Images of broken runs, which belong to no node of the map."""
        return [frame for frame, placement in enumerate(self._placements) if placement is Placement.UNASSIGNED]

    def place(self, frame: int, journal: Journal) -> tuple[int, Placement]:
        """Return the node a leftover ends in and how; the map stays as it is."""
        if self.settings.leftovers == "unassigned":
            return 0, Placement.UNASSIGNED
        examination = self._examine(frame, journal)
        if examination.verdict is Verdict.ASSIGNED:
            return examination.node, Placement.RETEST
        pending = self._first_pending(frame, examination.gate.x, journal)
        if pending is not None:
            return pending, Placement.RETEST
        return self._best(frame).node, Placement.FORCED

    def expect(self, descriptions: Sequence[Description]) -> None:
        """See `Mapper.expect`."""
        super().expect(descriptions)
        if self.images.screening and self._nodes:
            members = self._members
            for ahead, description in enumerate(descriptions):
                gate = self._gate_of(description.position.astype(np.float64))
                if len(gate.candidates):
                    frames = np.concatenate([members[node] for node in gate.candidates.tolist()])
                    self.images.foresee(len(self.images) + ahead, frames)

    # -- looking at an image; nothing here changes the map ------------------------------------------------

    def look(self, frame: int) -> Step:
        """Find an image on the map by its two levels: node gate, then best image and its prominence.

        The condition on the centroid (Eq. 9) is about adding an image, and not asked. See `BranchingMapper.look`.
        """
        journal = Journal()
        examination = self._recognise(frame, journal)
        found = examination.match if examination.verdict is Verdict.ASSIGNED else None
        return self._report(frame, examination.verdict, found.node if found else None, 0, journal, examination)

    def _examine(self, frame: int, journal: Journal) -> _Examination:
        """Hold an image against the active nodes: gate, match, prominence, centroid."""
        examination = self._recognise(frame, journal)
        match = examination.match
        if examination.verdict is not Verdict.ASSIGNED or match is None:
            return examination
        node = self._nodes[match.node]
        centroid = Centroid(
            shift=centroid_shift(self.images.position(frame), node.representative, len(node.frames)),
            bound=centroid_bound(node.squared_radii),
        )
        journal.compare("centroid", [centroid.shift], centroid.bound)
        verdict = Verdict.ASSIGNED if centroid.shift <= centroid.bound else Verdict.CENTROID
        return _Examination(verdict, examination.gate, match, centroid)

    def _recognise(self, frame: int, journal: Journal) -> _Examination:
        """Hold an image against the active nodes: gate, match, prominence."""
        settings = self.settings
        gate = self._gate(frame, journal)
        candidates = gate.candidates.tolist()
        if not candidates:
            return _Examination(Verdict.NO_CANDIDATE, gate)
        if self.images.screening and (decided := self._screened(frame, candidates)) is not None:
            return _Examination(Verdict.ASSIGNED if decided[1] else Verdict.PROMINENCE, gate, decided[0])
        match = self._match(frame, candidates)
        _compare_best(journal, match, candidates, [len(self._nodes[node].frames) for node in candidates])
        if match.peaks >= 2:
            prominent = journal.reach("prominence", match.prominence_ratio, settings.gamma, parameter="gamma")
        else:
            journal.reach("peaks", match.peaks, 2, counts=True)
            prominent = settings.single_peak == "accept"
        if not prominent:
            return _Examination(Verdict.PROMINENCE, gate, match)
        return _Examination(Verdict.ASSIGNED, gate, match)

    def _gate(self, frame: int, journal: Journal) -> NodeGate:
        """Node-level loop closure (Eq. 4)."""
        gate = self._gate_of(self.images.position(frame))
        floor = gate_floor(len(self._active.ids))
        nodes = self._active.ids.tolist()
        journal.compare("node", gate.ratios.tolist(), gate.x, of=nodes, parameter="omega", floor=floor)
        return gate

    def _gate_of(self, position: NDArray[np.float64]) -> NodeGate:
        ratios = self._active.ratios(position)
        if self.settings.node_gate == "two-sided":
            ratios = np.abs(ratios)
        return NodeGate(gate_threshold(self.settings.omega, len(self._active.ids)), self._active.ids, ratios)

    def _match(self, frame: int, candidates: Iterable[int]) -> ImageMatch:
        return match_image(self.images, frame, self._members, candidates, prominence_mean=self.settings.prominence_mean)

    def _screened(self, frame: int, candidates: Iterable[int]) -> tuple[ScreenedMatch, bool] | None:
        return screened_match(self.images, frame, self._members, candidates, self.settings, self._effort)

    def _best(self, frame: int) -> ImageMatch | ScreenedMatch:
        """Return the most similar image of all nodes."""
        screened = screened_best(self.images, frame, self._members, self._nodes) if self.images.screening else None
        return screened or self._match(frame, self._nodes)

    @property
    def _members(self) -> dict[int, NDArray[np.int64]]:
        return {node.id: node.frames for node in self._nodes.values()}

    def _first_pending(self, frame: int, x: float, journal: Journal) -> int | None:
        """Return the nearest pending node whose gate lets the image in."""
        position, active = self.images.position(frame), self._active.ids.tolist()
        ratios = {node.id: node.ratio(position) for node in self._nodes.values() if node.id not in active}
        nearest = _Nearest(ratios, self.settings.node_gate, x)
        floor = gate_floor(len(active))
        nearest.note(journal, "pending", parameter="omega", floor=floor)
        return nearest.node

    # -- changing the map ---------------------------------------------------------------------------------

    def _initial_step(self, frame: int, journal: Journal) -> Step:
        self._run.append(frame)
        if len(self._run) == self.settings.n_init:
            self._create(journal)
        self._placements[frame] = Placement.FOUNDING
        return self._report(frame, Verdict.INITIAL, 1, 0, journal, None)

    def _refuse(self, frame: int, verdict: Verdict, journal: Journal) -> tuple[int | None, int]:
        """Leave the image unassigned and make a node of the run when it is long enough (section 4.5)."""
        if self.settings.run_counts == "no-candidate" and verdict is not Verdict.NO_CANDIDATE:
            return None, len(self._run)
        self._run.append(frame)
        run = len(self._run)
        full = journal.reach("run", run, self.settings.n_new, parameter="n_new", counts=True)
        return (self._create(journal) if full else None), run

    def _create(self, journal: Journal) -> int:
        """Make a node of the run; return the node its images end in."""
        self._created += 1
        node = self._created
        self._fit(node, np.array(self._run, np.int64))
        journal.events.append(NodeEvent(EventKind.CREATED, node, frames=tuple(self._run)))
        for frame in self._run:
            self._placements[frame] = Placement.FOUNDING
        self._run.clear()
        return self._settle(node, journal, created=True)

    def _join(self, node: int, frame: int, placement: Placement, journal: Journal) -> int:
        """Put the image into a node, which ends the run; return the node the image ends in."""
        self._run.clear()
        self._placements[frame] = placement
        old = self._nodes[node]
        # The match has just compared the image with its candidates; a pending node is small.
        known = placement is Placement.LOOP_CLOSURE
        squared = np.square(self.images.position_distances(frame, old.frames)) if known else None
        self._put(grow_node(old, frame, self.images.positions, self.settings, squared_distances=squared))
        return self._settle(node, journal, created=False)

    def _fit(self, node: int, frames: NDArray[np.int64]) -> None:
        old = self._nodes.get(node)
        keep = old.gate if old is not None and self.settings.gate_refit == "creation" else None
        self._put(fit_node(node, frames, self.images.positions(frames), self.settings, gate=keep))

    def _put(self, node: Node) -> None:
        self._nodes[node.id] = node
        if node.id in self._active.ids:
            self._active = self._active.replacing(node)

    def _settle(self, node: int, journal: Journal, *, created: bool) -> int:
        """After a node was created or has grown: merge it, or test its activation (sections 4.5 and 4.6)."""
        always = self.settings.merge_when == "always"
        while created or always:
            into = self._merge_target(node, journal)
            if into is None:
                break
            merged = self._nodes.pop(node)
            self._activate(set(self._active.ids.tolist()) - {node})
            self._fit(into, np.sort(np.concatenate([self._nodes[into].frames, merged.frames])))
            journal.events.append(NodeEvent(EventKind.MERGED, node, into=into))
            node, created = into, False
        if node not in self._active.ids and self._stands_apart(node, journal):
            self._activate({*self._active.ids.tolist(), node})
            journal.events.append(NodeEvent(EventKind.ACTIVATED, node))
        return node

    def _activate(self, nodes: set[int]) -> None:
        """Make these nodes the active ones."""
        self._active = NodeBank([self._nodes[node] for node in nodes])

    def _others(self, node: int) -> list[Node]:
        """Return the active nodes besides one."""
        return [self._nodes[other] for other in self._active.ids.tolist() if other != node]

    def _merge_target(self, node: int, journal: Journal) -> int | None:
        """Return the active node that absorbs this one (Eq. 11)."""
        representative, y = self._nodes[node].representative, self.settings.merge_y
        ratios = {other.id: other.ratio(representative) for other in self._others(node)}
        nearest = _Nearest(ratios, self.settings.merge_gate, y)
        nearest.note(journal, "merge", parameter="merge_y")
        return nearest.node

    def _stands_apart(self, node: int, journal: Journal) -> bool:
        """Activation: at least as far from the active nodes as these are from each other (section 4.5)."""
        others = self._others(node)
        if len(others) < 2:
            return True
        representatives = np.stack([other.representative for other in others])
        distance = mean_distance(self._nodes[node].representative, representatives)
        bound = mean_pairwise_distance(representatives)
        return journal.reach("activation", distance, bound)

    def _report(
        self,
        frame: int,
        verdict: Verdict,
        node: int | None,
        run: int,
        journal: Journal,
        examination: _Examination | None,
    ) -> Step:
        match = examination.match if examination else None
        # What screened images were decided by is not known.
        full = None if self.images.screening or isinstance(match, ScreenedMatch) else match
        return Step(
            frame=frame,
            verdict=verdict.value,
            role=ROLES[verdict],
            node=node,
            match=Match(match.best_frame, match.node, match.shift) if match else None,
            events=tuple(journal.events),
            comparisons=() if self.images.screening else tuple(journal.comparisons),
            measured={"run": run} if self.images.screening else _measured(examination, journal, run),
            curves=_curves(full, self.settings.gamma) if full else None,
        )


def _measured(examination: _Examination | None, journal: Journal, run: int) -> dict[str, Number]:
    """Return what the columns of the method hold."""
    measured: dict[str, Number] = {"run": run, "merge_ratio": journal.first("merge")}
    if examination is None:
        return measured
    if isinstance(match := examination.match, ImageMatch):
        measured["similarity_position"] = float(match.position[match.best])
        measured["similarity_orientation"] = float(match.orientation[match.best])
        measured["similarity"] = float(match.similarity[match.best])
        measured["prominence"] = match.prominence
        measured["prominence_mean"] = match.prominence_mean
        measured["prominence_ratio"] = match.prominence_ratio
        measured["peaks"] = match.peaks
    if centroid := examination.centroid:
        measured["centroid_shift"] = centroid.shift
        measured["centroid_bound"] = centroid.bound
    return measured


def _curves(match: ImageMatch, gamma: float) -> Curves:
    """Return the similarity curves of a match; the level is the base of its peak plus gamma times the mean."""
    level = None
    if match.peaks >= 2:
        level = 1.0 + (gamma * match.prominence_mean - match.prominence) / float(match.similarity[match.best])
    values = dict(zip(CURVES, (match.similarity, match.position, match.orientation), strict=True))
    return Curves(match.frames, match.slots, match.map_size, values, match.best, level)


def _compare_best(journal: Journal, match: ImageMatch, nodes: Sequence[int], sizes: Sequence[int]) -> None:
    """Note how much more similar the best image is than the best one of any other candidate node.

    `sizes` are the numbers of images of the candidate `nodes`, in the order of the match.
    """
    if len(sizes) < 2:
        return
    starts = np.cumsum([0, *sizes[:-1]])
    best_of = np.maximum.reduceat(match.similarity, starts)
    second, first = np.argsort(best_of, kind="stable")[-2:].tolist()
    value, threshold = float(best_of[second]), float(best_of[first])
    journal.comparisons.append(Comparison("match", (value,), threshold, value, np.inf, of=(nodes[second],)))


@dataclass(frozen=True)
class _Examination:
    """The results of comparing an image with the active nodes."""

    verdict: Verdict
    gate: NodeGate
    match: ImageMatch | ScreenedMatch | None = None
    centroid: Centroid | None = None

    @property
    def node(self) -> int:
        """The node of the best match; only asked for when there is one."""
        assert self.match is not None
        return self.match.node


class _Nearest:
    """The node with the smallest signed ratio among those a gate lets in; ties go to the lower id.

    Attributes
    ----------
    node
        The nearest node; None when none is let in.
    """

    def __init__(self, ratios: Mapping[int, float], gate: Sides, threshold: float) -> None:
        nodes = sorted(ratios)
        self._nodes, self._threshold = nodes, threshold
        compared = {node: abs(ratios[node]) if gate == "two-sided" else ratios[node] for node in nodes}
        self._tested = list(compared.values())
        self.node = min((node for node in nodes if compared[node] <= threshold), key=ratios.__getitem__, default=None)
        low, bar = -np.inf, np.inf
        if self.node is not None:
            low, bar = compared[self.node], ratios[self.node]
        # A node that is let in later matters only if it is nearer.
        refused = (compared[node] for node in nodes if compared[node] > threshold and ratios[node] <= bar)
        self._between = low, min(refused, default=np.inf)

    def note(self, journal: Journal, gate: str, *, parameter: str, floor: float = -np.inf) -> None:
        """Record the comparison in a journal."""
        journal.compare(
            gate,
            self._tested,
            self._threshold,
            of=self._nodes,
            parameter=parameter,
            floor=floor,
            between=self._between,
        )
