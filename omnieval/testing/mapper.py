"""The contract of mappers."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

import numpy as np

from omnieval.descriptors.description import Description
from omnieval.mapping.interface import IncrementalMapper
from omnieval.mapping.step import EventKind, FinalMap, NodeEvent, Placement, Step, Verdict
from omnieval.testing.contract import require, same


def check_mapper(factory: Callable[[], IncrementalMapper], descriptions: Iterable[Description] | None = None) -> None:
    """Check that a mapper keeps its contract.

    - Steps are numbered from 0; an image that is assigned or taken by a pending node has a node, one that is refused
      has none unless a node was made of its run.
    - Deterministic: two mappers from the factory decide the same, in every number they report.
    - Causal: what comes later changes no step that was returned earlier, and `finish`, called in between, no later one.
    - Input arrays are not changed.
    - Events follow from each other (no node is created twice, merges with or into a missing one, ...) and the counts
      of active and pending nodes follow from them.
    - `finish` agrees with steps and events: nodes, active nodes, placements, and the label of every image that got a
      node, followed through merges. Called twice, it returns the same.

    Parameters
    ----------
    factory
        Returns a new mapper, configured as it is to be tested.
    descriptions
        What it is fed, in order, so many that two thirds of them make a first node; by default 240 images of four
        places, visited in turn and then again.

    Raises
    ------
    AssertionError
        At the first clause that does not hold.
    """
    fed = _descriptions() if descriptions is None else list(descriptions)
    steps, mapper = _run_unchanged(factory(), fed)
    nodes = _check_steps(steps)
    interrupted = factory()
    cut = 2 * len(fed) // 3
    repeated = [interrupted.step(description) for description in fed[:cut]]
    # Those of the first mapper have seen the rest of the images.
    _require_equal(repeated, steps[:cut], "equal images must give equal steps, which stay as they are afterwards")
    interrupted.finish()
    later = [interrupted.step(description) for description in fed[cut:]]
    _require_equal(later, steps[cut:], "finish must leave the map as it is, but later steps differ")
    final = mapper.finish()
    require(same(mapper.finish(), final), "finish must return the same when called twice")
    require(same(interrupted.finish(), final), "equal steps must end in equal maps, but finish differs")
    _check_final(steps, final, nodes, fed[0].position.size)


def _descriptions() -> list[Description]:
    """Return what a robot sees that drives circuits in four places, in turn and then again, with random headings."""
    rng = np.random.default_rng(6480)
    position = rng.normal(size=(4, 3, 16)) * np.array([1.0, 0.3, 0.3])[:, np.newaxis]
    orientation = rng.normal(size=(4, 3, 32, 4)) * np.array([1.0, 0.3, 0.3])[:, np.newaxis, np.newaxis]
    seen = []
    for place in (0, 1, 2, 3, 0, 2, 1, 3):
        for turn in np.arange(30) * 2 * np.pi / 20 + rng.uniform(0, 2 * np.pi):
            wave = np.array([1.0, np.cos(turn), np.sin(turn)])
            at = np.tensordot(wave, position[place], 1) + rng.normal(0, 0.02, 16)
            around = np.tensordot(wave, orientation[place], 1) + rng.normal(0, 0.02, (32, 4))
            turned = np.roll(around, int(rng.integers(32)), axis=0)
            seen.append(Description(at.astype(np.float32), turned.astype(np.float32)))
    return seen


def _run_unchanged(mapper: IncrementalMapper, descriptions: list[Description]) -> tuple[list[Step], IncrementalMapper]:
    """Feed a mapper copies of the descriptions, and see that they stay as they are."""
    copies = [Description(one.position.copy(), one.orientation.copy()) for one in descriptions]
    steps = [mapper.step(copy) for copy in copies]
    mapper.finish()
    for number, (copy, given) in enumerate(zip(copies, descriptions, strict=True)):
        require(same(copy, given), f"a mapper must not change its input, but changed the arrays of image {number}")
    return steps, mapper


def _require_equal(found: list[Step], expected: list[Step], message: str) -> None:
    for one, other in zip(found, expected, strict=True):
        require(same(one, other), f"{message} (step {other.frame})")


@dataclass
class _Nodes:
    """The nodes that exist, are active and were ever created, as far as events tell."""

    alive: set[int] = field(default_factory=set)
    active: set[int] = field(default_factory=set)
    created: set[int] = field(default_factory=set)
    into: dict[int, int] = field(default_factory=dict)
    founded: dict[int, int] = field(default_factory=dict)

    def apply(self, event: NodeEvent, where: str) -> None:
        """Let an event happen, if it can."""
        node, into = event.node, event.into
        if event.kind is EventKind.CREATED:
            require(
                node > 0 and node not in self.created, f"{where}: created node {node}, but ids are new and positive"
            )
            self.alive.add(node)
            self.created.add(node)
            self.founded.update(dict.fromkeys(event.frames, node))
            return
        require(node in self.alive, f"{where}: node {node} was {event.kind} but does not exist")
        if event.kind is EventKind.ACTIVATED:
            require(node not in self.active, f"{where}: node {node} was activated twice")
            self.active.add(node)
            return
        require(into in self.alive and into != node, f"{where}: node {node} merged into {into}, which does not exist")
        self.alive.discard(node)
        self.active.discard(node)
        self.into[node] = into or 0

    def end(self, node: int) -> int:
        """Return the node in which one ends after all merges."""
        while node in self.into:
            node = self.into[node]
        return node


def _check_steps(steps: list[Step]) -> _Nodes:
    nodes = _Nodes()
    for number, step in enumerate(steps):
        where = f"step {number}"
        require(step.frame == number, f"steps must be numbered from 0, but {where} has frame {step.frame}")
        require(isinstance(step.verdict, Verdict), f"{where}: verdict must be a Verdict, got {step.verdict!r}")
        placed = step.verdict in {Verdict.INITIAL, Verdict.ASSIGNED, Verdict.PENDING}
        made = any(event.kind is EventKind.CREATED for event in step.events)
        require(
            (step.node is not None) == (placed or made),
            f"{where}: verdict {step.verdict} and node {step.node} do not go together",
        )
        for event in step.events:
            nodes.apply(event, where)
        require(
            (step.active, step.pending) == (len(nodes.active), len(nodes.alive - nodes.active)),
            f"{where}: reports {step.active} active and {step.pending} pending nodes, but its events leave "
            f"{len(nodes.active)} and {len(nodes.alive - nodes.active)}",
        )
        # The initial images know their node before it is made of them.
        require(
            step.node is None or step.node in nodes.alive or (not nodes.created and step.verdict is Verdict.INITIAL),
            f"{where}: its node {step.node} does not exist after the step",
        )
    return nodes


def _check_final(steps: list[Step], final: FinalMap, nodes: _Nodes, dimension: int) -> None:
    left, labels = sorted(nodes.alive), final.labels
    require(list(final.nodes) == left, f"finish: nodes must be those that events leave, {left}, got {final.nodes}")
    require(
        final.active == nodes.active,
        f"finish: active nodes must be those that events leave, {sorted(nodes.active)}, got {sorted(final.active)}",
    )
    require(
        labels.shape == (len(steps),) and labels.dtype == np.int64 and len(final.placements) == len(steps),
        f"finish: labels (int64) and placements must have one entry an image, {len(steps)}, got {labels.shape}",
    )
    require(set(labels.tolist()) - {0} == set(left), "finish: labels must be 0 or nodes, and no node be empty")
    shape = (len(left), dimension)
    require(
        final.representatives.shape == shape and bool(np.isfinite(final.representatives).all()),
        f"finish: representatives must be finite and of shape {shape}, got {final.representatives.shape}",
    )
    for step, label, placement in zip(steps, labels.tolist(), final.placements, strict=True):
        _check_placement(step, label, placement, nodes)


def _check_placement(step: Step, label: int, placement: Placement, nodes: _Nodes) -> None:
    where = f"finish: image {step.frame}"
    late = {Placement.RETEST, Placement.FORCED, Placement.UNASSIGNED}
    expected = {Verdict.ASSIGNED: {Placement.LOOP_CLOSURE}, Verdict.PENDING: {Placement.PENDING}}
    allowed = {Placement.FOUNDING} if step.frame in nodes.founded else expected.get(step.verdict, late)
    require(
        placement in allowed, f"{where} is placed as {placement}, which does not follow from its step ({step.verdict})"
    )
    require((label == 0) == (placement is Placement.UNASSIGNED), f"{where} is {placement} but has label {label}")
    node = nodes.founded.get(step.frame, step.node)
    require(
        node is None or label == nodes.end(node),
        f"{where} got node {node}, which ended as {nodes.end(node or 0)}, but has label {label}",
    )
