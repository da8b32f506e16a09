"""What an answer is worth, given where the images were truly taken."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from omnieval.localization.strategies import Found
from omnieval.mapping.map import TopologicalMap
from omnieval.mapping.step import Role


@dataclass(frozen=True)
class Truth:
    """How far an image was from those of the map, and what its answer is worth; None where that is not known.

    Attributes
    ----------
    error
        Distance of the best image from where the query was taken, metres.
    heading_error
        How far the heading that the best image and its shift tell is from the true one, degrees, 0 to 180.
    reachable_frame, reachable
        The image of the map taken nearest to the query, and its distance, metres.
    nearest_rank
        1 if the best image is that one, 2 if one image was nearer, ...
    rank
        Place of the first image within `theta` metres among those compared, by similarity; None if none was.
    node_right
        Whether an image of the node that was chosen was taken within `theta` metres of the query.
    """

    error: float | None = None
    heading_error: float | None = None
    reachable_frame: int | None = None
    reachable: float | None = None
    nearest_rank: int | None = None
    rank: int | None = None
    node_right: bool | None = None


def truth_of(
    map_: TopologicalMap, found: Found, xy: tuple[float, float] | None, yaw: float | None, theta: float
) -> Truth:
    """Judge an answer.

    Parameters
    ----------
    map_
        The map.
    found
        The answer.
    xy, yaw
        Where the query was taken, metres, and its heading, radians; None where unknown.
    theta
        Two images at most this far apart show the same place.
    """
    if xy is None or not map_.is_posed:
        return Truth(heading_error=_heading_error(map_, found, yaw))
    distances = np.linalg.norm(map_.xy - np.asarray(xy), axis=1)
    nearest = int(np.nanargmin(distances))
    about: dict[str, Any] = {"reachable_frame": nearest, "reachable": float(distances[nearest])}
    near = np.flatnonzero(distances[found.ranked] <= theta)
    about["rank"] = int(near[0]) + 1 if len(near) else None
    match = found.step.match
    if found.step.role is not Role.REFUSED and match is not None:
        error = float(distances[match.frame])
        if math.isfinite(error):
            about |= {"error": error, "nearest_rank": 1 + int(np.count_nonzero(distances < error))}
        if found.step.node is not None:
            about["node_right"] = bool((distances[map_.images_of(found.step.node)] <= theta).any())
    return Truth(heading_error=_heading_error(map_, found, yaw), **about)


def heading_between(yaw: float, other: float, shift: int, cells: int) -> float:
    """Return how far a heading is from that of another image turned by its shift, degrees, 0 to 180.

    The heading of a query is that of the map's image plus the angle by which its orientation descriptor is rolled.

    Examples
    --------
    >>> heading_between(math.pi / 2, 0.0, 64, 256)
    0.0
    >>> heading_between(0.0, 0.0, 255, 256) == 360 / 256
    True
    """
    turned = yaw - other - 2.0 * math.pi * shift / cells
    return abs(math.degrees(math.atan2(math.sin(turned), math.cos(turned))))


def _heading_error(map_: TopologicalMap, found: Found, yaw: float | None) -> float | None:
    match = found.step.match
    if yaw is None or match is None or found.step.role is Role.REFUSED:
        return None
    error = heading_between(yaw, float(map_.yaws[match.frame]), match.shift, map_.cells)
    return error if math.isfinite(error) else None
