"""The words of the method's evidence: its verdicts, what it compares, what else it measures.

Equations and sections are those of Román et al., doi 10.3390/app10186480.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from omnieval.mapping.interface import Column, Gate
from omnieval.mapping.step import Role


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


ROLES = {
    Verdict.INITIAL: Role.FOUNDING,
    Verdict.ASSIGNED: Role.JOINED,
    Verdict.PENDING: Role.PENDING,
    Verdict.NO_CANDIDATE: Role.REFUSED,
    Verdict.PROMINENCE: Role.REFUSED,
    Verdict.CENTROID: Role.REFUSED,
}

GATES = (
    Gate(
        name="node",
        value="gate ratio",
        threshold="x",
        passing="make node {one} a candidate",
        refusing="drop node {one} as a candidate",
        of="node",
        closes=True,
        plot_to=6.0,
    ),
    Gate(
        name="match",
        value="similarity of the best image of another candidate node",
        threshold="that of the best image",
        of="node",
    ),
    Gate(name="peaks", value="peaks of the similarity curve", threshold="number needed to compare", closes=True),
    Gate(name="prominence", value="prominence over the mean", threshold="gamma", closes=True, plot_to=20.0),
    Gate(name="centroid", value="shift of the node's mean", threshold="bound", closes=True, plot_to=0),
    Gate(
        name="pending",
        value="gate ratio",
        threshold="x",
        passing="let it join pending node {one}",
        refusing="keep it out of pending node {one}",
        of="node",
    ),
    Gate(name="run", value="unassigned images in a row", threshold="n_new", passing="make a node of the run"),
    Gate(
        name="merge",
        value="gate ratio of the node's representative",
        threshold="merge_y",
        passing="let the node merge into node {one}",
        refusing="keep the node apart from node {one}",
        of="node",
    ),
    Gate(
        name="activation",
        value="mean distance of the node from the active ones",
        threshold="their mean distance from each other",
        passing="activate the node",
        refusing="keep the node pending",
    ),
)

COLUMNS = (
    Column(name="x_gate", type="float", meaning="threshold x(C) of the node-level gate (Eq. 4)", threshold_of="node"),
    Column(name="similarity_position", type="float", meaning="s_pos of the best match"),
    Column(name="similarity_orientation", type="float", meaning="s_ori of the best match"),
    Column(name="similarity", type="float", meaning="s = s_pos s_ori of the best match"),
    Column(name="prominence", type="float", meaning="prominence of the peak at the best match"),
    Column(name="prominence_mean", type="float", meaning="mean prominence it is compared with"),
    Column(name="prominence_ratio", type="float", meaning="their ratio, which has to reach gamma"),
    Column(name="peaks", type="int", meaning="peaks of the similarity curve"),
    Column(name="centroid_shift", type="float", meaning="how far the image would shift the node's mean (Eq. 9)"),
    Column(name="centroid_bound", type="float", meaning="how far it may: the largest leave-one-out shift (Eq. 9)"),
    Column(
        name="merge_ratio",
        type="float",
        meaning="smallest gate ratio of a new node's representative in an active node, compared with merge_y (Eq. 11)",
    ),
    Column(name="run", type="int", meaning="unassigned images in a row, this one included; 0 if it is assigned"),
)

CURVES = ("similarity", "position", "orientation")


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
class ImageMatch:
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
