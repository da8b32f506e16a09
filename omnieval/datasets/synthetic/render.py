"""From a pose to a polar image: rays, a depth buffer, textures and light.

The building is upright solids, so a ray of the horizontal plane (`cast`) settles a whole column of the polar image:
at distance d, the row of slope t shows the height EYE + d t.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from omnieval.datasets.synthetic import camera
from omnieval.datasets.synthetic.atlas import Atlas, build_atlas
from omnieval.datasets.synthetic.building import CEILING, Building, lamps, walls
from omnieval.datasets.synthetic.cast import Floats, Hits, Plan, cast, plan_of
from omnieval.datasets.synthetic.day import Day
from omnieval.datasets.synthetic.furniture import standing
from omnieval.datasets.synthetic.lighting import (
    CELL,
    SUN,
    Light,
    Sunshine,
    flow,
    grid_shape,
    light_maps,
    sunshine,
)
from omnieval.datasets.synthetic.outdoors import skyline
from omnieval.datasets.synthetic.solids import Solid
from omnieval.datasets.synthetic.textures import PIXELS

_FRONT, _TOP, _UNDER = 0, 1, 2
_LOWER, _UPPER = 0, 1
_PIXEL_ANGLE = np.float32(2.0 * np.pi / camera.AZIMUTHS * 1.3)
"""How much of the view a polar pixel covers, radians; a little more than its width keeps textures from flickering."""
_SHINE = {"linoleum": 0.8, "parquet": 0.8, "checker": 0.9, "tiles-small": 0.6, "planks": 0.7, "tiles-large": 0.9}
"""How shiny floors are; carpets and concrete are not."""
_SUN_COLOUR = np.array([0.75, 0.92, 1.0], np.float32)
_FACE_SHADE = np.array([1.0, 1.06, 0.62], np.float32)
"""Brightness of fronts, tops and undersides under the same light."""


@dataclass(frozen=True)
class Scene:
    """Everything that stays the same from frame to frame of a sequence.

    Attributes
    ----------
    building, light
        Where and when.
    atlas, solids
        Textures, and what carries them.
    floors
        Number of the floor's texture in every cell of the light maps; -1 outside the rooms.
    lights
        Light on upright surfaces, floors and lamps, one map below the other.
    sky
        What is seen through windows.
    flow
        From where the light comes.
    sunshine
        Where the sun shines, if it does.
    shine
        How shiny every texture is as a floor.
    """

    building: Building
    light: Light
    atlas: Atlas
    solids: tuple[Solid, ...]
    floors: NDArray[np.int32]
    lights: NDArray[np.float32]
    sky: NDArray[np.float32]
    flow: NDArray[np.float32]
    sunshine: Sunshine | None
    shine: Floats


def build_scene(day: Day, seed: int) -> Scene:
    """Build the scene of a day, with textures and outdoors drawn from `seed`."""
    building, light = day.building, day.light
    solids = [*walls(building), *standing(building, day.furniture), *lamps(building)]
    atlas = build_atlas(seed)
    maps = light_maps(building, light, solids, day.dark)
    towards = flow(maps[0])
    maps = np.concatenate([maps, _emissive(day)])
    return Scene(
        building,
        light,
        atlas,
        tuple(solids),
        _floor_map(building, atlas),
        maps.reshape(-1, maps.shape[2], 3),
        skyline(light, seed),
        towards,
        sunshine(building) if light.sun > 0.0 else None,
        _shine(atlas),
    )


def _emissive(day: Day) -> NDArray[np.float32]:
    """Return how brightly lamps shine, shape (1, rows, columns, 3)."""
    emissive = np.ones((1, *grid_shape(day.building), 3), np.float32)
    for code in day.dark:
        (row, column), (end_row, end_column) = (
            _cell_of(day.building, x, y)
            for x, y in (
                (day.building.room(code).x0, day.building.room(code).y0),
                (day.building.room(code).x1, day.building.room(code).y1),
            )
        )
        emissive[0, row:end_row, column:end_column] = 0.5
    return emissive


def _cell_of(building: Building, x: float, y: float) -> tuple[int, int]:
    left, _, bottom, _ = building.footprint
    return round((y - bottom) / CELL), round((x - left) / CELL)


def render_polar(scene: Scene, pose: tuple[float, float, float], people: tuple[Solid, ...] = ()) -> Floats:
    """Return what the mirror shows at a pose (x, y, yaw), shape (AZIMUTHS, rows, 3), float32 BGR, 255 saturates.

    Column 0 looks straight ahead, later ones further to the left; rows are `camera.radii()`.
    """
    x, y, yaw = pose
    turn = yaw + 2.0 * np.pi * np.arange(camera.AZIMUTHS) / camera.AZIMUTHS
    dx, dy = np.cos(turn).astype(np.float32), np.sin(turn).astype(np.float32)
    plan = plan_of([*scene.solids, *people], scene.atlas.index)
    hits = cast(plan, x, y, yaw, camera.AZIMUTHS)
    depth, code = _depth_buffer(plan, hits)
    px, py = np.float32(x) + depth * dx[:, None], np.float32(y) + depth * dy[:, None]
    met = np.float32(x) + hits.near * dx[hits.column], np.float32(y) + hits.near * dy[hits.column]
    picture, texture = _paint(scene, plan, hits, depth, code, (px, py), met)
    _show_outdoors(scene, picture, depth, (x, y), (dx, dy), turn, (texture < 0) & (code < 0))
    _polish_floor(scene, picture, texture, code)
    _veil_glass(plan, hits, picture, depth, scene.light)
    _soften_edges(plan, hits, picture, depth, code)
    return picture


def _depth_buffer(plan: Plan, hits: Hits) -> tuple[Floats, NDArray[np.int32]]:
    """Return depth and surface code of every pixel, shape (AZIMUTHS, rows).

    The code is 3 hit + part, or -1 for floor and ceiling.
    """
    slope = camera.slopes()
    eye, inverse = np.float32(camera.EYE), np.float32(1.0) / camera.slopes()
    shell = np.where(slope < 0, -eye * inverse, (np.float32(CEILING) - eye) * inverse)
    depth = np.tile(np.minimum(shell, np.float32(60.0)), camera.AZIMUTHS)
    code = np.full(depth.shape, -1, np.int32)
    low, high = plan.z0[hits.solid] - eye, plan.z1[hits.solid] - eye
    start, front, back, end = _row_spans(slope, hits, low, high)
    hit, row = _expanded(start, np.where(plan.glass[hits.solid] == 0.0, end, start))
    under, over = row < front[hit], row >= back[hit]
    flat = np.where(over, high[hit], low[hit]) * inverse[row]
    distance = np.where(under | over, flat, hits.near[hit])
    pixel = hits.column[hit] * slope.size + row
    np.minimum.at(depth, pixel, distance)
    seen = np.flatnonzero(distance == depth[pixel])
    part = np.where(under, np.int32(_UNDER), np.where(over, np.int32(_TOP), np.int32(_FRONT)))
    code[pixel[seen]] = (3 * hit + part)[seen]
    return depth.reshape(-1, slope.size), code.reshape(-1, slope.size)


def _expanded(start: NDArray[np.intp], end: NDArray[np.intp]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return (span, value) for every value of the ranges start ... end - 1, empty ones left out."""
    count = np.maximum(end - start, 0)
    span = np.repeat(np.arange(count.size), count)
    return span, np.arange(span.size) + np.repeat(start - np.cumsum(count) + count, count)


