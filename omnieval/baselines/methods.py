"""The baseline methods by name, behind one interface: prepare once, then one partition for each number of clusters."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from omnieval.baselines.batch import WardTree, kmeans_clusters, numbered
from omnieval.baselines.controls import position_clusters, time_slices
from omnieval.baselines.similarity import Similarity, is_sparse, similarity_matrix, sparse_neighbour_graph
from omnieval.baselines.spectral import sparse_spectral_embedding, spectral_embedding
from omnieval.baselines.stream import dbstream_clusters, require_river
from omnieval.errors import DatasetError

Labels = NDArray[np.int64]
Partition = Callable[[int], Labels]
"""Labels 1.. of every image, shape (n,), 0 where unassigned, for a number of clusters."""


@dataclass(frozen=True)
class Images:
    """What a baseline may know of a sequence of n images.

    Attributes
    ----------
    source
        What the sequence is called in messages.
    descriptors
        Position descriptors, shape (n, d).
    positions
        True capture positions, shape (n, 2), metres, NaN where unknown; None when none is known.
    rooms
        Room labels, length n, None where there is none.
    unposed
        Which positions are not known, and why; None if all are, or for lack of any pose.
    """

    source: str
    descriptors: NDArray[np.float32]
    positions: NDArray[np.float64] | None
    rooms: tuple[str | None, ...]
    unposed: str | None = None


@dataclass(frozen=True)
class Method:
    """One way to divide a sequence into places.

    Attributes
    ----------
    prepare
        Takes (images, similarity, largest k, seed), does what all numbers of clusters share, and returns the rest.
    check
        Takes images, which need not be described yet, and raises `DatasetError` or `ConfigError` if the method cannot
        be used on them.
    takes_k
        Whether it is told the number of clusters; if not, its one partition is that for 0.
    takes_similarity
        Whether it clusters a similarity.
    compares_all
        Whether it compares all images with each other, which only so many allow (`similarity.too_many`), unless by a
        similarity of few pairs (`similarity.is_sparse`).
    extra
        The optional library it needs, if any.
    """

    prepare: Callable[[Images, Similarity, int, int], Partition]
    check: Callable[[Images], object]
    takes_k: bool = True
    takes_similarity: bool = False
    compares_all: bool = False
    extra: str | None = None


def _spectral(images: Images, similarity: Similarity, largest: int, seed: int) -> Partition:
    if is_sparse(similarity, len(images.descriptors)):
        embedding = sparse_spectral_embedding(sparse_neighbour_graph(images.descriptors), largest)
    else:
        embedding = spectral_embedding(similarity_matrix(images.descriptors, similarity), largest)
    return lambda k: embedding.cluster(k, seed=seed)


def _kmeans(images: Images, similarity: Similarity, largest: int, seed: int) -> Partition:
    return lambda k: kmeans_clusters(images.descriptors, k, seed=seed)


def _agglomerative(images: Images, similarity: Similarity, largest: int, seed: int) -> Partition:
    return WardTree.grow(images.descriptors).cut


def _dbstream(images: Images, similarity: Similarity, largest: int, seed: int) -> Partition:
    labels = dbstream_clusters(images.descriptors)
    return lambda k: labels


def _time_slices(images: Images, similarity: Similarity, largest: int, seed: int) -> Partition:
    return lambda k: time_slices(len(images.descriptors), k)


def _positions(images: Images, similarity: Similarity, largest: int, seed: int) -> Partition:
    positions = _need_positions(images)
    known = np.isfinite(positions).all(axis=1)
    located = positions[known]
    different = len(np.unique(located, axis=0))

    def part(k: int) -> Labels:
        labels = np.zeros(len(positions), np.int64)
        labels[known] = position_clusters(located, min(k, different), seed=seed)
        return labels

    return part


def _rooms(images: Images, similarity: Similarity, largest: int, seed: int) -> Partition:
    labelled = np.array([room is not None for room in images.rooms])
    labels = np.zeros(len(labelled), np.int64)
    labels[labelled] = numbered(np.array([room for room in images.rooms if room is not None]))
    return lambda k: labels


def _need_nothing(images: Images) -> None:
    del images


def _need_river(images: Images) -> None:
    del images
    require_river()


def _need_positions(images: Images) -> NDArray[np.float64]:
    if images.positions is None:
        reason = images.unposed or "the sequence has no poses"
        raise DatasetError(f"{images.source}: {reason}; method positions needs positions")
    return images.positions


def _need_rooms(images: Images) -> None:
    if all(room is None for room in images.rooms):
        raise DatasetError(f"{images.source} has no room labels; method rooms needs them")


METHODS: dict[str, Method] = {
    "spectral": Method(_spectral, _need_nothing, takes_similarity=True, compares_all=True),
    "kmeans": Method(_kmeans, _need_nothing),
    "agglomerative": Method(_agglomerative, _need_nothing, compares_all=True),
    "dbstream": Method(_dbstream, _need_river, takes_k=False, extra="river"),
    "time-slices": Method(_time_slices, _need_nothing),
    "positions": Method(_positions, _need_positions),
    "rooms": Method(_rooms, _need_rooms, takes_k=False),
}
"""All methods by the name they are asked for with."""
