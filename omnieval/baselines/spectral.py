"""Batch spectral clustering, the benchmark of doi 10.3390/app10186480, section 6.

A. Y. Ng, M. I. Jordan, Y. Weiss, *On Spectral Clustering: Analysis and an Algorithm*, NIPS 2001: the main eigenvectors
of the normalised similarity, their rows normalised, k-means.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh
from scipy.sparse import csr_array, dia_array
from scipy.sparse.linalg import eigsh
from threadpoolctl import threadpool_limits

from omnieval.baselines.batch import kmeans_clusters
from omnieval.seeding import named_generator


@dataclass(frozen=True)
class SpectralEmbedding:
    """One eigendecomposition that serves every number of clusters up to the number of its vectors.

    Attributes
    ----------
    values
        The largest eigenvalues of D^-1/2 A D^-1/2, descending, shape (m,). Those of the normalised Laplacian are
        1 minus these.
    vectors
        Their eigenvectors, shape (n, m), float32, signed so that the largest component is positive.
    """

    values: NDArray[np.float64]
    vectors: NDArray[np.float32]

    def rows(self, clusters: int) -> NDArray[np.float32]:
        """Return the images in the space of the `clusters` main eigenvectors, rows of length 1, (n, clusters)."""
        main = self.vectors[:, :clusters]
        lengths = np.linalg.norm(main, axis=1, keepdims=True)
        rows: NDArray[np.float32] = np.divide(main, lengths, out=np.zeros_like(main), where=lengths > 0)
        return rows

    def cluster(self, clusters: int, *, seed: int) -> NDArray[np.int64]:
        """Return labels 1..clusters, shape (n,): k-means++ on `rows`, 20 restarts.

        Raises
        ------
        ValueError
            If there are fewer eigenvectors than clusters.
        """
        if clusters > self.vectors.shape[1]:
            raise ValueError(f"{clusters} clusters need as many eigenvectors, there are {self.vectors.shape[1]}")
        return kmeans_clusters(self.rows(clusters), clusters, seed=seed, name="spectral", restarts=20)


def spectral_embedding(similarities: NDArray[np.float64], vectors: int) -> SpectralEmbedding:
    """Decompose the normalised similarity of the images.

    Parameters
    ----------
    similarities
        Shape (n, n), symmetric, not negative, 0 on the diagonal.
    vectors
        How many eigenvectors, the largest number of clusters to come; at most n.
    """
    degrees = similarities.sum(axis=1)
    scale = np.divide(1.0, np.sqrt(degrees), out=np.zeros_like(degrees), where=degrees > 0)
    normalised = scale[:, None] * similarities * scale
    count = len(normalised)
    with threadpool_limits(1):  # the order of parallel sums must not decide a label
        values, found = eigh(
            normalised, subset_by_index=(count - vectors, count - 1), overwrite_a=True, check_finite=False
        )
    return _embedding(values, found)


def sparse_spectral_embedding(graph: csr_array, vectors: int) -> SpectralEmbedding:
    """Decompose a normalised similarity of which most is zero, by Lanczos iterations (ARPACK).

    Parameters
    ----------
    graph
        Shape (n, n), symmetric, not negative, 0 on the diagonal.
    vectors
        How many eigenvectors, fewer than n.
    """
    degrees = np.asarray(graph.sum(axis=1)).ravel()
    scale = dia_array((np.divide(1.0, np.sqrt(degrees), out=np.zeros_like(degrees), where=degrees > 0), 0), graph.shape)
    start = named_generator(0, "spectral", len(degrees)).standard_normal(len(degrees))
    with threadpool_limits(1):
        values, found = eigsh(
            csr_array(scale @ graph @ scale), vectors, which="LA", v0=start, ncv=min(len(degrees), 3 * vectors + 20)
        )
    order = np.argsort(values)
    return _embedding(values[order], found[:, order])


def _embedding(values: NDArray[np.float64], found: NDArray[np.float64]) -> SpectralEmbedding:
    """Return an embedding by eigenvalues, ascending, shape (m,), and their eigenvectors, shape (n, m)."""
    values, found = values[::-1], found[:, ::-1]
    vectors = len(values)
    signs = np.sign(found[np.abs(found).argmax(axis=0), np.arange(vectors)])
    # Single precision is enough from here on: components of unit vectors, of which k-means asks for the nearest mean.
    return SpectralEmbedding(values, np.ascontiguousarray(found * signs, np.float32))
