"""What is laid over the painted surfaces: the outdoors, shiny floors, panes, and softened edges."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from omnieval.datasets.synthetic import camera
from omnieval.datasets.synthetic.cast import Floats, Hits, Plan
from omnieval.datasets.synthetic.scene import Scene
from omnieval.datasets.synthetic.sight import Pose, Sight, bearings, directions, ranges

_LOWER, _UPPER = 0, 1
_BLUR = (15, 3)
"""Over how many rows and columns a shiny floor blurs what it mirrors; odd."""


def show_outdoors(scene: Scene, sight: Sight, pose: Pose, texture: NDArray[np.intp], picture: Floats) -> None:
    """Put the outdoors where a ray has left the building before it met anything, and in the void of its courts."""
    x0, x1, y0, y1 = scene.building.footprint
    x, y, yaw = pose
    dx, dy = directions(yaw)
    with np.errstate(divide="ignore"):
        leave_x = np.where(dx > 0, x1 - x, x - x0) / np.abs(dx)
        leave_y = np.where(dy > 0, y1 - y, y - y0) / np.abs(dy)
    outside = sight.depth > (np.minimum(leave_x, leave_y) + 0.02)[:, None]
    below = camera.below_horizon()
    outside[:, :below] |= texture[:, :below] < 0
    azimuths = scene.sky.shape[0]
    azimuth = np.mod(np.rint(bearings(yaw) / (2 * np.pi) * azimuths).astype(np.intp), azimuths)
    pixel = np.flatnonzero(outside)
    column, row = np.divmod(pixel, camera.slopes().size)
    picture.reshape(-1, 3)[pixel] = scene.sky[azimuth[column], row]


def polish_floor(scene: Scene, sight: Sight, texture: NDArray[np.intp], picture: Floats) -> None:
    """Let shiny floors mirror what is above them, the more the flatter they are seen."""
    slope, below = camera.slopes(), camera.below_horizon()
    sine = -slope[:below] / np.sqrt(1.0 + slope[:below] ** 2)
    share = np.float32(scene.light.look.gloss) * (np.float32(0.04) + np.float32(0.96) * (1.0 - sine) ** 4)
    mirrored = np.clip(np.searchsorted(slope, -slope[:below]), 0, slope.size - 1)
    # A floor is not a mirror: what it shows is blurred, above all up and down.
    first = max(int(mirrored.min()) - _BLUR[0] // 2, 0)
    above = cv2.blur(np.minimum(picture[:, first:], np.float32(900.0)), _BLUR).take(mirrored - first, axis=1)
    shiny = scene.shine.take(texture[:, :below]) * (sight.code[:, :below] < 0) * share
    above *= cv2.merge([shiny, shiny, shiny])
    picture[:, :below] += above


def veil_glass(scene: Scene, sight: Sight, picture: Floats) -> None:
    """Let panes take away a share of what is behind them and add a faint reflection."""
    plan, hits, slope = sight.plan, sight.hits, camera.slopes()
    eye = np.float32(camera.EYE)
    pixels = picture.reshape(-1, 3)
    light = scene.light
    reflection = 190.0 * (np.array(light.ambient, np.float32) + 0.3 * np.array(light.lamp, np.float32))
    glass = np.flatnonzero(plan.glass[hits.solid] > 0.0)
    for chosen in _layers(hits.column[glass], glass):
        near, solid, shift = hits.near[chosen], hits.solid[chosen], hits.column[chosen] * slope.size
        start = np.searchsorted(slope, (plan.z0[solid] - eye) / near) + shift
        end = np.searchsorted(slope, (plan.z1[solid] - eye) / near) + shift
        count, pixel = ranges(start, end)
        behind = np.flatnonzero(sight.depth.take(pixel) > np.repeat(near, count))
        # A grazing view of a pane reflects more than a square one.
        share = plan.glass[solid] * (1.0 + 1.5 * (1.0 - hits.incidence[chosen]) ** 2)
        share = np.repeat(share.astype(np.float32), count).take(behind)[:, None]
        pixel = pixel.take(behind)
        pixels[pixel] += share * (reflection - pixels.take(pixel, axis=0))


def _layers(column: NDArray[np.intp], hit: NDArray[np.intp]) -> list[NDArray[np.intp]]:
    """Split hits, ordered by column, into groups that have each column at most once."""
    if column.size == 0:
        return []
    first = np.flatnonzero(np.diff(column, prepend=-1))
    rank = np.arange(column.size) - np.repeat(first, np.diff(first, append=column.size))
    return [hit[rank == k] for k in range(int(rank.max()) + 1)]


def soften_edges(sight: Sight, picture: Floats) -> None:
    """Mix the two surfaces that meet within a pixel of a column by the share of it that each covers.

    Without this, what is nearly level (a sill, the lower edge of a poster) would have a stepped rim.
    """
    slope, code = camera.slopes(), sight.code
    below, above, row = sight.edges, sight.edges + 1, sight.edges % slope.size
    code_below, code_above = code.take(below), code.take(above)
    # The rim belongs to the nearer of the two; floor and ceiling have none of their own.
    nearer = sight.depth.take(below) <= sight.depth.take(above)
    of_below = (code_above < 0) | ((code_below >= 0) & nearer)
    upper, lower = (_edge_slopes(sight.plan, sight.hits, side) for side in (_UPPER, _LOWER))
    rim = np.where(of_below, upper[code_below], lower[code_above])
    edge = np.clip((rim - slope[row]) / (slope[row + 1] - slope[row]), 0.0, 1.0)
    pixels = picture.reshape(-1, 3)
    step = pixels.take(above, axis=0) - pixels.take(below, axis=0)
    # Sample k stands for the pixel from k - 0.5 to k + 0.5; the edge lies in the lower or in the upper one.
    low, high = np.flatnonzero(edge < 0.5), np.flatnonzero(edge > 0.5)
    pixels[below[low]] += (np.float32(0.5) - edge[low])[:, None] * step[low]
    pixels[above[high]] -= (edge[high] - np.float32(0.5))[:, None] * step[high]


def _edge_slopes(plan: Plan, hits: Hits, side: int) -> Floats:
    """Return the slope at which each hit's front, top and underside end, at their `side`; shape (3 hits,)."""
    low, high = plan.z0[hits.solid] - np.float32(camera.EYE), plan.z1[hits.solid] - np.float32(camera.EYE)
    front = (low, high)[side] / hits.near
    top = high / (hits.near, hits.far)[side]
    under = low / (hits.far, hits.near)[side]
    return np.stack([front, top, under], axis=1).ravel()