def _row_spans(slope: Floats, hits: Hits, low: Floats, high: Floats) -> tuple[NDArray[np.intp], ...]:
    """Return the rows at which the underside, front and top of each hit begin, and where the last ends."""
    bottom = np.searchsorted(slope, low / hits.near)
    top = np.searchsorted(slope, high / hits.near)
    under = np.minimum(np.searchsorted(slope, low / hits.far), bottom)
    over = np.maximum(np.searchsorted(slope, high / hits.far), top)
    return np.where(low > 0, under, bottom), bottom, top, np.where(high < 0, over, top)


def _layers(column: NDArray[np.intp], hit: NDArray[np.intp]) -> list[NDArray[np.intp]]:
    """Split hits, ordered by column, into groups that have each column at most once."""
    if column.size == 0:
        return []
    first = np.flatnonzero(np.diff(column, prepend=-1))
    rank = np.arange(column.size) - np.repeat(first, np.diff(first, append=column.size))
    return [hit[rank == k] for k in range(int(rank.max()) + 1)]


def _paint(
    scene: Scene,
    plan: Plan,
    hits: Hits,
    depth: Floats,
    code: NDArray[np.int32],
    place: tuple[Floats, Floats],
    met: tuple[Floats, Floats],
) -> tuple[Floats, NDArray[np.int32]]:
    """Return the lit colour of every pixel and the number of its texture; `met` is where the hits are."""
    px, py = place
    slope = camera.slopes()
    height = np.float32(camera.EYE) + depth * slope
    texture, u, v, lod = _surface(scene, plan, hits, depth, code, px, py, height)
    colour = scene.atlas.look_up(texture, u, v, lod)
    shades = _shades(plan, hits)
    shades *= _facing_light(scene, hits, met)
    shade = np.append(shades, np.float32(1.0))[code]
    shade *= np.float32(0.86) + np.float32(0.07) * height
    lamp = texture == scene.atlas.index["lamp"]
    floor = (code < 0) & (slope < 0)
    layer = np.where(lamp, np.float32(2.0), floor.astype(np.float32))
    rows, columns = grid_shape(scene.building)
    left, _, bottom, _ = scene.building.footprint
    column = np.clip((px - np.float32(left)) / np.float32(CELL) - 0.5, 0, columns - 1)
    row = np.clip((py - np.float32(bottom)) / np.float32(CELL) - 0.5, 0, rows - 1) + layer * np.float32(rows)
    light = cv2.remap(scene.lights, column, row, cv2.INTER_LINEAR)
    picture = np.asarray(colour * light * shade[..., None], dtype=np.float32)
    if scene.sunshine is not None:
        _let_the_sun_in(scene, scene.sunshine, hits, code, (px, py, height), (colour, picture))
    return picture, texture


