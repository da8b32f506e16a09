"""Valley: a node ends where the last images fall into two groups; it is an old one if the two are each other's nearest.

The node creation of a method of 2026, from descriptors alone. How well the images of a window hang together is the
second smallest eigenvalue of the normalised Laplacian of their similarities (M. Fiedler 1973; U. von Luxburg, *A
Tutorial on Spectral Clustering*, doi 10.1007/s11222-007-9033-z): it has a valley where the robot passes a border.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from statistics import median

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field
from scipy.linalg import eigh

from omnieval.descriptors.description import Description
from omnieval.mapping.interface import Column, Gate, Mapper
from omnieval.mapping.journal import Journal
from omnieval.mapping.memory import ImageMemory
from omnieval.mapping.step import EventKind, FinalMap, Match, NodeEvent, Placement, Role, Step

_MAD = 1.4826
"""Standard deviations of a normal distribution in a median absolute deviation."""
_NO_SPREAD = 1e-12
"""Stands for a deviation of zero."""


class ValleySettings(BaseModel):
    """Parameters of `Valley`."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    window: int = Field(30, ge=3, le=200, description="images whose similarities are looked at together")
    rise: float = Field(2.0, gt=0, le=100, description="rise above the lowest value that ends a node, in deviations")
    history: int = Field(300, ge=3, le=100_000, description="values that these deviations are taken over, at most")
    warm_up: int = Field(30, ge=2, le=10_000, description="values before the first node can end")
    distinct: float = Field(2.0, ge=0, le=100, description="what a similarity must stand out by, in deviations")
    least: float = Field(0.5, ge=-1, le=1, description="similarity that nodes at one place have at least")
    from_nodes: int = Field(5, ge=3, le=10_000, description="nodes from which on one can be visited again")
    in_a_row: int = Field(3, ge=1, le=1000, description="images in a row that must find the same old node")


