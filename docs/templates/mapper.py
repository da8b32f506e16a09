"""A mapper of your own, to start from: ``cp docs/templates/mapper.py mine.py``, ``pytest mine.py``.

Replay with it: ``omnieval replay --mapper mine.py:MyMapper --set reach=0.1``.
"""

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from omnieval import (
    Comparison,
    Description,
    EventKind,
    FinalMap,
    Gate,
    Mapper,
    Match,
    NodeEvent,
    Placement,
    Role,
    Step,
)
from omnieval.testing import check_mapper


class MySettings(BaseModel):
    """Parameters: each has a default, a range and a meaning, and can be set by its name."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    reach: float = Field(0.05, gt=0, le=2, description="how near the first image of a node has to be, 1 - cosine")


class MyMapper(Mapper):
    """Joins an image to the node whose first image is the most alike, if it is near enough, or makes a node of it."""

    name = "my-mapper"
    Settings = MySettings
    gates = (Gate(name="reach", value="distance", threshold="reach", of="node", closes=True, plot_to=0),)

    def __init__(self, settings: MySettings | None = None) -> None:
        super().__init__(settings)
        self._positions: list[np.ndarray] = []
        self._labels: list[int] = []
        self._first: list[int] = []

    def step(self, description: Description) -> Step:
        """Decide about the next image."""
        frame = len(self._labels)
        position = description.position.astype(np.float64)
        self._positions.append(position / (np.linalg.norm(position) or 1.0))
        if not self._first:
            return self._new_node(frame, Role.FOUNDING)
        distances = tuple(float(1 - self._positions[frame] @ self._positions[first]) for first in self._first)
        nearest, reach = min(distances), self.settings.reach
        # Between which values of the threshold the decision is the same: margins and "would flip" come from here.
        low, high = (nearest, np.inf) if nearest <= reach else (-np.inf, nearest)
        nodes = tuple(range(1, len(self._first) + 1))
        compared = Comparison("reach", distances, reach, low, high, parameter="reach", of=nodes)
        if not compared.passed:
            return self._new_node(frame, Role.REFUSED, compared)
        node = distances.index(nearest) + 1
        self._labels.append(node)
        return Step(frame, "near", Role.JOINED, node, Match(self._first[node - 1], node), comparisons=(compared,))

    def finish(self) -> FinalMap:
        """Return the map of all images so far, and leave it as it is: more steps may come."""
        labels, positions = np.array(self._labels), np.stack(self._positions)
        nodes = tuple(range(1, len(self._first) + 1))
        means = np.stack([positions[labels == node].mean(axis=0) for node in nodes])
        kinds = (Placement.LOOP_CLOSURE, Placement.FOUNDING)
        placements = tuple(kinds[frame in self._first] for frame in range(len(labels)))
        return FinalMap(labels, placements, nodes, frozenset(nodes), means)

    def _new_node(self, frame: int, role: Role, *compared: Comparison) -> Step:
        self._first.append(frame)
        node = len(self._first)
        self._labels.append(node)
        events = (NodeEvent(EventKind.CREATED, node, frames=(frame,)), NodeEvent(EventKind.ACTIVATED, node))
        return Step(frame, "new", role, node, events=events, comparisons=compared)


def test_it_keeps_the_contract_of_mappers():
    check_mapper(MyMapper)
    check_mapper(lambda: MyMapper(MySettings(reach=0.5)))
