"""Horizontal rays against solids: what each azimuth meets, and how far away."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from omnieval.datasets.synthetic.building import CEILING
from omnieval.datasets.synthetic.solids import Shape, Solid

Floats = NDArray[np.float32]
Local = tuple[Floats, Floats, Floats, Floats]
"""Origin (x, y) and direction (x, y) of rays in the axes of the solids they are tried on."""
_NEAREST = np.float32(1e-3)


@dataclass(frozen=True)
class Plan:
    """Solids as columns, one value per solid, shape (solids,) each."""

    x: Floats
    y: Floats
    cos: Floats
    sin: Floats
    half_width: Floats
    half_depth: Floats
    z0: Floats
    z1: Floats
    round: NDArray[np.bool_]
    glass: Floats
    fit: NDArray[np.bool_]
    side: NDArray[np.int32]
    top: NDArray[np.int32]

    @property
    def opaque(self) -> NDArray[np.bool_]:
        """The solids behind which nothing is seen: from floor to ceiling."""
        return np.asarray((self.z0 <= 0.0) & (self.z1 >= CEILING) & (self.glass == 0.0))


@dataclass(frozen=True)
class Hits:
    """Every solid that every ray passes, ordered by ray, shape (hits,) each.

    Attributes
    ----------
    column
        The ray.
    solid
        The solid.
    near, far
        Where the ray enters and leaves it, metres.
    across
        Where it enters, measured along the face, metres.
    face
        Width of that face, metres.
    incidence
        Cosine of the angle between ray and face normal.
    normal_x, normal_y
        The face's normal, in the building's frame.
    """

    column: NDArray[np.intp]
    solid: NDArray[np.intp]
    near: Floats
    far: Floats
    across: Floats
    face: Floats
    incidence: Floats
    normal_x: Floats
    normal_y: Floats


def plan_of(solids: Sequence[Solid], textures: dict[str, int]) -> Plan:
    """Return solids as columns; `textures` numbers the textures."""

    def column(values: list[float]) -> Floats:
        return np.array(values, np.float32)

    return Plan(
        x=column([s.x for s in solids]),
        y=column([s.y for s in solids]),
        cos=np.cos(column([s.yaw for s in solids])),
        sin=np.sin(column([s.yaw for s in solids])),
        half_width=column([s.width / 2 for s in solids]),
        half_depth=column([s.depth / 2 for s in solids]),
        z0=column([s.z0 for s in solids]),
        z1=column([s.z1 for s in solids]),
        round=np.array([s.shape is Shape.CYLINDER for s in solids]),
        glass=column([s.glass for s in solids]),
        fit=np.array([s.fit for s in solids]),
        side=np.array([textures[s.side] for s in solids], np.int32),
        top=np.array([textures[s.top] for s in solids], np.int32),
    )


def joined(first: Plan, second: Plan) -> Plan:
    """Return the solids of both plans, those of the first before those of the second."""
    return Plan(*(np.concatenate([getattr(plan, f.name) for plan in (first, second)]) for f in fields(Plan)))


def cast(plan: Plan, x: float, y: float, yaw: float, rays: int) -> Hits:
    """Send `rays` rays from (x, y) through the plan, the first along `yaw`, the others evenly to its left.

    Solids behind the first opaque one of a ray are left out.
    """
    origin = _origin(plan, x, y)
    column, solid = _candidates(plan, origin, yaw, rays)
    azimuth = np.asarray(yaw + (2.0 * np.pi / rays) * np.arange(rays))
    direction = np.cos(azimuth).astype(np.float32)[column], np.sin(azimuth).astype(np.float32)[column]
    local = _local(plan, origin, solid, direction)
    near, far = _box_distances(plan.half_width[solid], plan.half_depth[solid], local)
    curved = np.flatnonzero(plan.round[solid])
    near[curved], far[curved] = _round_distances(plan.half_width[solid[curved]], _taken(local, curved))
    wall = np.full(rays, np.inf, np.float32)
    met = (near < far) & (far > _NEAREST)
    blocks = np.flatnonzero(met & plan.opaque[solid])
    np.minimum.at(wall, column[blocks], near[blocks])
    kept = np.flatnonzero(met & (near <= wall[column]))
    kept = kept[np.argsort(column[kept], kind="stable")]
    near = np.maximum(near[kept], _NEAREST)
    return _entered(plan, column[kept], solid[kept], near, far[kept], _taken(local, kept))


def _origin(plan: Plan, x: float, y: float) -> tuple[Floats, Floats]:
    """Return (x, y) in the axes of every solid."""
    rx, ry = np.float32(x) - plan.x, np.float32(y) - plan.y
    return plan.cos * rx + plan.sin * ry, plan.cos * ry - plan.sin * rx


def _candidates(
    plan: Plan, origin: tuple[Floats, Floats], yaw: float, rays: int
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return every (ray, solid) that may meet: the rays between the outermost corners of a solid's bounding box."""
    ox, oy = origin
    middle = np.arctan2(-oy, -ox)
    corners = [
        np.arctan2(sy * plan.half_depth - oy, sx * plan.half_width - ox) - middle for sx in (-1, 1) for sy in (-1, 1)
    ]
    spread = np.mod(np.stack(corners) + np.pi, 2 * np.pi) - np.pi  # a box seen from outside spans less than pi
    inside = (np.abs(ox) <= plan.half_width) & (np.abs(oy) <= plan.half_depth)
    bearing = middle + np.arctan2(plan.sin, plan.cos) - yaw
    step = 2.0 * np.pi / rays
    first = np.floor((bearing + spread.min(axis=0)) / step).astype(np.intp)
    last = np.ceil((bearing + spread.max(axis=0)) / step).astype(np.intp)
    count = np.where(inside, rays, np.minimum(last - first + 1, rays))
    solid = np.repeat(np.arange(count.size), count)
    offset = np.arange(solid.size) - np.repeat(np.cumsum(count) - count, count)
    return (first[solid] + offset) % rays, solid


