"""What a strategy answers to the images of a sequence, each with what the answer is worth."""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from omnieval.datasets.sequence import Frame
from omnieval.descriptors.description import Description
from omnieval.localization.strategies import Strategy
from omnieval.localization.table import query_row
from omnieval.localization.truth import truth_of
from omnieval.mapping.memory import AHEAD, blocks


@dataclass(frozen=True)
class Query:
    """A sequence to find in a map, described; `about` is what ``run.json`` says of it."""

    name: str
    frames: Sequence[Frame]
    descriptions: Sequence[Description]
    about: Mapping[str, Any] = field(default_factory=dict)


def answers(finder: Strategy, query: Query, within: float) -> Iterator[dict[str, Any]]:
    """Yield the row of every image of a query (`table.QUERIES`), in order.

    Parameters
    ----------
    finder
        Finds them.
    query
        The images.
    within
        Two images at most this far apart show the same place.
    """
    for block in blocks(enumerate(zip(query.frames, query.descriptions, strict=True)), AHEAD):
        started = time.perf_counter()
        finder.expect([description for _, (_, description) in block])
        ahead = (time.perf_counter() - started) / len(block)
        for number, (frame, description) in block:
            started = time.perf_counter()
            found = finder.find(description)
            milliseconds = 1e3 * (time.perf_counter() - started + ahead)
            found = dataclasses.replace(found, step=dataclasses.replace(found.step, frame=number))
            truth = truth_of(finder.map, found, _xy(frame), _yaw(frame), within)
            yield query_row(number, query.name, finder.name, frame, found, truth, finder.map, milliseconds)


def _xy(frame: Frame) -> tuple[float, float] | None:
    pose = frame.pose
    return (pose.x, pose.y) if pose and np.isfinite([pose.x, pose.y]).all() else None


def _yaw(frame: Frame) -> float | None:
    return frame.pose.yaw if frame.pose and math.isfinite(frame.pose.yaw) else None
