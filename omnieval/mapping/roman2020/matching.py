"""Image-level loop closure: the similarity curve of an image over the images of some nodes.

Sections 4.2 and 4.3 of Román et al., doi 10.3390/app10186480.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from omnieval.mapping.memory import ImageMemory
from omnieval.mapping.roman2020.conditions import prominence, similarities
from omnieval.mapping.roman2020.evidence import ImageMatch


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
    chosen = list(candidates)
    starts, total = {}, 0
    for node, images_of_node in members.items():
        starts[node] = total
        total += len(images_of_node)
    sizes = [len(members[node]) for node in chosen]
    ends = np.cumsum(sizes)
    frames = np.concatenate([members[node] for node in chosen])
    # Where a node's images begin on the curve, less where they begin among the candidates'.
    offsets = [starts[node] - end + size for node, end, size in zip(chosen, ends.tolist(), sizes, strict=True)]
    slots = np.arange(len(frames)) + np.repeat(offsets, sizes)
    distances = images.compare(frame, frames)
    position = similarities(distances.position)
    orientation = similarities(distances.orientation)
    similarity = position * orientation
    best = int(similarity.argmax())
    measured = prominence(similarity, slots, total, best)
    return ImageMatch(
        frames=frames,
        slots=slots,
        map_size=total,
        position=position,
        orientation=orientation,
        similarity=similarity,
        shifts=distances.shifts,
        best=best,
        node=chosen[int(ends.searchsorted(best, side="right"))],
        prominence=measured.best,
        prominence_mean=measured.total / (measured.peaks if prominence_mean == "peaks" else len(frames)),
        peaks=measured.peaks,
    )
