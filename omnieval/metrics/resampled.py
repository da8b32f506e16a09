"""The metrics of a map over resampled images: what its intervals are computed from.

The map stays as it is, and so does what is true of each image (its silhouette, whether it is covered); which images
count, and how often, changes. Metrics of events, of nodes and of the graph are not here: their cases are not images.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from omnieval.mapping.step import Placement
from omnieval.metrics.catalogue import COVERED_M, THETA
from omnieval.metrics.ground import ROUNDING_M, Ground
from omnieval.metrics.silhouette import image_silhouettes
from omnieval.statistics.blocks import Statistic, mean_of

_MOST_PAIRS = 20_000_000
"""Pairs of near images that are held at once; of more there are no intervals of pairs."""
_SHARES = {
    "share_assigned": Placement.LOOP_CLOSURE,
    "share_pending": Placement.PENDING,
    "share_founding": Placement.FOUNDING,
    "share_retest": Placement.RETEST,
    "share_forced": Placement.FORCED,
    "share_unassigned": Placement.UNASSIGNED,
}


def resampled_metrics(
    labels: NDArray[np.int64],
    placements: Sequence[str],
    positions: NDArray[np.float64],
    times: Sequence[int | None],
    rooms: Sequence[str | None],
    representatives: Sequence[int],
) -> dict[str, Statistic]:
    """Return the metrics of `catalogue` that images can be resampled for, by name.

    Parameters
    ----------
    labels
        Node of every image, 0 where unassigned, shape (n,).
    placements
        How each image came to its node (`Placement`), length n.
    positions
        True capture positions, shape (n, 2), metres, NaN where unknown.
    times
        Nanoseconds, length n, None where unknown.
    rooms
        Room of each image, length n, None where unknown.
    representatives
        The image that represents each node.
    """
    found = {
        name: mean_of(np.array([one == placement.value for one in placements], np.float64))
        for name, placement in _SHARES.items()
    }
    found["rooms_purity"] = mean_of(_in_commonest_room(labels, rooms))
    ground = Ground(positions, times)
    if not len(ground):
        return found
    found |= _pairs(labels, ground)
    found |= _silhouettes(labels, ground, len(positions))
    places = positions[list(representatives)]
    places = places[np.isfinite(places).all(axis=1)]
    if len(places):
        nearest = np.full(len(positions), np.nan)
        nearest[ground.images] = _nearest(ground.positions, places)
        for at in COVERED_M:
            covered = np.where(np.isnan(nearest), np.nan, nearest <= at + ROUNDING_M)
            found[f"coverage_{at:g}m"] = mean_of(covered)
    return found


def _pairs(labels: NDArray[np.int64], ground: Ground) -> dict[str, Statistic]:
    own = labels[ground.images]
    radius = THETA + ROUNDING_M
    if ground.tree.count_neighbors(ground.tree, radius) > _MOST_PAIRS:
        return {}
    stamps = ground.clock.stamps
    pairs = ground.tree.query_pairs(radius, output_type="ndarray")
    pairs = pairs[np.abs(stamps[pairs[:, 0]] - stamps[pairs[:, 1]]) > ground.apart]
    near = _links(pairs, len(own))
    both = _links(pairs[(own[pairs[:, 0]] == own[pairs[:, 1]]) & (own[pairs[:, 0]] > 0)], len(own))

    def counted(counts: NDArray[np.int32]) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        weights = counts[:, ground.images].astype(np.float64)
        return _within(weights, both), _together(weights, own, ground), _within(weights, near)

    def precision(counts: NDArray[np.int32]) -> NDArray[np.float64]:
        shared, together, _ = counted(counts)
        return _ratio(shared, together)

    def recall(counts: NDArray[np.int32]) -> NDArray[np.float64]:
        shared, _, nearby = counted(counts)
        return _ratio(shared, nearby)

    def f1(counts: NDArray[np.int32]) -> NDArray[np.float64]:
        shared, together, nearby = counted(counts)
        found = _ratio(2 * shared, together + nearby)  # harmonic mean of the two
        return np.where(nearby > 0, found, np.nan)

    return {"pair_precision": precision, "pair_recall": recall, "pair_f1": f1}


def _silhouettes(labels: NDArray[np.int64], ground: Ground, images: int) -> dict[str, Statistic]:
    placed = labels[ground.images] > 0
    own = labels[ground.images][placed]
    if len(np.unique(own)) < 2:
        return {}
    values = np.full(images, np.nan)
    values[ground.images[placed]] = image_silhouettes(ground.positions[placed], own)
    return {"silhouette_image": mean_of(values)}


def _in_commonest_room(labels: NDArray[np.int64], rooms: Sequence[str | None]) -> NDArray[np.float64]:
    """Return whether the room of each image is the commonest of its node, shape (n,), NaN where one is not known."""
    names = {room: code for code, room in enumerate(sorted({room for room in rooms if room is not None}))}
    codes = np.array([-1 if room is None else names[room] for room in rooms], np.int64)
    found = np.full(len(labels), np.nan)
    for node in np.unique(labels[labels > 0]):
        members = np.flatnonzero((labels == node) & (codes >= 0))
        if len(members):
            found[members] = codes[members] == np.bincount(codes[members]).argmax()
    return found


def _nearest(positions: NDArray[np.float64], places: NDArray[np.float64]) -> NDArray[np.float64]:
    from scipy.spatial import cKDTree

    distances: NDArray[np.float64] = cKDTree(places).query(positions)[0]
    return distances


def _links(pairs: NDArray[np.int64], images: int) -> csr_array:
    ends = pairs[:, 0].astype(np.int32), pairs[:, 1].astype(np.int32)
    return csr_array((np.ones(len(pairs)), ends), shape=(images, images))


def _within(weights: NDArray[np.float64], links: csr_array) -> NDArray[np.float64]:
    """Return how many linked pairs there are when images count so often, shape (b,)."""
    found: NDArray[np.float64] = ((weights @ links) * weights).sum(axis=1)
    return found


def _together(weights: NDArray[np.float64], labels: NDArray[np.int64], ground: Ground) -> NDArray[np.float64]:
    """Return how many pairs of one node there are, more than W apart, shape (b,)."""
    found = np.zeros(len(weights))
    for node in np.unique(labels[labels > 0]):
        members = np.flatnonzero(labels == node)
        stamps = ground.clock.stamps[members]
        earlier = np.searchsorted(stamps, stamps - ground.apart, side="left")
        own = weights[:, members]
        so_far = np.concatenate([np.zeros((len(weights), 1)), np.cumsum(own, axis=1)], axis=1)
        found += (own * so_far[:, earlier]).sum(axis=1)
    return found


def _ratio(part: NDArray[np.float64], whole: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return part / whole, NaN where the whole is nothing."""
    found: NDArray[np.float64] = np.divide(part, whole, out=np.full(len(part), np.nan), where=whole > 0)
    return found
