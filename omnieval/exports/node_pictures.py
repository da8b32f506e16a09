"""Pictures of the nodes of a run: the panorama of each node's representative image, and the image as it was taken."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from omnieval.errors import ResultError
from omnieval.imaging.pictures import Pictures
from omnieval.material.reopened import reopened
from omnieval.results.run_folder import Run


@dataclass(frozen=True)
class NodePicture:
    """The representative image of a node: panorama and, where that was unwrapped, the image as it was taken.

    Both of shape (height, width, 3), BGR.
    """

    node: int
    frame: int
    panorama: NDArray[np.uint8]
    taken: NDArray[np.uint8] | None


@contextmanager
def pictures_of(run: Run) -> Iterator[Pictures]:
    """Give the pictures of the images that a run replayed, all of which are compared with its fingerprint first.

    Raises
    ------
    ConfigError, DatasetError
        If the images cannot be opened any more.
    ResultError
        If there are none, or they have changed since.
    """
    with reopened(run, describe=False) as material:
        if material.pictures is None:
            raise ResultError(f"{run.folder} was replayed from descriptors; it has no images to show")
        for _ in material.described:
            pass
        yield material.pictures


def node_pictures(pictures: Pictures, representatives: Iterable[tuple[int, int]]) -> Iterator[NodePicture]:
    """Yield the pictures of nodes, one at a time.

    Parameters
    ----------
    pictures
        Of the run's images.
    representatives
        (node, frame of its representative image).
    """
    for node, frame in representatives:
        yield NodePicture(node, frame, pictures.panorama(frame), pictures.omnidirectional(frame))
