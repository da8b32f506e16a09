"""What stays the same from picture to picture of a day: solids, textures, light maps, outdoors."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from omnieval.datasets.synthetic.atlas import Atlas, build_atlas
from omnieval.datasets.synthetic.building import Building, lamps, walls
from omnieval.datasets.synthetic.cast import Floats, Plan, plan_of
from omnieval.datasets.synthetic.day import Day
from omnieval.datasets.synthetic.furniture import standing
from omnieval.datasets.synthetic.lighting import (
    CELL,
    Light,
    Sunshine,
    flow,
    grid_shape,
    light_maps,
    sunshine,
)
from omnieval.datasets.synthetic.outdoors import skyline
from omnieval.datasets.synthetic.solids import Solid

_SHINE = {"linoleum": 0.8, "parquet": 0.8, "checker": 0.9, "tiles-small": 0.6, "planks": 0.7, "tiles-large": 0.9}
"""How shiny floors are; carpets and concrete are not."""
_LAMP_OFF = 0.5
"""How brightly the glass of a lamp looks that is not on."""


@dataclass(frozen=True)
class Scene:
    """A building on a day, ready to be looked at.

    Attributes
    ----------
    building, light
        Where and when.
    atlas, solids
        Textures, and what carries them.
    floors
        Number of the floor's texture in every cell of the light maps, shape (rows, columns); -1 outside the rooms.
    lights
        Light on upright surfaces, floors and lamps, one map below the other, shape (3 rows, columns, 3), BGR.
    sky
        What is seen through windows.
    flow
        From where the light comes, shape (rows, columns, 2).
    sunshine
        Where the sun shines, if it does.
    shine
        How shiny every texture is as a floor, 0 to 1; the last stands for what lies outdoors.
    """

    building: Building
    light: Light
    atlas: Atlas
    solids: tuple[Solid, ...]
    floors: NDArray[np.intp]
    lights: NDArray[np.float32]
    sky: NDArray[np.float32]
    flow: NDArray[np.float32]
    sunshine: Sunshine | None
    shine: Floats

    @cached_property
    def plan(self) -> Plan:
        """The solids as columns."""
        return plan_of(self.solids, self.atlas.index)


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
    left, _, bottom, _ = day.building.footprint
    for room in day.building.rooms:
        if room.code in day.dark:
            rows, columns = (
                slice(round((low - edge) / CELL), round((high - edge) / CELL))
                for low, high, edge in ((room.y0, room.y1, bottom), (room.x0, room.x1, left))
            )
            emissive[0, rows, columns] = _LAMP_OFF
    return emissive


def _floor_map(building: Building, atlas: Atlas) -> NDArray[np.intp]:
    """Return the floor's texture number in every cell of the light maps' grid."""
    rows, columns = grid_shape(building)
    left, _, bottom, _ = building.footprint
    floors = np.full((rows, columns), -1, np.intp)
    y, x = bottom + (np.arange(rows) + 0.5) * CELL, left + (np.arange(columns) + 0.5) * CELL
    for room in building.rooms:
        in_y, in_x = (y > room.y0 - 0.08) & (y < room.y1 + 0.08), (x > room.x0 - 0.08) & (x < room.x1 + 0.08)
        floors[np.ix_(in_y, in_x)] = atlas.index[room.floor]
    return floors


def _shine(atlas: Atlas) -> Floats:
    """Return how shiny every texture is as a floor; one more stands for what lies outdoors."""
    shine = np.zeros(len(atlas.index) + 1, np.float32)
    for name, value in _SHINE.items():
        shine[atlas.index[name]] = value
    return shine
