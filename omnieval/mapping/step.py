"""The evidence of one decision: what a mapper compared at a step, what it measured, and what it decided.

Every mapper says this in the same words, so whatever shows, stores or judges a replay reads these records and nothing
else. Frames are numbered from 0 in the order in which the mapper saw them, nodes from 1 in the order of their creation.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

Number = float | int | None


class Role(StrEnum):
    """What a verdict means, whatever word a mapper has for it."""

    FOUNDING = "founding"
    """Makes a node without having been compared with any."""
    JOINED = "joined"
    """Closed a loop: joined a node that was there."""
    PENDING = "pending"
    """Joined a node with which no loop can be closed yet."""
    REFUSED = "refused"
    """Compared with nodes, and refused by all of them; it may found a node nevertheless."""
    UNASSIGNED = "unassigned"
    """Left without a node for another reason."""


class EventKind(StrEnum):
    """What can happen to a node."""

    CREATED = "created"
    MERGED = "merged"
    ACTIVATED = "activated"


@dataclass(frozen=True, slots=True)
class NodeEvent:
    """A node was created, activated, or merged into another.

    Attributes
    ----------
    kind
        What happened. Loops can be closed with a node from its activation on.
    node
        The node it happened to. A node that merges is gone afterwards.
    into
        The node that absorbed it, for `MERGED`; else None.
    frames
        The images the node was created from, for `CREATED`; else empty.
    """

    kind: EventKind
    node: int
    into: int | None = None
    frames: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True)
class Match:
    """The image of the map that an image was found most similar to.

    Attributes
    ----------
    frame
        Its number.
    node
        Its node at that step.
    shift
        How many cells its orientation descriptor is rolled to align it with the new image's.
    """

    frame: int
    node: int
    shift: int = 0


@dataclass(frozen=True, slots=True)
class Margin:
    """How far the nearest comparison of a step was from going the other way, relative to its threshold; its gate."""

    value: float
    gate: str


@dataclass(frozen=True, slots=True)
class Comparison:
    """Values that were compared with a threshold. It passes if any of them is on the right side.

    Attributes
    ----------
    gate
        What they were compared for: one of the gates that the mapper declares.
    values
        What was compared, at least one.
    threshold
        With what.
    low, high
        Between which thresholds the decision is the same. A threshold that equals `low` is within and one that equals
        `high` is not; the other way round where values have to reach the threshold.
    parameter
        The parameter the threshold comes from; None if it comes from none.
    floor
        What the threshold is at least, whatever the parameter.
    reaches
        Whether values have to reach the threshold, rather than stay at or below it.
    of
        The nodes or images (as the gate says) that the values belong to, in their order; empty where there is but one
        value.
    counts
        Whether whole numbers are compared, which are never nearly equal: there is no margin.
    """

    gate: str
    values: tuple[float, ...]
    threshold: float
    low: float
    high: float
    parameter: str | None = None
    floor: float = -math.inf
    reaches: bool = False
    of: tuple[int, ...] = ()
    counts: bool = False

    @property
    def passed(self) -> bool:
        """Whether any value is on the right side of the threshold."""
        return self.best >= self.threshold if self.reaches else self.best <= self.threshold

    @property
    def best(self) -> float:
        """The value that is nearest to passing, or passes by the most."""
        return max(self.values) if self.reaches else min(self.values)

    @property
    def passing(self) -> tuple[int, ...]:
        """The nodes or images whose values pass, in their order."""
        return tuple(
            one
            for one, value in zip(self.of, self.values, strict=False)
            if (value >= self.threshold if self.reaches else value <= self.threshold)
        )

    def value_of(self, one: int) -> float | None:
        """Return the value of a node or image, None if it was not compared."""
        return self.values[self.of.index(one)] if one in self.of else None

    def margin_at(self, threshold: float) -> float:
        """Return how far the nearest value is from a threshold, relative to it."""
        return min([abs(value - threshold) for value in self.values]) / (abs(threshold) or 1.0)

    def threshold_at(self, value: float) -> float:
        """Return the threshold when the parameter has another value."""
        return max(value, self.floor)

    def same_at(self, value: float) -> bool:
        """Whether the decision would be the same if the parameter had another value."""
        threshold = self.threshold_at(value)
        return self.low < threshold <= self.high if self.reaches else self.low <= threshold < self.high

    @property
    def span(self) -> tuple[float, float]:
        """The parameter values at which the decision is the same, from the first up to below the second."""
        low, high = self.low, self.high
        if self.reaches:
            low, high = float(np.nextafter(low, np.inf)), float(np.nextafter(high, np.inf))
        return (-math.inf if low <= self.floor else low), high


@dataclass(frozen=True)
class Curves:
    """How similar an image is to m images of the map, by one or several measures; the mapper declares their names.

    Attributes
    ----------
    frames
        The images, ordered by node and then time, shape (m,).
    slots
        Where each stands on the curve over all `size` images of the map (same order; 0 elsewhere), shape (m,).
    size
        Length of that curve.
    values
        The measures by name, shape (m,) each; the best image is the maximum of the first.
    best
        Index of the best image within these arrays.
    level
        How high the first curve must be at the best image to pass, relative to what it is there; None if nothing asks.
    """

    frames: NDArray[np.int64]
    slots: NDArray[np.int64]
    size: int
    values: Mapping[str, NDArray[np.float64]]
    best: int
    level: float | None = None


@dataclass(frozen=True)
class Step:
    """Everything that was computed to decide about one image, and the decision.

    Attributes
    ----------
    frame
        Number of the image, 0-based.
    verdict
        What became of it, in the mapper's own word.
    role
        What that word means.
    node
        The node it belongs to after this step, None while it is unassigned.
    match
        The image of the map that it was found most similar to; None where there is none.
    events
        What happened to nodes, in order.
    comparisons
        What was compared on the way to the decision, in order.
    measured
        What else the mapper declares to measure, by the names of its columns.
    curves
        Similarities to images of the map. They are not in the tables: a run that is read back has none.
    """

    frame: int
    verdict: str
    role: Role
    node: int | None = None
    match: Match | None = None
    events: tuple[NodeEvent, ...] = ()
    comparisons: tuple[Comparison, ...] = ()
    measured: Mapping[str, Number] = field(default_factory=dict)
    curves: Curves | None = None

    @cached_property
    def margin(self) -> Margin | None:
        """How near the step was to going another way; None when nothing was compared."""
        return smallest_margin(self.comparisons)

    def compared(self, gate: str) -> Comparison | None:
        """Return the first comparison of a gate, None if there is none."""
        return next((one for one in self.comparisons if one.gate == gate), None)

    def seen_by(self, settings: Any) -> Step:
        """Return the step as a mapper with other `settings` reports it, for which every comparison has the same result.

        It has that mapper's thresholds and no curves, whose level is another one.
        """
        comparisons = tuple(
            one
            if one.parameter is None
            else dataclasses.replace(one, threshold=one.threshold_at(getattr(settings, one.parameter)))
            for one in self.comparisons
        )
        return dataclasses.replace(self, comparisons=comparisons, curves=None)


def smallest_margin(comparisons: Iterable[Comparison], settings: Any = None) -> Margin | None:
    """Return how near a step was to going another way; None when nothing was compared.

    `settings` give the thresholds, if they are not those of the comparisons; every comparison must come out the same
    with them.
    """
    smallest: Margin | None = None
    for one in comparisons:
        if one.counts:
            continue
        threshold = one.threshold
        if settings is not None and one.parameter is not None:
            threshold = one.threshold_at(getattr(settings, one.parameter))
        value = one.margin_at(threshold)
        if smallest is None or value < smallest.value:
            smallest = Margin(value, one.gate)
    return smallest


class Placement(StrEnum):
    """How an image came to its node in the final map."""

    FOUNDING = "founding"
    """One of the images its node was made of."""
    LOOP_CLOSURE = "loop-closure"
    """Assigned at its own step."""
    PENDING = "pending"
    """Taken by a pending node at its own step."""
    RETEST = "retest"
    """A leftover that the final map accepted."""
    FORCED = "forced"
    """A leftover put into the node of its most similar image."""
    UNASSIGNED = "unassigned"
    """Belongs to no node."""


@dataclass(frozen=True)
class FinalMap:
    """The partition of the images when the sequence has ended.

    Attributes
    ----------
    labels
        Node of every image, 0 where unassigned, shape (n,).
    placements
        How every image came there, length n.
    nodes
        Ids of the nodes of the map, ascending.
    active
        The active ones among them.
    representatives
        Mean position descriptor of each node over its images (leftovers excluded), shape (nodes, d), float64.
    """

    labels: NDArray[np.int64]
    placements: tuple[Placement, ...]
    nodes: tuple[int, ...]
    active: frozenset[int]
    representatives: NDArray[np.float64]