class Valley(Mapper):
    """Ends a node at a valley of the algebraic connectivity of the last images."""

    name = "valley"
    Settings = ValleySettings
    gates = (
        Gate(
            name="valley",
            value="rise above the lowest value, in deviations",
            threshold="rise",
            passing="end the node",
            refusing="go on in the node",
            plot_to=0,
        ),
        Gate(
            name="distinct",
            value="by how much the similarity stands out, in deviations",
            threshold="distinct",
            passing="let the node be one visited before",
            refusing="keep the node a new one",
            plot_to=0,
        ),
        Gate(
            name="least",
            value="similarity of the nodes",
            threshold="least",
            passing="let the node be one visited before",
            refusing="keep the node a new one",
            plot_to=1.0,
        ),
        Gate(
            name="mutual",
            value="similarity of the nodes",
            threshold="similarity of the old node with the one most like it",
            passing="let the node be one visited before",
            refusing="keep the node a new one",
        ),
        Gate(
            name="row",
            value="images in a row",
            threshold="in_a_row",
            passing="let the node be one visited before",
            refusing="keep the node a new one",
        ),
    )
    columns = (
        Column(name="connectivity", type="float", meaning="second smallest eigenvalue of the window", plotted=True),
    )

    def __init__(self, settings: ValleySettings | None = None) -> None:
        super().__init__(settings)
        self._images = ImageMemory()
        self._window: deque[NDArray[np.float64]] = deque(maxlen=self.settings.window)
        self._values: deque[float] = deque(maxlen=self.settings.history)
        self._extreme = np.inf
        self._falls = True
        self._labels: list[int] = []
        self._founding: list[int] = []
        self._sums: dict[int, NDArray[np.float64]] = {}
        self._created = 0
        self._at = 0
        self._is_new = True
        self._row = (0, 0)  # an old node, and how many images in a row have found it

    def step(self, description: Description) -> Step:
        """See `Mapper.step`."""
        frame, journal = self._images.append(description), Journal()
        position = self._images.position(frame)
        unit = position / (float(np.linalg.norm(position)) or 1.0)
        self._window.append(unit)
        if frame == 0:
            return self._found(frame, unit, "first", journal, {})
        value = connectivity(np.array(self._window))
        measured = {"connectivity": value}
        ends = self._is_valley(value, journal)
        if ends:
            return self._found(frame, unit, "valley", journal, measured)
        self._labels.append(self._at)
        self._sums[self._at] = self._sums[self._at] + unit
        again = self._visited_again(journal)
        if again is None:
            return Step(frame, "onward", Role.JOINED, self._at, None, (), tuple(journal.comparisons), measured)
        match = self._match(frame, again)
        merged = NodeEvent(EventKind.MERGED, self._at, into=again)
        self._sums[again] = self._sums[again] + self._sums.pop(self._at)
        self._labels = [again if node == self._at else node for node in self._labels]
        self._at, self._is_new, self._row = again, False, (0, 0)
        return Step(frame, "revisit", Role.JOINED, again, match, (merged,), tuple(journal.comparisons), measured)

    def finish(self) -> FinalMap:
        """See `Mapper.finish`."""
        labels = np.array(self._labels, np.int64)
        placements = [Placement.LOOP_CLOSURE] * len(labels)
        for frame in self._founding:
            placements[frame] = Placement.FOUNDING
        nodes = tuple(sorted(self._sums))
        means = [self._images.positions(np.flatnonzero(labels == node)).mean(axis=0) for node in nodes]
        representatives = np.stack(means) if means else np.empty((0, 0))
        return FinalMap(labels, tuple(placements), nodes, frozenset(nodes), representatives)

    def expect(self, descriptions: Sequence[Description]) -> None:
        """See `Mapper.expect`."""
        self._images.expect(descriptions)

    def _is_valley(self, value: float, journal: Journal) -> bool:
        """Return whether the value has come far enough out of a valley; there is no other before it has fallen as far.

        So a rise that goes on is not a second valley. What the value is compared with is its lowest, then its highest.
        """
        ends = turned = False
        if len(self._values) >= self.settings.warm_up:
            deviation = _deviation(list(self._values))
            if self._falls:
                rise = (value - self._extreme) / deviation
                ends = turned = journal.reach("valley", rise, self.settings.rise, parameter="rise")
            else:
                turned = (self._extreme - value) / deviation >= self.settings.rise
        if turned:
            self._falls = not self._falls
        self._extreme = value if turned else (min if self._falls else max)(self._extreme, value)
        self._values.append(value)
        return ends

    def _visited_again(self, journal: Journal) -> int | None:
        """Return the old node that the present one turns out to be, None if it is none."""
        if not self._is_new or len(self._sums) < self.settings.from_nodes:
            return None
        nodes = list(self._sums)
        means = np.array([total / (float(np.linalg.norm(total)) or 1.0) for total in self._sums.values()])
        similarities = means @ means.T
        np.fill_diagonal(similarities, -np.inf)
        here = nodes.index(self._at)
        best = int(similarities[here].argmax())
        similarity = float(similarities[here, best])
        others = np.delete(similarities[here], [here, best]).tolist()
        stands_out = (similarity - median(others)) / _deviation(others)
        passed = (
            journal.reach("distinct", stands_out, self.settings.distinct, parameter="distinct")
            and journal.reach("least", similarity, self.settings.least, parameter="least")
            and journal.reach("mutual", similarity, float(similarities[best].max()))
        )
        node, row = self._row
        row = (row + 1 if node == nodes[best] else 1) if passed else 0
        self._row = nodes[best], row
        if passed and journal.reach("row", row, self.settings.in_a_row, parameter="in_a_row", counts=True):
            return nodes[best]
        return None

    def _match(self, frame: int, node: int) -> Match:
        """Return the nearest image of an old node."""
        members = np.flatnonzero(np.array(self._labels) == node)
        compared = self._images.compare(frame, members)
        best = int(compared.position.argmin())
        return Match(int(members[best]), node, int(compared.shifts[best]))

    def _found(
        self, frame: int, unit: NDArray[np.float64], verdict: str, journal: Journal, measured: dict[str, float]
    ) -> Step:
        self._created += 1
        self._at, self._is_new, self._row = self._created, True, (0, 0)
        self._sums[self._at] = unit
        self._labels.append(self._at)
        self._founding.append(frame)
        events = NodeEvent(EventKind.CREATED, self._at, frames=(frame,)), NodeEvent(EventKind.ACTIVATED, self._at)
        return Step(frame, verdict, Role.FOUNDING, self._at, None, events, tuple(journal.comparisons), measured)


def connectivity(units: NDArray[np.float64]) -> float:
    """Return the second smallest eigenvalue of the normalised Laplacian of unit vectors, shape (n, d), n at least 2.

    Affinities are cosines, clipped at 0. The eigenvalue is 0 where the vectors fall into groups that have nothing in
    common, and n / (n - 1) where all are the same.
    """
    affinity = np.clip(units @ units.T, 0.0, None)
    np.fill_diagonal(affinity, 0.0)
    degree = affinity.sum(axis=1)
    scale = 1.0 / np.sqrt(np.where(degree > 0, degree, 1.0))
    laplacian = np.diag((degree > 0).astype(np.float64)) - scale[:, np.newaxis] * affinity * scale
    return float(eigh(laplacian, eigvals_only=True, subset_by_index=(0, 1), check_finite=False)[1])


def _deviation(values: list[float]) -> float:
    """Return the robust standard deviation of some values."""
    middle = median(values)
    return _MAD * median(abs(value - middle) for value in values) or _NO_SPREAD
