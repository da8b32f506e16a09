"""Image-level loop closure: the similarity curve of an image over the images of some nodes.

Sections 4.2 and 4.3 of Román et al., doi 10.3390/app10186480.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from omnieval.mapping.memory import ImageMemory
from omnieval.mapping.roman2020.conditions import prominence, similarities
from omnieval.mapping.roman2020.evidence import ImageMatch


@dataclass(frozen=True)
class Layout:
    """The m images of some candidate nodes, and where they stand on the curve over all images of the map.

    Attributes
    ----------
    frames, slots
        See `ImageMatch`.
    total
        Length of the curve.
    nodes
        The candidates.
    ends
        Where the images of each end in `frames`.
    """

    frames: NDArray[np.int64]
    slots: NDArray[np.int64]
    total: int
    nodes: tuple[int, ...]
    ends: NDArray[np.int64]

    def node_of(self, index: int) -> int:
        """Return the node of one of the images."""
        return self.nodes[int(self.ends.searchsorted(index, side="right"))]


def laid_out(members: Mapping[int, NDArray[np.int64]], candidates: Iterable[int]) -> Layout:
    """Lay the images of candidate nodes out; see `match_image`."""
    chosen = tuple(candidates)
    starts, total = {}, 0
    for node, images_of_node in members.items():
        starts[node] = total
        total += len(images_of_node)
    sizes = [len(members[node]) for node in chosen]
    ends = np.cumsum(sizes)
    frames = np.concatenate([members[node] for node in chosen])
    # Where a node's images begin on the curve, less where they begin among the candidates'.
    offsets = [starts[node] - end + size for node, end, size in zip(chosen, ends.tolist(), sizes, strict=True)]
    return Layout(frames, np.arange(len(frames)) + np.repeat(offsets, sizes), total, chosen, ends)


def match_image(
    images: ImageMemory,
    frame: int,
    members: Mapping[int, NDArray[np.int64]],
    candidates: Iterable[int],
    *,
    prominence_mean: Literal["peaks", "candidates"],
) -> ImageMatch:
    """Compare an image with all images of the candidate nodes.

    Parameters
    ----------
    images
        The descriptors of all images so far.
    frame
        The image to match.
    members
        Images of every node of the map, active and pending, by ascending node id.
    candidates
        Ids of the nodes to compare with, ascending, at least one.
    prominence_mean
        What the mean prominence is taken over; see `Roman2020Settings`.
    """
    layout = laid_out(members, candidates)
    distances = images.compare(frame, layout.frames)
    position = similarities(distances.position)
    orientation = similarities(distances.orientation)
    similarity = position * orientation
    best = int(similarity.argmax())
    measured = prominence(similarity, layout.slots, layout.total, best)
    return ImageMatch(
        frames=layout.frames,
        slots=layout.slots,
        map_size=layout.total,
        position=position,
        orientation=orientation,
        similarity=similarity,
        shifts=distances.shifts,
        best=best,
        node=layout.node_of(best),
        prominence=measured.best,
        prominence_mean=measured.total / (measured.peaks if prominence_mean == "peaks" else len(layout.frames)),
        peaks=measured.peaks,
    )