def _shades(plan: Plan, hits: Hits) -> Floats:
    """Return the brightness of every hit's front, top and underside, shape (3 hits,)."""
    shade = np.tile(_FACE_SHADE, (hits.column.size, 1))
    shade[:, _FRONT] *= np.where(plan.round[hits.solid], 0.7 + 0.3 * hits.incidence, 1.0)
    lamp = plan.z0[hits.solid] > CEILING - 0.2
    shade[lamp] = 1.25
    return shade.ravel()


def _facing_light(scene: Scene, hits: Hits, at: tuple[Floats, Floats]) -> Floats:
    """Return how much more light the fronts get that look towards it, and less those that look away, (3 hits,)."""
    factor = np.ones((hits.column.size, 3), np.float32)
    # Just before the face, since the wall's own cells are lit from both sides.
    before = np.float32(0.1)
    towards = scene.flow[_cells(scene.building, at[0] + before * hits.normal_x, at[1] + before * hits.normal_y)]
    facing = towards[:, 0] * hits.normal_x + towards[:, 1] * hits.normal_y
    factor[:, _FRONT] = np.maximum(np.float32(1.0) + np.float32(scene.light.look.directed) * facing, np.float32(0.25))
    return factor.ravel()


def _let_the_sun_in(
    scene: Scene,
    sun: Sunshine,
    hits: Hits,
    code: NDArray[np.int32],
    place: tuple[Floats, Floats, Floats],
    painted: tuple[NDArray[np.uint8], Floats],
) -> None:
    """Add the sun where the line towards it leaves through a pane of the room's southern windows."""
    px, py, height = place
    row, column = _cells(scene.building, px, py)
    facade = sun.facade[row, column]
    chosen = np.nonzero(facade >= 0)
    if chosen[0].size == 0:
        return
    number = facade[chosen]
    sx, sy, sz = (np.float32(value) for value in SUN)
    way = (py[chosen] - sun.at[number]) / -sy
    left = np.float32(scene.building.footprint[0])
    window = np.clip((px[chosen] + way * sx - left) / np.float32(CELL), 0, sun.low.shape[1] - 1).astype(np.int32)
    z = height[chosen] + way * sz
    lit = (z > sun.low[number, window]) & (z < sun.high[number, window])
    facing = np.full((hits.column.size, 3), sz, np.float32)
    facing[:, _FRONT] = np.maximum(hits.normal_x * sx + hits.normal_y * sy, 0.0)
    facing[:, _UNDER] = 0.0
    falls = np.append(facing.ravel(), sz)[code[chosen]] * np.float32(scene.light.sun / np.sqrt(sx**2 + sy**2 + sz**2))
    colour, picture = painted
    sunny = chosen[0][lit], chosen[1][lit]
    picture[sunny] += colour[sunny] * (falls[lit][:, None] * _SUN_COLOUR)


