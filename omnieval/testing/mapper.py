"""The contract of mappers."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from pydantic import BaseModel, ValidationError

from omnieval.descriptors.description import Description
from omnieval.mapping.interface import BranchingMapper
from omnieval.mapping.memory import AHEAD, blocks
from omnieval.mapping.partition import Partition
from omnieval.mapping.step import Comparison, Curves, EventKind, FinalMap, NodeEvent, Placement, Role, Step
from omnieval.mapping.sweep import Points, Sweep
from omnieval.testing.contract import require, same

_VALUES = 3
"""Values of a swept parameter that are tried, of those where its comparisons turn."""


def check_mapper(factory: Callable[[], Any], descriptions: Iterable[Description] | None = None) -> None:
    """Check that a mapper keeps its contract.

    A mapper derives from `omnieval.Mapper`, or is any object with `step` and `finish`.

    - Steps are numbered from 0; a verdict is text, what it means is a `Role`. An image that founds, joins or is taken
      by a pending node has a node, one that is refused has none unless a node was made of it.
    - Comparisons name gates that the mapper declares, with finite values, as many as there are nodes or images they
      belong to; the threshold lies between `low` and `high`; a parameter is one of its settings. Only declared columns
      are measured, only declared curves drawn. The match is an earlier image with the node it had then.
    - Deterministic: two mappers from the factory decide the same, in every number they report.
    - Causal: what comes later changes no step that was returned earlier, and `finish`, called in between, no later one.
    - Input arrays are not changed.
    - Events follow from each other (no node is created twice, merges with or into a missing one, ...).
    - `finish` agrees with steps and events: nodes, active nodes, placements, and the label of every image that got a
      node, followed through merges. Called twice, it returns the same.
    - Of a `BranchingMapper`, parameters that it calls swept act through comparisons alone: a sweep over some of their
      values gives what mappers of their own give.

    Parameters
    ----------
    factory
        Returns a new mapper, configured as it is to be tested; a class is one.
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
    nodes = _check_steps(steps, _Words.of(mapper))
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
    if isinstance(mapper, BranchingMapper):
        _check_swept(mapper, steps, fed)


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


def _run_unchanged(mapper: Any, descriptions: list[Description]) -> tuple[list[Step], Any]:
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


@dataclass(frozen=True)
class _Words:
    """What a mapper declares of its evidence."""

    gates: frozenset[str]
    columns: dict[str, str]
    curves: frozenset[str]
    settings: Any

    @staticmethod
    def of(mapper: Any) -> _Words:
        measured = [column for column in getattr(mapper, "columns", ()) if column.threshold_of is None]
        return _Words(
            frozenset(gate.name for gate in getattr(mapper, "gates", ())),
            {column.name: column.type for column in measured},
            frozenset(getattr(mapper, "curves", ())),
            getattr(mapper, "settings", None),
        )

    def parameter(self, name: str) -> Any:
        """Return the value of a parameter, None if there is none of that name."""
        return self.settings.get(name) if isinstance(self.settings, dict) else getattr(self.settings, name, None)


def _check_steps(steps: list[Step], words: _Words) -> _Nodes:
    nodes, partition = _Nodes(), Partition()
    for number, step in enumerate(steps):
        where = f"step {number}"
        require(isinstance(step, Step), f"{where}: step must return a Step, got {type(step).__name__}")
        require(step.frame == number, f"steps must be numbered from 0, but {where} has frame {step.frame}")
        require(
            isinstance(step.verdict, str) and bool(step.verdict), f"{where}: verdict must be text, got {step.verdict!r}"
        )
        require(isinstance(step.role, Role), f"{where}: role must be a Role, got {step.role!r}")
        placed = step.role in {Role.FOUNDING, Role.JOINED, Role.PENDING}
        made = any(event.kind is EventKind.CREATED for event in step.events)
        require(
            (step.node is not None) == (placed or made),
            f"{where}: role {step.role} and node {step.node} do not go together",
        )
        for comparison in step.comparisons:
            _check_comparison(comparison, words, where)
        _check_measured(step, words, where)
        _check_match(step, partition, words, where)
        for event in step.events:
            nodes.apply(event, where)
        # The founding images know their node before it is made of them.
        require(
            step.node is None or step.node in nodes.alive or (not nodes.created and step.role is Role.FOUNDING),
            f"{where}: its node {step.node} does not exist after the step",
        )
        partition.apply(step)
    return nodes


def _check_comparison(one: Comparison, words: _Words, where: str) -> None:
    gate = f"{where}: the comparison at gate {one.gate!r}"
    require(one.gate in words.gates, f"{gate} names none of the gates that the mapper declares, {sorted(words.gates)}")
    values, of, parameter = tuple(one.values), tuple(one.of), one.parameter
    require(bool(values) and all(map(math.isfinite, values)), f"{gate} must have finite values, got {values}")
    require(
        len(of) == len(values) or (not of and len(values) == 1),
        f"{gate} must say what its values belong to, got {len(of)} nodes or images for {len(values)} values",
    )
    inside = one.low < one.threshold <= one.high if one.reaches else one.low <= one.threshold < one.high
    limits = f"low {one.low:g} and high {one.high:g}"
    require(inside, f"{gate} must have its threshold between {limits}, but it is {one.threshold:g}")
    if parameter is not None:
        given = words.parameter(parameter)
        require(given is not None, f"{gate} names parameter {parameter!r}, which is none of the mapper's settings")
        expected = one.threshold_at(given)
        require(
            one.threshold == expected,
            f"{gate} must have the threshold that {parameter} gives, {expected:g}, but it is {one.threshold:g}",
        )


