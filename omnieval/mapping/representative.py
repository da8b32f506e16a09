"""Which image stands for a node: the one whose position descriptor is nearest to their mean."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray


def representative_frames(
    labels: NDArray[np.int64],
    nodes: Sequence[int],
    means: NDArray[np.float64],
    descriptors: NDArray[np.float32] | NDArray[np.float64],
    among: NDArray[np.int64] | None = None,
) -> dict[int, int]:
    """Return the representative image of every node that has one.

    Parameters
    ----------
    labels
        Node of every image, 0 where unassigned, shape (n,).
    nodes, means
        The nodes, and the mean position descriptor of each, shape (nodes, d).
    descriptors
        Position descriptors of all images, shape (n, d).
    among
        The images that may represent a node, ascending; None for all.
    """
    images = np.arange(len(labels)) if among is None else among
    order = images[np.argsort(labels[images], kind="stable")]
    groups = np.split(order, np.flatnonzero(np.diff(labels[order])) + 1) if len(order) else []
    members = {int(labels[frames[0]]): frames for frames in groups}
    found = {}
    for node, mean in zip(nodes, means, strict=True):
        if (frames := members.get(node)) is not None:
            found[node] = int(frames[np.argmin(np.linalg.norm(descriptors[frames] - mean, axis=1))])
    return found


def cluster_means(labels: NDArray[np.int64], descriptors: NDArray[np.float32]) -> tuple[list[int], NDArray[np.float64]]:
    """Return the nodes of a partition and the mean descriptor of each, shape (nodes, d)."""
    nodes = np.unique(labels[labels > 0]).tolist()
    means = [descriptors[labels == node].mean(axis=0, dtype=np.float64) for node in nodes]
    return nodes, np.array(means).reshape(len(nodes), descriptors.shape[1])
