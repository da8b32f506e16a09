"""Material that follows on the images of a map: one sequence, of both."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterator
from itertools import chain
from pathlib import Path

import numpy as np

from omnieval.datasets.sequence import Frame, Pose
from omnieval.descriptors.description import DescribedFrame
from omnieval.imaging.pictures import JoinedPictures, Pictures
from omnieval.mapping.map import TopologicalMap
from omnieval.material.material import Earlier, Material
from omnieval.material.opening import digest
from omnieval.material.poses import why_unposed
from omnieval.results.map_file import UNTIMED


def following(earlier: Earlier, material: Material, pictures_before: Callable[[], Pictures]) -> Material:
    """Return material as what follows on the images of a map: one sequence, of both.

    Parameters
    ----------
    earlier
        The map, and its run.
    material
        What follows.
    pictures_before
        Opens the pictures of the images in the map, once somebody wants to see one.
    """
    map_ = earlier.map
    frames = (*_frames_of(map_), *material.frames)
    positions, unposed = None, material.unposed
    if not map_.is_posed:
        unposed = "the images of the map that is continued have no poses"
    elif material.positions is not None:
        positions, unposed = np.vstack([map_.xy, material.positions]), why_unposed(frames)
    pictures = material.pictures
    if pictures is not None:
        pictures = JoinedPictures(pictures_before, len(map_), pictures)
    return dataclasses.replace(
        material,
        name=f"{earlier.run.manifest['sequence']}+{material.name}",
        frames=frames,
        positions=positions,
        unposed=unposed,
        described=chain(_described_in(map_), material.described),
        pictures=pictures,
        earlier=earlier,
    )


def _frames_of(map_: TopologicalMap) -> Iterator[Frame]:
    """Yield the images of a map, of which only names, times, places and rooms are known."""
    columns = (map_.files.tolist(), map_.times.tolist(), map_.xy.tolist(), map_.yaws.tolist(), map_.rooms.tolist())
    for file, time_ns, (x, y), yaw, room in zip(*columns, strict=True):
        pose = Pose(x, y, yaw) if math.isfinite(x) and math.isfinite(y) else None
        yield Frame(Path(), file, None if time_ns == UNTIMED else time_ns, pose, room or None)


def _described_in(map_: TopologicalMap) -> Iterator[DescribedFrame]:
    for description in map_.descriptions():
        yield DescribedFrame(description, digest(description))
