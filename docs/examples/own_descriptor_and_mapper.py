"""A descriptor and a mapper of your own, checked against their contracts and judged like omnieval's.

    python docs/examples/own_descriptor_and_mapper.py [SOURCE] [LIMIT]

The descriptor keeps mean and spread of the grey levels in bands of rows and of columns. The mapper puts an image into
the node whose first image is nearest, or makes a node of it if none is near: one gate, no second thoughts.
"""

from __future__ import annotations

import itertools
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray
from pydantic import BaseModel, Field

import omnieval
from omnieval.testing import check_descriptor, check_mapper

SHOWN = ("nodes", "silhouette", "silhouette_image", "silhouette_time_slices", "rooms_ari", "share_assigned")


class GreyBands:
    """Mean and standard deviation of the grey levels of 32 bands of rows, and of 128 of columns."""

    rows, columns = 32, 128

    def describe(self, panorama: NDArray[np.uint8]) -> omnieval.Description:
        """Describe one grey panorama; columns that a rotation rolls become rows of `orientation` that it rolls."""
        rows = panorama.reshape(self.rows, -1)
        columns = panorama.T.reshape(self.columns, -1)
        position = np.concatenate([rows.mean(axis=1), rows.std(axis=1)])
        orientation = np.stack([columns.mean(axis=1), columns.std(axis=1)], axis=1)
        return omnieval.Description(position.astype(np.float32), orientation.astype(np.float32))


class FirstImageSettings(BaseModel):
    """Parameters of `FirstImage`."""

    reach: float = Field(3.0, gt=0, description="near enough is within so many median distances of successive images")


class FirstImage(omnieval.Mapper):
    """Puts an image into the node whose first image is nearest, or makes a node of it."""

    name = "first-image"
    Settings = FirstImageSettings
    gates = (
        omnieval.Gate(
            name="distance",
            value="distance from the first image",
            threshold="reach",
            passing="let it join node {one}",
            of="node",
            closes=True,
        ),
    )

    def __init__(self, settings: FirstImageSettings | None = None) -> None:
        super().__init__(settings)
        self._positions: list[NDArray[np.float64]] = []
        self._nodes: list[int] = []
        self._first: list[int] = []
        self._hops: list[float] = []

    def step(self, description: omnieval.Description) -> omnieval.Step:
        """Decide about the next image."""
        frame, position = len(self._positions), description.position.astype(np.float64)
        self._positions.append(position)
        if frame == 0:
            return self._found(frame, omnieval.Role.FOUNDING)
        self._hops.append(float(np.linalg.norm(position - self._positions[-2])))
        distances = [float(np.linalg.norm(position - self._positions[first])) for first in self._first]
        values = tuple(distance / (np.median(self._hops) or 1.0) for distance in distances)
        nearest, reach = min(values), self.settings.reach
        low, high = (nearest, np.inf) if nearest <= reach else (-np.inf, nearest)
        nodes = tuple(range(1, len(values) + 1))
        compared = omnieval.Comparison("distance", values, reach, low, high, parameter="reach", of=nodes)
        if not compared.passed:
            return self._found(frame, omnieval.Role.REFUSED, compared)
        node = values.index(nearest) + 1
        self._nodes.append(node)
        match = omnieval.Match(self._first[node - 1], node)
        return omnieval.Step(frame, "near", omnieval.Role.JOINED, node, match, comparisons=(compared,))

    def finish(self) -> omnieval.FinalMap:
        """Return the partition of all images so far."""
        labels, positions = np.array(self._nodes), np.array(self._positions)
        kinds = (omnieval.Placement.LOOP_CLOSURE, omnieval.Placement.FOUNDING)
        nodes = tuple(range(1, len(self._first) + 1))
        means = np.stack([positions[labels == node].mean(axis=0) for node in nodes])
        placements = tuple(kinds[frame in self._first] for frame in range(len(labels)))
        return omnieval.FinalMap(labels, placements, nodes, frozenset(nodes), means)

    def _found(self, frame: int, role: omnieval.Role, *compared: omnieval.Comparison) -> omnieval.Step:
        self._first.append(frame)
        node = len(self._first)
        self._nodes.append(node)
        created = omnieval.NodeEvent(omnieval.EventKind.CREATED, node, frames=(frame,))
        activated = omnieval.NodeEvent(omnieval.EventKind.ACTIVATED, node)
        return omnieval.Step(frame, "new", role, node, events=(created, activated), comparisons=compared)


def judge(source: str, descriptor: Any, mapper: Any, limit: int | None) -> dict[str, Any]:
    """Replay a sequence; return who did it and the metrics of the map."""
    with tempfile.TemporaryDirectory() as folder:
        run = omnieval.replay(source, descriptor=descriptor, mapper=mapper, limit=limit, out=Path(folder) / "run")
        who = {"descriptor": run.config.descriptor.name, "mapper": run.config.mapper.name}
        return who | {name: run.metrics[name] for name in SHOWN}


def main(source: str = "synthetic", limit: int | None = None) -> pl.DataFrame:
    """Check both contracts, and judge each combination of descriptor and mapper."""
    check_descriptor(GreyBands())
    check_mapper(FirstImage)
    pairs = itertools.product(("hog", GreyBands), ("roman2020", "leader", FirstImage))
    return pl.DataFrame([judge(source, descriptor, mapper, limit) for descriptor, mapper in pairs])


if __name__ == "__main__":
    with pl.Config(tbl_cols=-1, tbl_width_chars=200):
        given = dict(enumerate(sys.argv[1:]))
        print(main(given.get(0, "synthetic"), int(given[1]) if 1 in given else None))