def _local(
    plan: Plan, origin: tuple[Floats, Floats], solid: NDArray[np.intp], direction: tuple[Floats, Floats]
) -> Local:
    """Return origins and directions of rays in the axes of the solids they may meet."""
    dx, dy = direction
    cos, sin = plan.cos[solid], plan.sin[solid]
    return origin[0][solid], origin[1][solid], cos * dx + sin * dy, cos * dy - sin * dx


def _taken(local: Local, which: NDArray[np.intp]) -> Local:
    ox, oy, lx, ly = local
    return ox[which], oy[which], lx[which], ly[which]


def _box_distances(half_width: Floats, half_depth: Floats, local: Local) -> tuple[Floats, Floats]:
    """Return where rays enter and leave boxes (the slab method)."""
    ox, oy, lx, ly = local
    with np.errstate(divide="ignore"):
        ix, iy = np.float32(1.0) / lx, np.float32(1.0) / ly
    ix, iy = np.clip(ix, -1e6, 1e6), np.clip(iy, -1e6, 1e6)
    mid_x, mid_y = -ox * ix, -oy * iy
    half_x, half_y = half_width * np.abs(ix), half_depth * np.abs(iy)
    return np.maximum(mid_x - half_x, mid_y - half_y), np.minimum(mid_x + half_x, mid_y + half_y)


def _round_distances(radius: Floats, local: Local) -> tuple[Floats, Floats]:
    """Return where rays enter and leave cylinders; near > far where they miss."""
    ox, oy, lx, ly = local
    middle = -(ox * lx + oy * ly)
    inside = radius**2 - (ox**2 + oy**2 - middle**2)
    half = np.sqrt(np.maximum(inside, 0.0))
    return np.where(inside > 0.0, middle - half, 1.0), np.where(inside > 0.0, middle + half, 0.0)


def _entered(
    plan: Plan,
    column: NDArray[np.intp],
    solid: NDArray[np.intp],
    near: Floats,
    far: Floats,
    local: Local,
) -> Hits:
    """Complete the hits by where on which face the rays enter."""
    ox, oy, lx, ly = local
    px, py = ox + near * lx, oy + near * ly
    hx, hy = plan.half_width[solid], plan.half_depth[solid]
    end = hx - np.abs(px) < hy - np.abs(py)  # enters through a face across the solid's x axis
    # Seen from outside, "to the right" must be to the right on every face, so that nothing is mirrored.
    across = np.where(end, np.where(px > 0, py, -py) + hy, np.where(py > 0, -px, px) + hx)
    face = np.where(end, 2 * hy, 2 * hx)
    incidence = np.where(end, np.abs(lx), np.abs(ly))
    nx = np.where(end, np.sign(px), np.float32(0.0))
    ny = np.where(end, np.float32(0.0), np.sign(py))
    is_round = plan.round[solid]
    if is_round.any():
        nx, ny = np.where(is_round, px / hx, nx), np.where(is_round, py / hx, ny)
        bearing = np.arctan2(py, px) + np.float32(np.pi)
        across = np.where(is_round, bearing * hx, across)
        face = np.where(is_round, np.float32(2 * np.pi) * hx, face)
        incidence = np.where(is_round, np.abs(px * lx + py * ly) / np.maximum(hx, 1e-6), incidence)
    cos, sin = plan.cos[solid], plan.sin[solid]
    return Hits(column, solid, near, far, across, face, incidence, cos * nx - sin * ny, sin * nx + cos * ny)
