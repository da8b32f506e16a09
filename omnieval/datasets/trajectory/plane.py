"""From poses in space to poses on the ground: which way is up, and which way the robot looks."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

_TURNED = 0.1
"""Mean turn away from the first pose, radians, from which turns tell which way is up."""
_ABOUT_ONE_AXIS = 0.85
"""Share of the turns that must be about one axis."""
_UPRIGHT = 0.8
"""How near to up, as a cosine, an axis of the body must be."""
_FLAT = 3.0
"""How much more places must vary along z than along y, so that z is not a height."""
_AXES = "xyz"


@dataclass(frozen=True)
class OnTheGround:
    """Poses on the ground, and how they were found.

    Attributes
    ----------
    places
        x and y, shape (n, 2), metres: seen from above, y is to the left of x.
    yaws
        Counter-clockwise from x, shape (n,), radians; NaN where no rotation is known.
    words
        What was taken for the ground and for ahead.
    doubt
        What is odd about the rotations; None if nothing is.
    """

    places: NDArray[np.float64]
    yaws: NDArray[np.float64]
    words: str
    doubt: str | None = None


def matrices(quaternions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the rotation matrices, shape (n, 3, 3), of unit quaternions (x, y, z, w), shape (n, 4)."""
    x, y, z, w = quaternions.T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    found: NDArray[np.float64] = np.moveaxis(np.array(rows), 2, 0)
    return found


def on_the_ground(places: NDArray[np.float64], turns: NDArray[np.float64], *, of_a_camera: bool) -> OnTheGround:
    """Return poses in space as poses on the ground.

    Up is the axis of the world about which the robot turns. Where it hardly turns, it is y for poses of cameras (as in
    KITTI: x right, y down, z ahead) and where z varies more than y; else z. With up y, x of the ground is z, and its y
    is -x (y down) or x (y up). Ahead is x of the body (robots: x ahead, z up) if z of the body is up, and z of the body
    (cameras: z ahead) if another axis is.

    Parameters
    ----------
    places
        Shape (n, 3), metres.
    turns
        Rotations from body to world, shape (n, 3, 3); NaN where unknown.
    of_a_camera
        Whether the format is one of poses of cameras.

    Raises
    ------
    ValueError
        If the robot turns about x of the world, which is up in no convention.
    """
    known = np.isfinite(turns).all(axis=(1, 2))
    axis = _axis_of_turns(turns[known])
    if axis == 0:
        raise ValueError(
            "the rotations are about x, which points up in no usual frame; is w first in the quaternion, or is the "
            "order another one? Name its columns qx, qy, qz, qw in a heading"
        )
    up = axis if axis is not None else _usual_up(places, of_a_camera=of_a_camera)
    body = _upright_axis(turns[known], up)
    ahead = 0 if body == 2 or (body is None and up == 2) else 2
    down = up == 1 and not _y_is_up(turns[known], body)
    first, second, sign = (0, 1, 1.0) if up == 2 else (2, 0, -1.0 if down else 1.0)
    flat = np.stack([places[:, first], sign * places[:, second]], axis=1)
    looks = turns[:, :, ahead]
    yaws = np.where(known, np.arctan2(sign * looks[:, second], looks[:, first]), math.nan)
    words = "ground x, y" if up == 2 else f"ground z, {'-x' if down else 'x'} (y is {'down' if down else 'up'})"
    if known.any():
        words += f"; ahead is {_AXES[ahead]} of the {'robot' if ahead == 0 else 'camera'}"
    doubt = None
    if known.any() and axis is None and _mean_turn(turns[known]) > _TURNED:
        doubt = f"the rotations are about no one axis, so that {_AXES[up]} is only taken for up"
    return OnTheGround(flat, yaws, words, doubt)


def _axis_of_turns(turns: NDArray[np.float64]) -> int | None:
    """Return the axis of the world about which the body turns; None if it hardly turns, or about several."""
    if len(turns) < 2 or _mean_turn(turns) <= _TURNED:
        return None
    away = _turns_from_first(turns)
    shares = np.abs(away).mean(axis=0) / np.linalg.norm(away, axis=1).mean()
    axis = int(shares.argmax())
    return axis if shares[axis] >= _ABOUT_ONE_AXIS else None


def _mean_turn(turns: NDArray[np.float64]) -> float:
    return float(np.linalg.norm(_turns_from_first(turns), axis=1).mean()) if len(turns) else 0.0


def _turns_from_first(turns: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the turns of the first pose into the others, in the world, as rotation vectors, shape (n, 3)."""
    from scipy.spatial.transform import Rotation

    found: NDArray[np.float64] = Rotation.from_matrix(turns @ turns[0].T).as_rotvec()
    return found


def _usual_up(places: NDArray[np.float64], *, of_a_camera: bool) -> int:
    if of_a_camera:
        return 1
    whole = places[np.isfinite(places).all(axis=1)]
    if len(whole) < 2:
        return 2
    _, y, z = whole.std(axis=0)
    return 1 if z > _FLAT * y and z > 0.5 else 2


def _upright_axis(turns: NDArray[np.float64], up: int) -> int | None:
    """Return the axis of the body that is along `up` of the world; None if none is."""
    if not len(turns):
        return None
    along = np.abs(turns[:, up, :]).mean(axis=0)
    axis = int(along.argmax())
    return axis if along[axis] >= _UPRIGHT else None


def _y_is_up(turns: NDArray[np.float64], body: int | None) -> bool:
    """Tell whether y of the world is up: z of an upright robot is along it, or nothing says that it is down."""
    return body == 2 and float(turns[:, 1, 2].mean()) > 0
