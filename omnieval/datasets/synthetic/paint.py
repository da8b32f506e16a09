"""From what is met to its colour: textures, the light that falls on them, and the sun."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from omnieval.datasets.synthetic import camera
from omnieval.datasets.synthetic.building import CEILING
from omnieval.datasets.synthetic.cast import Floats
from omnieval.datasets.synthetic.lighting import SUN, Sunshine, grid_shape
from omnieval.datasets.synthetic.scene import Scene
from omnieval.datasets.synthetic.sight import FRONT, UNDER, Pose, Sight, cell_number, directions, in_cells
from omnieval.datasets.synthetic.textures import PIXELS

_PIXEL_ANGLE = np.float32(2.0 * np.pi / camera.AZIMUTHS * 1.3)
"""How much of the view a polar pixel covers, radians; a little more than its width keeps textures from flickering."""
_SUN_COLOUR = np.array([0.75, 0.92, 1.0], np.float32)
_FACE_SHADE = np.array([1.0, 1.06, 0.62], np.float32)
"""Brightness of fronts, tops and undersides under the same light."""


@dataclass(frozen=True)
class Faces:
    """The parts of all hits as columns by surface code; one more, the last, stands for floor and ceiling.

    Attributes
    ----------
    texture
        Its number; the ceiling's for the last.
    front
        Whether it is upright: only then the next five mean something.
    across
        Where the ray meets it, in repetitions of the texture.
    base, rise
        Height at which the texture begins, metres, and repetitions a metre.
    stretch, dense
        How much a grazing view stretches a pixel along it, and repetitions a metre for the level of detail.
    shade
        How bright it is under the same light.
    layer
        Rows down to the map of the light that falls on it.
    """

    texture: NDArray[np.intp]
    front: NDArray[np.uint8]
    across: Floats
    base: Floats
    rise: Floats
    stretch: Floats
    dense: Floats
    shade: Floats
    layer: Floats


def paint(scene: Scene, sight: Sight, pose: Pose) -> tuple[Floats, NDArray[np.intp]]:
    """Return the lit colour of every pixel, shape (AZIMUTHS, rows, 3), and the number of its texture."""
    faces = _faces(scene, sight, pose)
    below = camera.below_horizon()
    cell = cell_number(scene.building, sight.column[:, :below], sight.row[:, :below])
    floor = sight.code[:, :below] < 0
    texture = sight.spread(faces.texture)
    np.copyto(texture[:, :below], scene.floors.take(cell), where=floor)
    colour = _textured(scene, sight, faces, texture)
    shade = sight.spread(faces.shade)
    shade *= np.float32(0.86) + np.float32(0.07) * sight.height
    layer = sight.spread(faces.layer)
    rows, columns = grid_shape(scene.building)
    layer[:, :below] += floor * np.float32(rows)
    column = np.minimum(np.maximum(sight.column - 0.5, 0), columns - 1)
    layer += np.minimum(np.maximum(sight.row - 0.5, 0), rows - 1)
    picture = np.asarray(cv2.remap(scene.lights, column, layer, cv2.INTER_LINEAR), np.float32)
    np.multiply(colour, picture, out=picture)
    picture *= cv2.merge([shade, shade, shade])
    if scene.sunshine is not None:
        _let_the_sun_in(scene, scene.sunshine, sight, (colour, picture))
    return picture, texture


def _faces(scene: Scene, sight: Sight, pose: Pose) -> Faces:
    """Return the columns of what the rays from a pose meet."""
    plan, hits, solid = sight.plan, sight.hits, sight.hits.solid
    texture = np.stack([plan.side[solid], plan.top[solid], plan.top[solid]], axis=1).ravel()
    fit, z0 = plan.fit[solid], plan.z0[solid]
    side = scene.atlas.sizes[plan.side[solid]]
    rise = 1.0 / np.where(fit, plan.z1[solid] - z0, side)
    upright = np.zeros((hits.column.size, 3), np.uint8)
    upright[:, FRONT] = 1
    shades = _shades(sight) * _facing_light(scene, sight, pose)
    rows, _ = grid_shape(scene.building)
    return Faces(
        np.append(texture, scene.atlas.index["ceiling"]).astype(np.intp),
        np.append(upright.ravel(), np.uint8(0)),
        _of_fronts(hits.across / np.where(fit, hits.face, side)),
        _of_fronts(np.where(fit, z0, np.float32(0.0))),
        _of_fronts(rise),
        _of_fronts(1.0 / np.sqrt(np.maximum(hits.incidence, 0.1))),
        _of_fronts(np.maximum(rise.astype(np.float32), np.float32(0.2))),
        np.append(shades, np.float32(1.0)),
        np.append((texture == scene.atlas.index["lamp"]) * np.float32(2 * rows), np.float32(0.0)),
    )


def _of_fronts(values: NDArray[np.floating]) -> Floats:
    """Return a column by surface code from one value per hit, 0 for what is not a front."""
    column = np.zeros(3 * values.size + 1, np.float32)
    column[FRONT:-1:3] = values
    return column


def _textured(scene: Scene, sight: Sight, faces: Faces, texture: NDArray[np.intp]) -> NDArray[np.uint8]:
    """Return the colours of the textures, shape (AZIMUTHS, rows, 3).

    Upright faces carry their texture from the edge of the face, level ones in the building's frame.
    """
    front = sight.spread(faces.front)
    size = scene.atlas.sizes.take(texture)
    u, v, dense = sight.x / size, sight.y / size, np.float32(1.0) / size
    cv2.copyTo(sight.spread(faces.across), front, u)
    cv2.copyTo((sight.height - sight.spread(faces.base)) * sight.spread(faces.rise), front, v)
    cv2.copyTo(sight.spread(faces.dense), front, dense)
    above = np.maximum(np.abs(sight.height - np.float32(camera.EYE)), np.float32(0.02))
    stretch = np.sqrt(sight.depth / above)
    cv2.copyTo(sight.spread(faces.stretch), front, stretch)
    covered = sight.depth * stretch
    covered *= dense
    covered *= _PIXEL_ANGLE * PIXELS
    return scene.atlas.look_up(texture, u, v, covered)


def _shades(sight: Sight) -> Floats:
    """Return the brightness of every hit's front, top and underside, shape (3 hits,)."""
    plan, hits = sight.plan, sight.hits
    shade = np.tile(_FACE_SHADE, (hits.column.size, 1))
    shade[:, FRONT] *= np.where(plan.round[hits.solid], 0.7 + 0.3 * hits.incidence, 1.0)
    lamp = plan.z0[hits.solid] > CEILING - 0.2
    shade[lamp] = 1.25
    return shade.ravel()