def _polish_floor(scene: Scene, picture: Floats, texture: NDArray[np.int32], code: NDArray[np.int32]) -> None:
    """Let shiny floors mirror what is above them, the more the flatter they are seen."""
    slope = camera.slopes()
    below = int(np.searchsorted(slope, 0.0))
    sine = -slope[:below] / np.sqrt(1.0 + slope[:below] ** 2)
    share = np.float32(scene.light.look.gloss) * (np.float32(0.04) + np.float32(0.96) * (1.0 - sine) ** 4)
    mirrored = np.clip(np.searchsorted(slope, -slope[:below]), 0, slope.size - 1)
    # A floor is no mirror: what it shows is blurred, above all up and down.
    above = cv2.blur(np.minimum(picture, np.float32(900.0)), (15, 3))
    shiny = scene.shine[texture[:, :below]] * (code[:, :below] < 0)
    picture[:, :below] += (shiny * share)[..., None] * above[:, mirrored]


def _shine(atlas: Atlas) -> Floats:
    """Return how shiny every texture is as a floor, 0 to 1; the last stands for what lies outdoors."""
    shine = np.zeros(len(atlas.index) + 1, np.float32)
    for name, value in _SHINE.items():
        shine[atlas.index[name]] = value
    return shine


def _surface(
    scene: Scene,
    plan: Plan,
    hits: Hits,
    depth: Floats,
    code: NDArray[np.int32],
    px: Floats,
    py: Floats,
    height: Floats,
) -> tuple[NDArray[np.int32], Floats, Floats, Floats]:
    """Return texture number, texture coordinates (repetitions) and level of detail of every pixel."""
    solid = hits.solid
    eye = np.float32(camera.EYE)
    texture = np.stack([plan.side[solid], plan.top[solid], plan.top[solid]], axis=1).ravel()
    ceiling = scene.atlas.index["ceiling"]
    shell = np.where(camera.slopes() < 0, scene.floors[_cells(scene.building, px, py)], np.int32(ceiling))
    texture = np.where(code < 0, shell, np.append(texture, np.int32(0))[code])
    size = scene.atlas.sizes[texture]
    hit, part = np.divmod(code, np.int32(3))
    front = (code >= 0) & (part == _FRONT)
    hit = np.where(front, hit, -1).astype(np.intp)
    fit, z0 = plan.fit[solid], plan.z0[solid]
    side_size = scene.atlas.sizes[plan.side[solid]]
    rise = _of_hit(1.0 / np.where(fit, plan.z1[solid] - z0, side_size), hit)
    u = np.where(front, _of_hit(hits.across / np.where(fit, hits.face, side_size), hit), px / size)
    v = np.where(front, (height - _of_hit(np.where(fit, z0, 0.0), hit)) * rise, py / size)
    stretch = np.where(
        front,
        _of_hit(1.0 / np.sqrt(np.maximum(hits.incidence, 0.1)), hit),
        np.sqrt(depth / np.maximum(np.abs(height - eye), np.float32(0.02))),
    )
    per_metre = np.where(front, np.maximum(rise, np.float32(0.2)), np.float32(1.0) / size)
    lod = np.log2(depth * stretch * per_metre * (_PIXEL_ANGLE * PIXELS))
    return texture, u, v, lod


def _of_hit(values: NDArray[np.floating], hit: NDArray[np.intp]) -> Floats:
    """Return the value that belongs to each pixel's hit, 0 where `hit` is -1."""
    return np.append(values.astype(np.float32), np.float32(0.0)).take(hit, mode="wrap")


def _floor_map(building: Building, atlas: Atlas) -> NDArray[np.int32]:
    """Return the floor's texture number in every cell of the light maps' grid."""
    rows, columns = grid_shape(building)
    left, _, bottom, _ = building.footprint
    floors = np.full((rows, columns), -1, np.int32)
    y, x = bottom + (np.arange(rows) + 0.5) * CELL, left + (np.arange(columns) + 0.5) * CELL
    for room in building.rooms:
        in_y, in_x = (y > room.y0 - 0.08) & (y < room.y1 + 0.08), (x > room.x0 - 0.08) & (x < room.x1 + 0.08)
        floors[np.ix_(in_y, in_x)] = atlas.index[room.floor]
    return floors


def _cells(building: Building, px: Floats, py: Floats) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Return row and column of places in the light maps' grid, the nearest ones for places outside."""
    rows, columns = grid_shape(building)
    left, _, bottom, _ = building.footprint
    column = np.clip((px - np.float32(left)) / np.float32(CELL), 0, columns - 1).astype(np.int32)
    row = np.clip((py - np.float32(bottom)) / np.float32(CELL), 0, rows - 1).astype(np.int32)
    return row, column