def _check_measured(step: Step, words: _Words, where: str) -> None:
    unknown = sorted(step.measured.keys() - words.columns.keys())
    require(not unknown, f"{where}: measured {', '.join(unknown)}, but the mapper declares no such column")
    for name, value in step.measured.items():
        whole = words.columns[name] == "int"
        numbers = (int, np.integer) if whole else (int, float, np.integer, np.floating)
        require(
            value is None or (isinstance(value, numbers) and not math.isnan(value)),
            f"{where}: {name} must be {'a whole number' if whole else 'a number'} or None, got {value!r}",
        )


def _check_match(step: Step, before: Partition, words: _Words, where: str) -> None:
    match, labels = step.match, before.labels
    if match is not None:
        known = 0 <= match.frame < step.frame
        require(known, f"{where}: the match must be an earlier image, got {match.frame}")
        label = int(labels[match.frame])
        require(
            label == match.node,
            f"{where}: the match, image {match.frame}, was in node {label or None}, but the step says {match.node}",
        )
    if step.curves is not None:
        _check_curves(step.curves, words, where)


def _check_curves(curves: Curves, words: _Words, where: str) -> None:
    names = curves.values.keys()
    require(words.curves >= names, f"{where}: curves {sorted(names)}, but the mapper declares {sorted(words.curves)}")
    count = len(curves.frames)
    lengths = {len(curves.slots), *map(len, curves.values.values())}
    require(bool(names) and lengths == {count}, f"{where}: curves must have a value for each of their {count} images")
    first = next(iter(curves.values.values()))
    require(
        0 <= curves.best < count and first[curves.best] == first.max(),
        f"{where}: the best image must be the maximum of the first curve, but index {curves.best} is not",
    )
    require(
        bool((curves.slots >= 0).all() and (curves.slots < curves.size).all()),
        f"{where}: slots must lie on the curve over {curves.size} images",
    )


def _check_final(steps: list[Step], final: FinalMap, nodes: _Nodes, dimension: int) -> None:
    left, labels = sorted(nodes.alive), final.labels
    require(list(final.nodes) == left, f"finish: nodes must be those that events leave, {left}, got {final.nodes}")
    require(
        final.active == nodes.active,
        f"finish: active nodes must be those that events leave, {sorted(nodes.active)}, got {sorted(final.active)}",
    )
    require(
        labels.shape == (len(steps),) and labels.dtype == np.int64 and len(final.placements) == len(steps),
        f"finish: labels (int64) and placements must have one entry per image, {len(steps)}, got {labels.shape}",
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
    expected = {Role.JOINED: {Placement.LOOP_CLOSURE}, Role.PENDING: {Placement.PENDING}}
    allowed = {Placement.FOUNDING} if step.frame in nodes.founded else expected.get(step.role, late)
    require(
        placement in allowed, f"{where} is placed as {placement}, which does not follow from its step ({step.role})"
    )
    require((label == 0) == (placement is Placement.UNASSIGNED), f"{where} is {placement} but has label {label}")
    node = nodes.founded.get(step.frame, step.node)
    require(
        node is None or label == nodes.end(node),
        f"{where} got node {node}, which ended as {nodes.end(node or 0)}, but has label {label}",
    )


def _check_swept(mapper: BranchingMapper, steps: list[Step], fed: list[Description]) -> None:
    """Hold a sweep against mappers of their own."""
    variants = tuple(dict.fromkeys(_variants(mapper, steps)))
    sweep = Sweep(type(mapper), [Points(variants)])
    shared: dict[Any, list[Step]] = {settings: [] for settings in variants}
    for taken in sweep.steps(fed):
        for points, step in taken:
            for settings in points.settings:
                shared[settings].append(step)
    finals = {settings: outcome.final for outcome in sweep.finish() for settings in outcome.region.settings}
    for settings in variants:
        alone = type(mapper)(settings)
        changed = {
            name: value for name, value in settings.model_dump().items() if value != getattr(mapper.settings, name)
        }
        said = f"swept parameters must act through comparisons alone, but with {changed}"
        for one, other in zip(shared[settings], _stepped(alone, fed), strict=True):
            require(
                same(_decision(one), _decision(other)),
                f"{said} step {one.frame} is {one.verdict} in a sweep and {other.verdict} alone, or differs in numbers",
            )
        require(same(finals[settings], alone.finish()), f"{said} the final map of a sweep is another than alone")


def _stepped(mapper: BranchingMapper, fed: list[Description]) -> Iterator[Step]:
    """Yield the steps of a mapper that knows what comes, which may save it time and must change no step."""
    for block in blocks(fed, AHEAD):
        mapper.expect(block)
        yield from map(mapper.step, block)


def _variants(mapper: BranchingMapper, steps: list[Step]) -> Iterable[BaseModel]:
    """Yield settings that differ in one swept parameter: half, double, and values at which its comparisons turn."""
    yield mapper.settings
    for name in mapper.swept:
        given: Any = getattr(mapper.settings, name, None)
        require(given is not None, f"{name} is swept, but none of the mapper's settings")
        compared = [one.values for step in steps for one in step.comparisons if one.parameter == name]
        turning = np.unique(np.concatenate(compared)) if compared else np.empty(0)
        chosen = turning[np.linspace(0, len(turning) - 1, _VALUES).astype(int)] if len(turning) else turning
        for value in (given / 2, given * 2, *chosen.tolist()):
            try:
                yield type(mapper.settings).model_validate({**mapper.settings.model_dump(), name: value})
            except ValidationError:
                continue  # it cannot be set, so nobody sweeps over it


def _decision(step: Step) -> Step:
    """Return a step without what a shared one need not have: thresholds of its own, and curves."""
    return dataclasses.replace(step, comparisons=(), curves=None)
