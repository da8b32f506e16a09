"""A map of part of a sequence: what a robot would have that never was in the rest."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from omnieval.components.component import Component
from omnieval.errors import ConfigError
from omnieval.loop import made_mapper, mapped, too_short
from omnieval.mapping.map import TopologicalMap, arrays_of
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
    if fault := too_short(made_mapper(mapper), len(frames)):
        raise ConfigError(f"part of the map: {fault}")
    final = mapped(mapper, map(map_.description, frames.tolist())).finish()
    of_images = ("files", "times", "xy", "yaws", "rooms", "orientations")
    parts: dict[str, Any] = {name: getattr(map_, name)[frames] for name in of_images}
    parts |= arrays_of(final, map_.positions[frames])
    return replace(map_, **parts)
