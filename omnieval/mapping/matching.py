"""Image-level loop closure: the similarity curve of an image over the images of some nodes.

Sections 4.2 and 4.3 of Román et al., doi 10.3390/app10186480.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from omnieval.mapping.conditions import prominence, similarities
from omnieval.mapping.memory import ImageMemory
from omnieval.mapping.step import Match


def match_image(
    images: ImageMemory,
    frame: int,
    members: Mapping[int, NDArray[np.int64]],
    candidates: Iterable[int],
    *,
    prominence_mean: Literal["peaks", "candidates"],
) -> Match:
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
        What the mean prominence is taken over; see `MapperConfig`.
    """
    sizes = [len(frames) for frames in members.values()]
    starts = dict(zip(members, np.cumsum([0, *sizes])[:-1].tolist(), strict=True))
    chosen = list(candidates)
    frames = np.concatenate([members[node] for node in chosen])
    slots = np.concatenate([starts[node] + np.arange(len(members[node])) for node in chosen])
    position_distance, orientation_distance, shifts = images.distances(frame, frames)
    position = similarities(position_distance)
    orientation = similarities(orientation_distance)
    similarity = position * orientation
    best = int(np.argmax(similarity))
    measured = prominence(similarity, slots, sum(sizes), best)
    ends = np.cumsum([len(members[node]) for node in chosen])
    return Match(
        frames=frames,
        slots=slots,
        map_size=sum(sizes),
        position=position,
        orientation=orientation,
        similarity=similarity,
        shifts=shifts,
        best=best,
        node=chosen[int(np.searchsorted(ends, best, side="right"))],
        prominence=measured.best,
        prominence_mean=measured.total / (measured.peaks if prominence_mean == "peaks" else len(frames)),
        peaks=measured.peaks,
    )
