"""A map of part of a sequence: what a robot would have that never was in the rest."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from omnieval.components import Component
from omnieval.errors import ConfigError
from omnieval.loop import made_mapper, too_short
from omnieval.mapping.map import TopologicalMap
from omnieval.mapping.memory import AHEAD, blocks
from omnieval.mapping.partition import count_transitions
from omnieval.wording import did_you_mean


def kept_images(map_: TopologicalMap, limit: int | None, without_rooms: Sequence[str]) -> NDArray[np.bool_]:
    """Return which images stay: at most the first `limit`, and none of some rooms, shape (n,).

    Raises
    ------
    ConfigError
        If there is no such room, or nothing stays.
    """
    rooms = sorted(set(map_.rooms.tolist()) - {""})
    for room in without_rooms:
        if room not in rooms:
            hint = did_you_mean(room, rooms) if rooms else "its images have no room labels"
            raise ConfigError(f"the map has no room {room!r}; {hint}")
    kept = ~np.isin(map_.rooms, without_rooms)
    if limit is not None:
        kept[limit:] = False
    if not kept.any():
        raise ConfigError("no image of the map stays; leave out fewer rooms or give a larger --map-limit")
    return kept


def map_of_part(map_: TopologicalMap, kept: NDArray[np.bool_], mapper: Component) -> TopologicalMap:
    """Return the map that the mapper makes of some of the images, in their order.

    Parameters
    ----------
    map_
        The whole map; it stays as it is.
    kept
        Which images, shape (n,).
    mapper
        What made it.

    Raises
    ------
    ConfigError
        If they are too few for the mapper.
    """
    frames = np.flatnonzero(kept)
    made = made_mapper(mapper)
    if fault := too_short(made, len(frames)):
        raise ConfigError(f"part of the map: {fault}")
    for block in blocks(map(map_.description, frames.tolist()), AHEAD):
        made.expect(block)
        for description in block:
            made.step(description)
    final = made.finish()
    positions = map_.positions[frames]
    representatives = []
    for node, mean in zip(final.nodes, final.representatives, strict=True):
        own = np.flatnonzero(final.labels == node)
        representatives.append(int(own[np.linalg.norm(positions[own] - mean, axis=1).argmin()]))
    edges = [(one, other, count) for (one, other), count in count_transitions(final.labels).items()]
    return replace(
        map_,
        files=map_.files[frames],
        times=map_.times[frames],
        xy=map_.xy[frames],
        yaws=map_.yaws[frames],
        rooms=map_.rooms[frames],
        positions=positions,
        orientations=map_.orientations[frames],
        labels=final.labels,
        nodes=np.array(final.nodes, np.int64),
        active=np.array([node in final.active for node in final.nodes]),
        representatives=final.representatives,
        representative_frames=np.array(representatives, np.int64),
        edges=np.array(edges, np.int64).reshape(-1, 3),
    )
