"""A descriptor and a mapper of one's own, checked against their contracts and judged like omnieval's.

    python docs/examples/own_descriptor_and_mapper.py [SOURCE] [LIMIT]

The descriptor keeps mean and spread of the grey levels in bands of rows and of columns. The mapper puts an image into
the node with the nearest centroid, or makes a node of it if none is near: no gates, no second thoughts.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

import omnieval
from omnieval.datasets import Sequence
from omnieval.mapping.step import EventKind, FinalMap, NodeEvent, Placement, Step, Verdict
from omnieval.testing import IncrementalMapper, check_descriptor, check_mapper

SHOWN = ("nodes", "silhouette", "silhouette_image", "silhouette_time_slices", "rooms_ari", "share_assigned")


class GreyBands:
    """Mean and standard deviation of the grey levels of 32 bands of rows, and of 128 of columns."""

    name = "grey-bands"

    @property
    def settings(self) -> dict[str, Any]:
        """Everything that determines the result."""
        return {"rows": 32, "columns": 128}

    def describe(self, panorama: NDArray[np.uint8]) -> omnieval.Description:
        """Describe one grey panorama; columns that a rotation rolls become rows of `orientation` that it rolls."""
        grey = panorama.astype(np.float64) / 255.0
        rows = grey.reshape(self.settings["rows"], -1)
        columns = grey.T.reshape(self.settings["columns"], -1)
        position = np.concatenate([rows.mean(axis=1), rows.std(axis=1)])
        orientation = np.stack([columns.mean(axis=1), columns.std(axis=1)], axis=1)
        return omnieval.Description(position.astype(np.float32), orientation.astype(np.float32))


class NearestCentroid:
    """Puts an image into the node with the nearest centroid, or makes a node of it.

    Parameters
    ----------
    reach
        An image may be so many times as far from a centroid as successive images have been from each other so far
        (median).
    """

    def __init__(self, reach: float = 2.5) -> None:
        self.reach = reach
        self._positions: list[NDArray[np.float64]] = []
        self._labels: list[int] = []
        self._hops: list[float] = []
        self._founded: set[int] = set()

    def step(self, description: omnieval.Description) -> Step:
        """Decide about the next image."""
        position = description.position.astype(np.float64)
        nearest = self._nearest(position)
        if self._positions:
            self._hops.append(float(np.linalg.norm(position - self._positions[-1])))
        frame = len(self._positions)
        self._positions.append(position)
        if nearest is not None:
            self._labels.append(nearest)
            return self._report(frame, Verdict.ASSIGNED)
        node = len(self._founded) + 1
        self._labels.append(node)
        self._founded.add(frame)
        created = NodeEvent(EventKind.CREATED, node, frames=(frame,))
        verdict = Verdict.NO_CANDIDATE if frame else Verdict.INITIAL
        return self._report(frame, verdict, created, NodeEvent(EventKind.ACTIVATED, node))

    def finish(self) -> FinalMap:
        """Return the partition of all images so far."""
        nodes = tuple(range(1, len(self._founded) + 1))
        placements = (Placement.FOUNDING, Placement.LOOP_CLOSURE)
        return FinalMap(
            labels=np.array(self._labels, np.int64),
            placements=tuple(placements[frame not in self._founded] for frame in range(len(self._labels))),
            nodes=nodes,
            active=frozenset(nodes),
            representatives=self._centroids(),
        )

    def _centroids(self) -> NDArray[np.float64]:
        labels, positions = np.array(self._labels), np.array(self._positions)
        return np.stack([positions[labels == node].mean(axis=0) for node in range(1, len(self._founded) + 1)])

    def _nearest(self, position: NDArray[np.float64]) -> int | None:
        """Return the node with the nearest centroid, None if it is out of reach or there is none."""
        if not self._hops:
            return 1 if self._labels else None  # the second image says how far apart images are
        distances = np.linalg.norm(self._centroids() - position, axis=1)
        nearest = int(distances.argmin())
        return nearest + 1 if distances[nearest] <= self.reach * np.median(self._hops) else None

    def _report(self, frame: int, verdict: Verdict, *events: NodeEvent) -> Step:
        return Step(
            frame=frame,
            verdict=verdict,
            node=self._labels[-1],
            gate=None,
            match=None,
            centroid=None,
            run=0,
            events=events,
            active=len(self._founded),
            pending=0,
            margin=None,
        )


def judge(sequence: Sequence, descriptor: omnieval.Descriptor | None, mapper: IncrementalMapper) -> dict[str, Any]:
    """Replay a sequence and return the metrics of its map; without a descriptor, HOG."""
    with tempfile.TemporaryDirectory() as folder:
        run = omnieval.replay(sequence, descriptor=descriptor, mapper=mapper, out=Path(folder) / "run")
        return {name: run.metrics[name] for name in SHOWN}


def main(source: str = "synthetic", limit: int | None = None) -> pl.DataFrame:
    """Check both contracts, and judge each combination of descriptor and mapper."""
    check_descriptor(GreyBands())
    check_mapper(NearestCentroid)
    sequence = omnieval.load(source).cut(limit=limit)
    rows = []
    for descriptor in (None, GreyBands()):
        for mapper in (omnieval.Mapper(), NearestCentroid()):
            names = {"descriptor": descriptor.name if descriptor else "hog", "mapper": type(mapper).__name__}
            rows.append(names | judge(sequence, descriptor, mapper))
    return pl.DataFrame(rows)


if __name__ == "__main__":
    with pl.Config(tbl_cols=-1, tbl_width_chars=200):
        given = dict(enumerate(sys.argv[1:]))
        print(main(given.get(0, "synthetic"), int(given[1]) if 1 in given else None))
