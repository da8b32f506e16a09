"""What the mirror meets at a pose: rays and a depth buffer.

The building is upright solids, so a ray of the horizontal plane (`cast`) settles a whole column of the polar image:
at distance d, the row of slope t shows the height EYE + d t.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, cached_property
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from omnieval.datasets.synthetic import camera
from omnieval.datasets.synthetic.building import CEILING, Building
from omnieval.datasets.synthetic.cast import Floats, Hits, Plan, cast
from omnieval.datasets.synthetic.lighting import CELL, grid_shape

FRONT, TOP, UNDER = 0, 1, 2
"""The parts of a solid that can be seen."""
_Value = TypeVar("_Value", bound=np.generic)
_FARTHEST = np.float32(60.0)

Pose = tuple[float, float, float]
"""x, y in metres, yaw in radians."""


@dataclass(frozen=True)
class Sight:
    """What every pixel of a polar image shows, and where that is; shape (AZIMUTHS, rows) each, distances in metres.

    Attributes
    ----------
    plan, hits
        What there is to be seen, and what the rays pass.
    depth
        Horizontal distance.
    code
        3 hit + part, or -1 for floor and ceiling.
    x, y, height
        The place.
    column, row
        Where that is in the light maps, in cells, not clipped to them.
    edges
        Numbers of the pixels, counted column by column, above which in the same column something else is seen.
    """

    plan: Plan
    hits: Hits
    depth: Floats
    code: NDArray[np.intp]
    x: Floats
    y: Floats
    height: Floats
    column: Floats
    row: Floats
    edges: NDArray[np.intp]

    @cached_property
    def _runs(self) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Where pixels with one code begin, and how many there are."""
        rows = camera.slopes().size
        starts = np.sort(np.concatenate([self.edges + 1, np.arange(camera.AZIMUTHS) * rows]))
        return self.code.take(starts), np.diff(starts, append=self.code.size)

    def spread(self, by_code: NDArray[_Value]) -> NDArray[_Value]:
        """Return what belongs to the code of each pixel, shape (AZIMUTHS, rows); the last is for floor and ceiling."""
        codes, lengths = self._runs
        return np.repeat(by_code.take(codes), lengths).reshape(self.code.shape)


def look(building: Building, plan: Plan, pose: Pose) -> Sight:
    """Return what is seen of a plan at a pose.

    Column 0 looks straight ahead, later ones further to the left; rows are `camera.radii()`.
    """
    x, y, yaw = pose
    hits = cast(plan, x, y, yaw, camera.AZIMUTHS)
    depth, code = _depth_buffer(plan, hits)
    dx, dy = (values[:, None] for values in directions(yaw))
    px, py = np.float32(x) + depth * dx, np.float32(y) + depth * dy
    height = np.float32(camera.EYE) + depth * camera.slopes()
    column, edge = np.divmod(np.flatnonzero(code[:, 1:] != code[:, :-1]), code.shape[1] - 1)
    edges = column * code.shape[1] + edge
    return Sight(plan, hits, depth, code, px, py, height, *in_cells(building, px, py), edges)


def bearings(yaw: float) -> NDArray[np.float64]:
    """Return the world azimuth of every column at a yaw, radians."""
    return np.asarray(yaw + 2.0 * np.pi * np.arange(camera.AZIMUTHS) / camera.AZIMUTHS)


def directions(yaw: float) -> tuple[Floats, Floats]:
    """Return x and y of the direction of every column at a yaw."""
    turn = bearings(yaw)
    return np.cos(turn).astype(np.float32), np.sin(turn).astype(np.float32)


def in_cells(building: Building, x: Floats, y: Floats) -> tuple[Floats, Floats]:
    """Return column and row of places in the light maps' grid, in cells, fractional."""
    left, _, bottom, _ = building.footprint
    return (x - np.float32(left)) / np.float32(CELL), (y - np.float32(bottom)) / np.float32(CELL)


def cell_number(building: Building, column: Floats, row: Floats) -> NDArray[np.intp]:
    """Return the number of the cell, row by row, of places given in cells; the nearest one for places outside."""
    rows, columns = grid_shape(building)
    inside = np.minimum(np.maximum(row, 0), rows - 1).astype(np.intp)
    inside *= columns
    inside += np.minimum(np.maximum(column, 0), columns - 1).astype(np.intp)
    return inside


def ranges(start: NDArray[np.intp], end: NDArray[np.intp]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return how long the ranges start ... end - 1 are, and all their values one after the other."""
    count = np.maximum(end - start, 0)
    until = np.cumsum(count)
    values = np.arange(until[-1] if until.size else 0)
    values += np.repeat(start - until + count, count)
    return count, values


def _depth_buffer(plan: Plan, hits: Hits) -> tuple[Floats, NDArray[np.intp]]:
    """Return depth and surface code of every pixel, shape (AZIMUTHS, rows)."""
    rows, eye = camera.slopes().size, np.float32(camera.EYE)
    low, high = plan.z0[hits.solid] - eye, plan.z1[hits.solid] - eye
    start, front, back, end = _row_spans(hits, low, high)
    shift = hits.column * rows
    opaque = np.flatnonzero(plan.glass[hits.solid] == 0.0)
    shell, inverse = _empty_building()

    fronts, front_pixel = ranges((front + shift)[opaque], (back + shift)[opaque])
    flat_start = np.stack([(back + shift)[opaque], (start + shift)[opaque]], axis=1).ravel()
    flat_end = np.stack([(end + shift)[opaque], (front + shift)[opaque]], axis=1).ravel()
    flats, flat_pixel = ranges(flat_start, flat_end)
    flat_code = np.stack([3 * opaque + TOP, 3 * opaque + UNDER], axis=1).ravel()
    flat_distance = np.repeat(np.stack([high[opaque], low[opaque]], axis=1).ravel(), flats)
    flat_distance *= inverse.take(flat_pixel)

    pixel = np.concatenate([front_pixel, flat_pixel])
    distance = np.concatenate([np.repeat(hits.near[opaque], fronts), flat_distance])
    owner = np.concatenate([np.repeat(3 * opaque + FRONT, fronts), np.repeat(flat_code, flats)])
    depth, code = shell.copy(), np.full(shell.shape, -1, np.intp)
    np.minimum.at(depth, pixel, distance)
    seen = np.flatnonzero(distance == depth.take(pixel))
    np.maximum.at(code, pixel.take(seen), owner.take(seen))  # of two at one distance, the later
    return depth.reshape(-1, rows), code.reshape(-1, rows)


@cache
def _empty_building() -> tuple[Floats, Floats]:
    """Return of every pixel the depth of floor or ceiling, and one over its slope, shape (AZIMUTHS * rows,) each."""
    slope, eye = camera.slopes(), np.float32(camera.EYE)
    inverse = np.float32(1.0) / slope
    shell = np.where(slope < 0, -eye * inverse, (np.float32(CEILING) - eye) * inverse)
    return np.tile(np.minimum(shell, _FARTHEST), camera.AZIMUTHS), np.tile(inverse, camera.AZIMUTHS)


def _row_spans(hits: Hits, low: Floats, high: Floats) -> tuple[NDArray[np.intp], ...]:
    """Return the rows at which the underside, front and top of each hit begin, and where the last ends."""
    slope = camera.slopes()
    bottom, top = np.searchsorted(slope, low / hits.near), np.searchsorted(slope, high / hits.near)
    under = np.minimum(np.searchsorted(slope, low / hits.far), bottom)
    over = np.maximum(np.searchsorted(slope, high / hits.far), top)
    return np.where(low > 0, under, bottom), bottom, top, np.where(high < 0, over, top)