def _facing_light(scene: Scene, sight: Sight, pose: Pose) -> Floats:
    """Return how much more light the fronts get that look towards it, and less those that look away, (3 hits,)."""
    hits = sight.hits
    dx, dy = directions(pose[2])
    x = np.float32(pose[0]) + hits.near * dx[hits.column]
    y = np.float32(pose[1]) + hits.near * dy[hits.column]
    # Just before the face, since the wall's own cells are lit from both sides.
    before = np.float32(0.1)
    place = in_cells(scene.building, x + before * hits.normal_x, y + before * hits.normal_y)
    towards = scene.flow.reshape(-1, 2)[cell_number(scene.building, *place)]
    facing = towards[:, 0] * hits.normal_x + towards[:, 1] * hits.normal_y
    factor = np.ones((hits.column.size, 3), np.float32)
    factor[:, FRONT] = np.maximum(np.float32(1.0) + np.float32(scene.light.look.directed) * facing, np.float32(0.25))
    return factor.ravel()


def _let_the_sun_in(scene: Scene, sun: Sunshine, sight: Sight, painted: tuple[NDArray[np.uint8], Floats]) -> None:
    """Add the sun where the line towards it leaves through a pane of the room's southern windows."""
    hits = sight.hits
    sx, sy, sz = (np.float32(value) for value in SUN)
    facing = np.full((hits.column.size, 3), sz, np.float32)
    facing[:, FRONT] = np.maximum(hits.normal_x * sx + hits.normal_y * sy, 0.0)
    facing[:, UNDER] = 0.0
    falls = sight.spread(np.append(facing.ravel(), sz))
    facade = sun.facade.take(cell_number(scene.building, sight.column, sight.row))
    chosen = np.flatnonzero((facade >= 0) & (falls > 0.0))
    number = facade.take(chosen)
    way = (sight.y.take(chosen) - sun.at.take(number)) / -sy
    columns = sun.low.shape[1]
    along, _ = in_cells(scene.building, sight.x.take(chosen) + way * sx, way)
    window = number * columns + np.minimum(np.maximum(along, 0), columns - 1).astype(np.intp)
    z = sight.height.take(chosen) + way * sz
    lit = np.flatnonzero((z > sun.low.take(window)) & (z < sun.high.take(window)))
    sunny = chosen.take(lit)
    strength = falls.take(sunny) * np.float32(scene.light.sun / np.sqrt(sx**2 + sy**2 + sz**2))
    colour, picture = (values.reshape(-1, 3) for values in painted)
    picture[sunny] += colour.take(sunny, axis=0) * (strength[:, None] * _SUN_COLOUR)
