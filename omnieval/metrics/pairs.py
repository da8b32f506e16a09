"""Whether pairs of images that share a node lie at one place, and the other way round.

Pairs are of images more than W (`ground.APART_S`) apart in time: that the next image shares a node is not a merit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import Delaunay, QhullError, cKDTree

from omnieval.metrics.ground import ROUNDING_M, Ground
from omnieval.metrics.proportion import Proportion, harmonic_mean

SMALLEST_GROUP = 5
"""Images that a group must have to count as a place of its own: fewer are stray."""
_FLAT = 1e-9
"""Points within so much of their extent of a line are on it."""


@dataclass(frozen=True, slots=True)
class PairScores:
    """Counts of pairs of images more than W apart in time.

    Attributes
    ----------
    together
        Of one node.
    near
        Within theta of each other.
    both
        Both.
    """

    together: int
    near: int
    both: int

    @property
    def precision(self) -> Proportion:
        """Of the pairs of one node, those within theta."""
        return Proportion(self.both, self.together)

    @property
    def recall(self) -> Proportion:
        """Of the pairs within theta, those of one node."""
        return Proportion(self.both, self.near)

    @property
    def f1(self) -> float | None:
        """Harmonic mean of the two."""
        return harmonic_mean(self.precision.value, self.recall.value)


@dataclass(frozen=True, slots=True)
class FalseMerges:
    """Nodes whose images lie in two or more places, among all nodes; their images, among all images."""

    nodes: Proportion
    images: Proportion


def pair_scores(labels: NDArray[np.int64], ground: Ground, thetas: Sequence[float]) -> dict[float, PairScores]:
    """Count pairs of images.

    Parameters
    ----------
    labels
        Node of each of the m images of the ground, 0 where unassigned, shape (m,).
    ground
        Where and when they were taken.
    thetas
        Distances within which two images lie at one place, metres.
    """
    near = ground.near(thetas)
    radii = np.array(thetas) + ROUNDING_M
    both = -_near_in_time(labels, ground, radii)
    together = 0
    for images in _by_node(labels):
        stamps = ground.clock.stamps[images]
        together += int(np.searchsorted(stamps, stamps - ground.apart, side="left").sum())
        if len(images) > 1:
            tree = cKDTree(ground.positions[images])
            both += (tree.count_neighbors(tree, radii) - len(images)) // 2
    return {
        theta: PairScores(together, near[theta].pairs, int(count)) for theta, count in zip(thetas, both, strict=True)
    }


def false_merges(labels: NDArray[np.int64], ground: Ground, thetas: Sequence[float]) -> dict[float, FalseMerges]:
    """Count the nodes that fall into two or more groups of at least `SMALLEST_GROUP` images linked at theta.

    Single linkage on true positions: two images are linked if they lie within theta of each other, and with whatever
    else these are linked with.

    Parameters
    ----------
    labels, ground, thetas
        As in `pair_scores`.
    """
    nodes = _by_node(labels)
    trees = [_spanning_links(ground.positions[images]) for images in nodes]
    within = [images[tree] for images, tree in zip(nodes, trees, strict=True)]
    ends = np.concatenate([np.empty((0, 2), np.int64), *within])
    lengths = np.linalg.norm(ground.positions[ends[:, 0]] - ground.positions[ends[:, 1]], axis=1)
    found = {}
    for theta in thetas:
        one, other = ends[lengths <= theta + ROUNDING_M].T
        links = coo_array((np.ones(len(one), np.bool_), (one, other)), shape=(len(labels), len(labels)))
        groups = connected_components(links, directed=False)[1]
        merged = [images for images in nodes if _large(groups[images]) > 1]
        found[theta] = FalseMerges(Proportion(len(merged), len(nodes)), Proportion(sum(map(len, merged)), len(labels)))
    return found


def nodes_per_place(labels: NDArray[np.int64], ground: Ground, theta: float) -> tuple[float | None, int]:
    """Return how many nodes share a place that was seen again, on average, and how many such places there are.

    A place is a group of images linked by pairs within theta and more than W apart in time. Places without a node are
    not counted; None if there is none.

    Parameters
    ----------
    labels, ground
        As in `pair_scores`.
    theta
        Metres.
    """
    groups = ground.near([theta])[theta].groups
    again = np.bincount(groups, minlength=1)[groups] > 1
    chosen = again & (labels > 0)
    if not chosen.any():
        return None, 0
    pairs = np.unique(np.stack([groups[chosen], labels[chosen]], axis=1), axis=0)
    places = len(np.unique(pairs[:, 0]))
    return len(pairs) / places, places


def _large(groups: NDArray[np.int64]) -> int:
    """Return how many groups have enough images to count."""
    return int((np.unique(groups, return_counts=True)[1] >= SMALLEST_GROUP).sum())


def _by_node(labels: NDArray[np.int64]) -> list[NDArray[np.int64]]:
    """Return the images of every node, ascending."""
    order = np.argsort(labels, kind="stable")
    ordered = labels[order]
    cuts = np.flatnonzero(np.diff(ordered)) + 1
    return [images for images in np.split(order, cuts) if len(images) and labels[images[0]] > 0]


def _near_in_time(labels: NDArray[np.int64], ground: Ground, radii: NDArray[np.float64]) -> NDArray[np.int64]:
    """Count the pairs of one node within each radius that are at most W apart in time."""
    stamps, positions = ground.clock.stamps, ground.positions
    counts = np.zeros(len(radii), np.int64)
    farthest = np.searchsorted(stamps, stamps + ground.apart, side="right") - np.arange(len(stamps)) - 1
    for lag in range(1, int(farthest.max(initial=0)) + 1):
        same = (labels[:-lag] == labels[lag:]) & (labels[lag:] > 0) & (farthest[:-lag] >= lag)
        images = np.flatnonzero(same)
        distances = np.hypot(*(positions[images] - positions[images + lag]).T)
        counts += (distances[:, np.newaxis] <= radii).sum(axis=0)
    return counts


def _spanning_links(points: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return links, shape (l, 2), among which is a shortest spanning tree of points, shape (n, 2).

    So whatever the distance, the links within it join what all pairs within it would join. The edges of a Delaunay
    triangulation have this property (Preparata and Shamos 1985, Computational Geometry, theorem 6.1).
    """
    different, codes = np.unique(points, axis=0, return_inverse=True)
    codes = codes.ravel()  # NumPy 2.0.0 returns a column
    first = np.zeros(len(different), np.int64)
    first[codes[::-1]] = np.arange(len(points))[::-1]
    own = np.arange(len(points))
    equals = np.stack([own, first[codes]], axis=1)[own != first[codes]]
    return np.concatenate([equals, first[_links_of_different(different)]])


def _links_of_different(points: NDArray[np.float64]) -> NDArray[np.int64]:
    if len(points) < 2:
        return np.empty((0, 2), np.int64)
    centred = points - points.mean(axis=0)
    _, (length, width), axes = np.linalg.svd(centred, full_matrices=False)
    line = _chain(centred @ axes[0])
    if len(points) == 2 or width <= _FLAT * length:
        return line
    try:
        mesh = Delaunay(centred)
    except QhullError:  # flat to the computer
        return line
    corners = mesh.simplices.astype(np.int64)
    edges = np.concatenate([corners[:, :2], corners[:, 1:], corners[:, ::2], mesh.coplanar[:, ::2].astype(np.int64)])
    return np.unique(np.sort(edges, axis=1), axis=0)


def _chain(along: NDArray[np.float64]) -> NDArray[np.int64]:
    """Link points one after another, by how far along a line they are."""
    order = np.argsort(along, kind="stable")
    return np.stack([order[:-1], order[1:]], axis=1)
