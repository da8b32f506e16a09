"""Computes again what the tables of a replay do not hold: labels at every moment, descriptors, similarity curves."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

import numpy as np
import polars as pl
from numpy.typing import NDArray

from omnieval.baselines.controls import time_slices
from omnieval.baselines.similarity import similarity_matrix, too_many
from omnieval.baselines.spectral import spectral_embedding
from omnieval.errors import ResultError
from omnieval.mapping.partition import Partition
from omnieval.mapping.step import Role, Step
from omnieval.metrics.silhouette import posed, silhouettes
from omnieval.remap import decided_again
from omnieval.report.sources import Replay
from omnieval.results.tables import read_steps

Progress = Callable[[int, int], None]


@dataclass(frozen=True)
class Moment:
    """The map after a step.

    Attributes
    ----------
    frame
        The step.
    labels
        Node of every image so far, 0 where unassigned, shape (frame + 1,).
    active
        The active nodes.
    """

    frame: int
    labels: NDArray[np.int64]
    active: frozenset[int]


def moments(replay: Replay) -> Iterator[Moment]:
    """Yield the map after every step, replayed from the table of steps."""
    partition = Partition()
    for step, _ in read_steps(replay.steps, ()):
        partition.apply(step)
        yield Moment(step.frame, partition.labels, partition.active)


def telling_step(replay: Replay) -> int | None:
    """Return the loop closure with the most images to choose from, the first of equals; None if no loop was closed.

    These are the images of the nodes that passed every comparison of nodes.
    """
    partition, found, most = Partition(), None, 0
    for step, _ in read_steps(replay.steps, ()):
        if step.role is Role.JOINED and step.match is not None:
            nodes = next((one.passing for one in step.comparisons if replay.method.gate(one.gate).of == "node"), ())
            count = int(np.isin(partition.labels, nodes).sum())
            if found is None or count > most:
                found, most = step.frame, count
        partition.apply(step)
    return found


def position_descriptors(replay: Replay) -> NDArray[np.float32]:
    """Return the position descriptors of the replay's images again, shape (n, d).

    Raises
    ------
    ConfigError, DatasetError, ResultError
        If they cannot be described as they were.
    """
    with replay.material() as material:
        found = [one.description.position for _, one in zip(range(len(replay.steps)), material.described, strict=False)]
    return np.stack(found)


def step_again(replay: Replay, frame: int) -> tuple[Step, NDArray[np.int64]]:
    """Return a step with its curves, and the labels it saw, shape (step,).

    Raises
    ------
    ResultError
        If it has none, or cannot be decided again.
    """
    if frame >= len(replay.steps):
        raise ResultError(f"{replay.title} ends at step {len(replay.steps) - 1}, it has no step {frame}")
    partition = Partition()
    with replay.material() as material:
        for step in decided_again(replay.config.mapper, replay.steps.head(frame + 1), material, replay.title):
            if step.frame == frame:
                if step.curves is None:
                    raise ResultError(f"step {frame} of {replay.title} has no similarity curve: no node let it in")
                return step, partition.labels
            partition.apply(step)
    raise ResultError(f"{replay.source} has no image {frame} any more; replay it again")


def batch_curve(
    descriptors: NDArray[np.float32],
    positions: NDArray[np.float64],
    ks: Iterable[int],
    *,
    seed: int,
    progress: Progress | None = None,
) -> pl.DataFrame:
    """Return the silhouettes of batch spectral clustering, and of equal time slices, at each number of clusters.

    Parameters
    ----------
    descriptors
        Position descriptors, shape (n, d).
    positions
        True capture positions, shape (n, 2), metres; NaN where unknown, which leaves the image out.
    ks
        Numbers of clusters, at least 2; those above n are left out.
    seed
        Root seed of k-means.
    progress
        Called with (done, in all).

    Returns
    -------
    One row per number of clusters: k, silhouette, time_slices.

    Raises
    ------
    ResultError
        If there are too many images for a matrix of all pairs.
    """
    if fault := too_many(len(descriptors)):
        raise ResultError(fault)
    usable = [k for k in ks if 2 <= k <= len(descriptors)]
    if not usable:
        return pl.DataFrame(schema={"k": pl.Int64, "silhouette": pl.Float64, "time_slices": pl.Float64})
    embedding = spectral_embedding(similarity_matrix(descriptors, "gaussian-median"), max(usable))
    rows = []
    known = posed(positions)
    for done, k in enumerate(usable, start=1):
        labels = embedding.cluster(k, seed=seed)
        slices = np.zeros(len(positions), np.int64)
        slices[known] = time_slices(int(known.sum()), min(k, int(known.sum())))
        rows.append(
            {
                "k": k,
                "silhouette": silhouette_or_none(positions, labels),
                "time_slices": silhouette_or_none(positions, slices),
            }
        )
        if progress:
            progress(done, len(usable))
    return pl.DataFrame(rows, schema={"k": pl.Int64, "silhouette": pl.Float64, "time_slices": pl.Float64})


def silhouette_or_none(positions: NDArray[np.float64], labels: NDArray[np.int64]) -> float | None:
    """Return the silhouette of the images that have a node and a position; None if they lie in fewer than two nodes.

    Parameters
    ----------
    positions
        True capture positions, shape (n, 2), metres, NaN where unknown.
    labels
        Node of every image, shape (n,), 0 where it has none.
    """
    judged = posed(positions) & (labels > 0)
    if len(np.unique(labels[judged])) < 2:
        return None
    return silhouettes(positions[judged], labels[judged]).silhouette


def positions_of(steps: pl.DataFrame) -> NDArray[np.float64]:
    """Return the true capture positions, shape (n, 2), metres, NaN where unknown."""
    return steps.select("x", "y").to_numpy()
