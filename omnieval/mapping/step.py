"""The evidence of one decision: what `Mapper.step` computed, and what it decided.

Whatever shows, stores or judges a replay reads these records and nothing else. Frames are numbered from 0 in
the order in which the mapper saw them, nodes from 1 in the order of their creation.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray


class Verdict(StrEnum):
    """What became of an image at its own step."""

    INITIAL = "initial"
    """One of the first `n_init` images, which make the first node."""
    ASSIGNED = "assigned"
    """Closed a loop: joined the node of its most similar image."""
    PENDING = "pending"
    """Refused by the active nodes, taken by a pending one."""
    NO_CANDIDATE = "no-candidate"
    """Refused: no active node passed the node-level gate (Eq. 4)."""
    PROMINENCE = "prominence"
    """Refused: the best match does not stand out of the similarity curve."""
    CENTROID = "centroid"
    """Refused: the image would move the node's centroid too far (Eq. 9)."""


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
        What happened.
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


@dataclass(frozen=True)
class NodeGate:
    """Node-level loop closure: every active node against the new image (Eq. 4).

    Attributes
    ----------
    x
        The threshold x(C) = max(omega, 3.05 - 0.15 C).
    nodes
        Ids of the C active nodes, ascending, shape (C,).
    ratios
        |Delta - mu_ns| / sigma_ns of each, shape (C,), float64 (signed, without the modulus, when the gate is
        one-sided). A node is a candidate iff its ratio <= x.
    """

    x: float
    nodes: NDArray[np.int64]
    ratios: NDArray[np.float64]

    @property
    def candidates(self) -> NDArray[np.int64]:
        """Ids of the nodes that pass, ascending."""
        return self.nodes[self.ratios <= self.x]


@dataclass(frozen=True)
class Match:
    """Image-level loop closure over the m images of the candidate nodes.

    Attributes
    ----------
    frames
        The images, ordered by node and then time, shape (m,).
    slots
        Where each stands on the curve over all `map_size` images of the map (same order; 0 elsewhere), shape (m,).
    map_size
        Length of that curve: the number of images in active and pending nodes.
    position, orientation, similarity
        s_pos, s_ori (each sums to 1) and their product s, shape (m,), float64.
    shifts
        How many cells image k's orientation descriptor is rolled to align it with the new image's, shape (m,).
    best
        Index of the most similar image within these arrays.
    node
        The node of that image.
    prominence, prominence_mean
        Prominence of the peak at `best`, and the mean it is compared with.
    peaks
        Number of local peaks on the curve.
    """

    frames: NDArray[np.int64]
    slots: NDArray[np.int64]
    map_size: int
    position: NDArray[np.float64]
    orientation: NDArray[np.float64]
    similarity: NDArray[np.float64]
    shifts: NDArray[np.int64]
    best: int
    node: int
    prominence: float
    prominence_mean: float
    peaks: int

    @property
    def best_frame(self) -> int:
        """Frame number of the most similar image."""
        return int(self.frames[self.best])

    @property
    def shift(self) -> int:
        """Cells by which the best image is rolled to align with the new one."""
        return int(self.shifts[self.best])

    @property
    def prominence_ratio(self) -> float:
        """Prominence over its mean; compared with gamma."""
        return self.prominence / self.prominence_mean if self.prominence_mean > 0 else np.inf


@dataclass(frozen=True)
class Centroid:
    """The centroid condition (Eq. 9): the shift of the node's mean against the largest leave-one-out shift."""

    shift: float
    bound: float


@dataclass(frozen=True)
class Margin:
    """How far the nearest comparison of a step was from going the other way, relative to its threshold.

    `gate` names it: ``node``, ``match`` (most similar image of one node against that of the next),
    ``prominence``, ``centroid``, ``pending``, ``merge`` or ``activation``.
    """

    value: float
    gate: str


@dataclass(frozen=True, slots=True)
class Comparison:
    """Values that were compared with a threshold.

    Attributes
    ----------
    gate
        What they were compared for, as `Margin.gate`; or ``run``, the length of a run against `n_new`, which has
        no margin.
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
    """

    gate: str
    values: tuple[float, ...]
    threshold: float
    low: float
    high: float
    parameter: str | None = None
    floor: float = -math.inf
    reaches: bool = False

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
class Step:
    """Everything that was computed to decide about one image, and the decision.

    Attributes
    ----------
    frame
        Number of the image, 0-based.
    verdict
        What became of it.
    node
        The node it belongs to after this step, None while it is unassigned.
    gate
        Node-level loop closure; None for initial images.
    match
        Image-level loop closure; None when there was no candidate.
    centroid
        The centroid condition; None when it was not reached.
    run
        Length of the run of unassigned images, this one included, before a node is made of it; 0 if assigned.
    events
        What happened to nodes, in order.
    active, pending
        Number of active and pending nodes after the step.
    margin
        The step's margin; None when nothing was compared.
    merge_ratio
        Ratio of a new node's representative in the nearest active node (Eq. 11), signed or not as `merge_gate` says,
        which was held against y; with `merge_when` = always that of a grown node too. None where none was compared.
    comparisons
        What was compared on the way to the decision, in order; empty when it is not known.
    """

    frame: int
    verdict: Verdict
    node: int | None
    gate: NodeGate | None
    match: Match | None
    centroid: Centroid | None
    run: int
    events: tuple[NodeEvent, ...]
    active: int
    pending: int
    margin: Margin | None
    merge_ratio: float | None = None
    comparisons: tuple[Comparison, ...] = ()


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
