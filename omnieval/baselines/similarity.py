"""Similarity of all pairs of images, from the distances of their position descriptors.

The benchmark of doi 10.3390/app10186480 (section 6) does not say which similarity it clusters; these are the usual
three.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array
from scipy.spatial.distance import pdist, squareform

Similarity = Literal["gaussian-median", "local-scaling", "knn"]

_LOCAL_NEIGHBOUR = 7
"""Whose distance is an image's own scale (Zelnik-Manor and Perona 2004, section 2)."""
_GRAPH_NEIGHBOURS = 10
"""Edges from each image of the neighbour graph, as in scikit-learn's spectral clustering."""


MANY_IMAGES = 10_000
"""Above so many images a graph of neighbours is made without a matrix of all pairs; by default it is the similarity."""
_ROWS = 2_000
"""Images whose neighbours are looked at together."""
_NEARLY = 3
"""Times as many neighbours as are wanted are looked for first, in a way that rounds."""

MOST_IMAGES = 15_000
"""A matrix of all their pairs takes 1.8 GB, and several are needed at a time."""


def default_similarity(images: int) -> Similarity:
    """Return the similarity of so many images when nobody asks for one."""
    return "gaussian-median" if images <= MANY_IMAGES else "knn"


def is_sparse(similarity: Similarity | None, images: int) -> bool:
    """Whether so many images are clustered by a similarity of few pairs, without a matrix of all."""
    return similarity == "knn" and images > MANY_IMAGES


def too_many(images: int) -> str | None:
    """Say why so many images are too many for a matrix of all pairs; None if they are not."""
    if images <= MOST_IMAGES:
        return None
    return (
        f"{images} images are too many for the similarities of all pairs ({images**2 * 8 / 1e9:.0f} GB a matrix); at "
        f"most {MOST_IMAGES} are clustered, so cut the sequence; spectral clustering takes more with the similarity knn"
    )


def similarity_matrix(descriptors: NDArray[np.floating], similarity: Similarity) -> NDArray[np.float64]:
    """Return the similarity of every pair of images, shape (n, n), symmetric, 0 on the diagonal.

    Parameters
    ----------
    descriptors
        Position descriptors, shape (n, d), n >= 2.
    similarity
        ``gaussian-median``: exp(-d^2 / (2 sigma^2)), sigma the median distance of all pairs.
        ``local-scaling``: exp(-d_ij^2 / (sigma_i sigma_j)), sigma_i the distance of image i to its 7th neighbour
        (Zelnik-Manor and Perona, NIPS 2004).
        ``knn``: 1 where each of two images is among the 10 nearest of the other, 1/2 where only one is, else 0.
    """
    # In double precision and by differences: near-duplicates, which decide the local scales, would drown otherwise.
    distances = squareform(pdist(np.asarray(descriptors, np.float64)))
    similarities = SIMILARITIES[similarity](distances)
    np.fill_diagonal(similarities, 0.0)
    return similarities


def gaussian_median(distances: NDArray[np.float64]) -> NDArray[np.float64]:
    """exp(-d^2 / (2 sigma^2)) with sigma the median distance of all pairs; shape (n, n) in and out."""
    sigma = _positive(np.median(squareform(distances, checks=False), keepdims=True), distances)
    return np.asarray(np.exp(-np.square(distances / sigma) / 2))


def local_scaling(distances: NDArray[np.float64]) -> NDArray[np.float64]:
    """exp(-d_ij^2 / (sigma_i sigma_j)) with sigma_i the distance to the 7th neighbour; shape (n, n) in and out."""
    neighbour = min(_LOCAL_NEIGHBOUR, len(distances) - 1)
    sigma = _positive(np.partition(distances, neighbour, axis=1)[:, neighbour], distances)
    return np.asarray(np.exp(-np.square(distances) / np.outer(sigma, sigma)))


def neighbour_graph(distances: NDArray[np.float64]) -> NDArray[np.float64]:
    """Symmetrised graph of the 10 nearest neighbours; shape (n, n) in and out."""
    others = distances.copy()
    np.fill_diagonal(others, np.inf)
    # A stable sort: of equally near neighbours the earlier ones, on every machine.
    nearest = np.argsort(others, axis=1, kind="stable")[:, : min(_GRAPH_NEIGHBOURS, len(distances) - 1)]
    graph = np.zeros_like(distances)
    np.put_along_axis(graph, nearest, 1.0, axis=1)
    return (graph + graph.T) / 2


def sparse_neighbour_graph(descriptors: NDArray[np.floating]) -> csr_array:
    """Return what `neighbour_graph` makes of the distances of all pairs without making these; memory grows with n.

    Parameters
    ----------
    descriptors
        Position descriptors, shape (n, d), n >= 2.
    """
    from sklearn.neighbors import NearestNeighbors

    points = np.asarray(descriptors, np.float64)
    count, wanted = len(points), min(_GRAPH_NEIGHBOURS, len(points) - 1)
    several = min(_NEARLY * _GRAPH_NEIGHBOURS + 1, count)
    search = NearestNeighbors(n_neighbors=several, algorithm="brute").fit(points)
    ones, others = [], []
    for first in range(0, count, _ROWS):
        rows = np.arange(first, min(first + _ROWS, count))
        found = np.sort(search.kneighbors(points[rows], return_distance=False), axis=1)
        distances = np.linalg.norm(points[found] - points[rows, np.newaxis], axis=2)
        distances[found == rows[:, np.newaxis]] = np.inf
        nearest = np.argsort(distances, axis=1, kind="stable")[:, :wanted]
        ones.append(np.repeat(rows, wanted))
        others.append(np.take_along_axis(found, nearest, axis=1).ravel())
    ends = np.concatenate(ones).astype(np.int32), np.concatenate(others).astype(np.int32)
    graph = csr_array(coo_array((np.full(len(ends[0]), 0.5), ends), shape=(count, count)))
    return csr_array(graph + graph.T)


SIMILARITIES: dict[Similarity, Callable[[NDArray[np.float64]], NDArray[np.float64]]] = {
    "gaussian-median": gaussian_median,
    "local-scaling": local_scaling,
    "knn": neighbour_graph,
}
"""Similarities by the name they are asked for with."""


def _positive(scales: NDArray[np.float64], distances: NDArray[np.float64]) -> NDArray[np.float64]:
    """Scales with those that equal images have brought to 0 replaced by the smallest positive distance."""
    positive = distances[distances > 0]
    return np.where(scales > 0, scales, positive.min() if positive.size else 1.0)