def _show_outdoors(
    scene: Scene,
    picture: Floats,
    depth: Floats,
    at: tuple[float, float],
    direction: tuple[Floats, Floats],
    turn: NDArray[np.float64],
    void: NDArray[np.bool_],
) -> None:
    """Put the outdoors where a ray has left the building before it met anything, and in the `void` of its courts."""
    x0, x1, y0, y1 = scene.building.footprint
    dx, dy = direction
    with np.errstate(divide="ignore"):
        leave_x = np.where(dx > 0, x1 - at[0], at[0] - x0) / np.abs(dx)
        leave_y = np.where(dy > 0, y1 - at[1], at[1] - y0) / np.abs(dy)
    outside = (depth > (np.minimum(leave_x, leave_y) + 0.02)[:, None]) | void
    column = np.mod(np.rint(turn / (2 * np.pi) * scene.sky.shape[0]).astype(np.intp), scene.sky.shape[0])
    c, r = np.nonzero(outside)
    picture[c, r] = scene.sky[column[c], r]


def _veil_glass(plan: Plan, hits: Hits, picture: Floats, depth: Floats, light: Light) -> None:
    """Let panes take away a share of what is behind them and add a faint reflection."""
    eye = np.float32(camera.EYE)
    glass = np.flatnonzero(plan.glass[hits.solid] > 0.0)
    low, high = plan.z0[hits.solid] - eye, plan.z1[hits.solid] - eye
    start = np.searchsorted(camera.slopes(), low / hits.near)
    end = np.searchsorted(camera.slopes(), high / hits.near)
    rows = np.arange(camera.slopes().size)
    reflection = 190.0 * (np.array(light.ambient, np.float32) + 0.3 * np.array(light.lamp, np.float32))
    for chosen in _layers(hits.column[glass], glass):
        column = hits.column[chosen]
        behind = (rows >= start[chosen][:, None]) & (rows < end[chosen][:, None])
        behind &= depth[column] > hits.near[chosen][:, None]
        # A grazing view of a pane reflects more than a square one.
        share = plan.glass[hits.solid[chosen]] * (1.0 + 1.5 * (1.0 - hits.incidence[chosen]) ** 2)
        share = (behind * share[:, None]).astype(np.float32)[..., None]
        picture[column] += share * (reflection - picture[column])


def _soften_edges(plan: Plan, hits: Hits, picture: Floats, depth: Floats, code: NDArray[np.int32]) -> None:
    """Mix the two surfaces that meet within a pixel of a column by the share of it that each covers.

    Without this, what is nearly level (a sill, the lower edge of a poster) would have a stepped rim.
    """
    slope = camera.slopes()
    column, below = np.nonzero(code[:, 1:] != code[:, :-1])
    above = below + 1
    code_below, code_above = code[column, below], code[column, above]
    # The rim belongs to the nearer of the two; floor and ceiling have none of their own.
    of_below = (code_above < 0) | ((code_below >= 0) & (depth[column, below] <= depth[column, above]))
    rim = np.where(of_below, _edge_slopes(plan, hits, _UPPER)[code_below], _edge_slopes(plan, hits, _LOWER)[code_above])
    edge = np.clip((rim - slope[below]) / (slope[above] - slope[below]), 0.0, 1.0)
    step = picture[column, above] - picture[column, below]
    # Sample k stands for the pixel from k - 0.5 to k + 0.5; the edge lies in the lower or in the upper one.
    low, high = np.flatnonzero(edge < 0.5), np.flatnonzero(edge > 0.5)
    picture[column[low], below[low]] += (np.float32(0.5) - edge[low])[:, None] * step[low]
    picture[column[high], above[high]] -= (edge[high] - np.float32(0.5))[:, None] * step[high]


def _edge_slopes(plan: Plan, hits: Hits, side: int) -> Floats:
    """Return the slope at which each hit's front, top and underside end, at their `side`; shape (3 hits,)."""
    low, high = plan.z0[hits.solid] - np.float32(camera.EYE), plan.z1[hits.solid] - np.float32(camera.EYE)
    front = (low, high)[side] / hits.near
    top = high / (hits.near, hits.far)[side]
    under = low / (hits.far, hits.near)[side]
    return np.stack([front, top, under], axis=1).ravel()
