"""What the tables of a replay do not hold, computed again: labels at every moment, descriptors, similarity curves."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import polars as pl
from numpy.typing import NDArray

from omnieval.baselines.controls import time_slices
from omnieval.baselines.similarity import similarity_matrix
from omnieval.baselines.spectral import spectral_embedding
from omnieval.datasets import load
from omnieval.descriptors.cache import DescriptorCache
from omnieval.descriptors.description import Description
from omnieval.errors import ResultError
from omnieval.mapping.matching import match_image
from omnieval.mapping.memory import ImageMemory
from omnieval.mapping.partition import Partition
from omnieval.mapping.step import Match, Verdict
from omnieval.material import ARCHIVE_SCHEME, archive_material, image_material
from omnieval.metrics.silhouette import silhouettes
from omnieval.report.sources import Replay
from omnieval.results.tables import step_from_row

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


def moments(steps: pl.DataFrame) -> Iterator[Moment]:
    """Yield the map after every step, replayed from the table of steps."""
    partition = Partition()
    for row in steps.iter_rows(named=True):
        partition.apply(step_from_row(row))
        yield Moment(row["frame"], partition.labels, partition.active)


def loop_closures(steps: pl.DataFrame) -> dict[int, int]:
    """Return the steps with a similarity curve and how many candidate images each had, by frame."""
    counted: dict[int, int] = {}
    labels = np.empty(0, np.int64)
    matched = steps.select("best_frame", "candidates")
    for moment, (best, candidates) in zip(moments(steps), matched.iter_rows(), strict=True):
        if best is not None:
            counted[moment.frame] = int(np.isin(labels, candidates).sum())
        labels = moment.labels
    return counted


def telling_step(steps: pl.DataFrame) -> int | None:
    """Return the loop closure with the most candidate images, the first of equals; None if no loop was closed."""
    counted = loop_closures(steps)
    closed = steps.filter(pl.col("verdict") == Verdict.ASSIGNED.value)["frame"].to_list()
    return max(closed, key=lambda frame: counted[frame], default=None)


def descriptions(replay: Replay, cache: DescriptorCache) -> Iterator[Description]:
    """Yield the descriptions of the replay's images again.

    Raises
    ------
    DatasetError
        If the sequence is no longer where the replay found it.
    ResultError
        If it has changed since.
    """
    if replay.source.startswith(ARCHIVE_SCHEME):
        material = archive_material(Path(replay.source.removeprefix(ARCHIVE_SCHEME)))
    else:
        sequence = load(replay.source).cut(**replay.cut)
        material = image_material(sequence, replay.config, replay.config.make_descriptor(), cache)
    files = replay.steps["file"].to_list()
    if [frame.file for frame in material.frames[: len(files)]] != files:
        raise ResultError(f"the images of {replay.source} are not those of the replay any more; replay it again")
    for _, described in zip(files, material.described, strict=False):
        yield described.description


def similarity_curve(replay: Replay, described: Iterable[Description], step: int) -> tuple[Match, NDArray[np.int64]]:
    """Return the image-level loop closure of a step and the labels it saw, shape (step,).

    Raises
    ------
    ResultError
        If the step has none, or the descriptors lead to another best match than the table of steps names.
    """
    if step >= len(replay.steps):
        raise ResultError(f"{replay.title} ends at step {len(replay.steps) - 1}, it has no step {step}")
    if replay.steps["best_frame"][step] is None:
        raise ResultError(f"step {step} of {replay.title} has no similarity curve: no node was a candidate")
    row = replay.steps.row(step, named=True)
    images, partition = ImageMemory(), Partition()
    for before, description in zip(replay.steps.head(step + 1).iter_rows(named=True), described, strict=False):
        images.append(description)
        if before["frame"] < step:
            partition.apply(step_from_row(before))
    labels = partition.labels
    members = {int(node): np.flatnonzero(labels == node) for node in np.unique(labels[labels > 0])}
    mean = replay.config.mapper.prominence_mean
    match = match_image(images, step, members, row["candidates"], prominence_mean=mean)
    if match.best_frame != row["best_frame"]:
        raise ResultError(
            f"step {step}: the best match is image {match.best_frame}, the replay found {row['best_frame']}; "
            "the images or the descriptor have changed since, so replay the sequence again"
        )
    return match, labels


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
        True capture positions, shape (n, 2), metres.
    ks
        Numbers of clusters, at least 2; those above n are left out.
    seed
        Root seed of k-means.
    progress
        Called with (done, in all).

    Returns
    -------
    One row a number of clusters: k, silhouette, time_slices.
    """
    usable = [k for k in ks if 2 <= k <= len(descriptors)]
    if not usable:
        return pl.DataFrame(schema={"k": pl.Int64, "silhouette": pl.Float64, "time_slices": pl.Float64})
    embedding = spectral_embedding(similarity_matrix(descriptors, "gaussian-median"), max(usable))
    rows = []
    for done, k in enumerate(usable, start=1):
        labels = embedding.cluster(k, seed=seed)
        found = silhouettes(positions, labels).silhouette if len(np.unique(labels)) > 1 else None
        slices = silhouettes(positions, time_slices(len(positions), k)).silhouette
        rows.append({"k": k, "silhouette": found, "time_slices": slices})
        if progress:
            progress(done, len(usable))
    return pl.DataFrame(rows)


def positions_of(steps: pl.DataFrame) -> NDArray[np.float64]:
    """Return the true capture positions, shape (n, 2), metres."""
    return steps.select("x", "y").to_numpy()
