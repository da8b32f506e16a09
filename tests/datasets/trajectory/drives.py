"""A drive along three quarters of a circle, and the files of poses that different tools would leave of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

START_NS = 1_403_636_579_500_000_000
STEP_NS = 200_000_000


@dataclass(frozen=True)
class Drive:
    """Where a robot was, and when: times (n,), places (n, 2), metres, and yaws (n,), radians, in (-pi, pi]."""

    times_ns: NDArray[np.int64]
    places: NDArray[np.float64]
    yaws: NDArray[np.float64]

    @property
    def quaternions(self) -> NDArray[np.float64]:
        """x, y, z, w: turns about z."""
        zero = np.zeros(len(self.yaws))
        return np.stack([zero, zero, np.sin(self.yaws / 2), np.cos(self.yaws / 2)], axis=1)

    @property
    def seconds(self) -> list[str]:
        return [f"{time // 10**9}.{time % 10**9:09d}" for time in self.times_ns.tolist()]

    @property
    def names(self) -> list[str]:
        """Names of images that are the times, as in EuRoC."""
        return [f"{time}.png" for time in self.times_ns.tolist()]


def a_drive(count: int = 12) -> Drive:
    angles = np.linspace(0, 1.5 * np.pi, count)
    places = 10 * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    yaws = np.angle(np.exp(1j * (angles + np.pi / 2)))
    return Drive(START_NS + STEP_NS * np.arange(count), places, yaws)


def lines(*columns, separator: str = " ", heading: str = "") -> str:
    """A table of columns of text or numbers, which are written exactly."""
    texts = [[value if isinstance(value, str) else repr(value) for value in _list(column)] for column in columns]
    rows = [separator.join(row) for row in zip(*texts, strict=True)]
    return "\n".join([*([heading] if heading else []), *rows, ""])


def tum(drive: Drive) -> str:
    """Poses of a robot: x ahead, z up."""
    height = [0.3] * len(drive.yaws)
    return lines(drive.seconds, *drive.places.T, height, *drive.quaternions.T)


def euroc(drive: Drive, *, heading: bool = True) -> str:
    titles = (
        "#timestamp, p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], q_RS_y [], q_RS_z [], "
        "v_RS_R_x [m s^-1], v_RS_R_y [m s^-1], v_RS_R_z [m s^-1], b_w_RS_S_x [rad s^-1], b_w_RS_S_y [rad s^-1], "
        "b_w_RS_S_z [rad s^-1], b_a_RS_S_x [m s^-2], b_a_RS_S_y [m s^-2], b_a_RS_S_z [m s^-2]"
    )
    x, y, z, w = drive.quaternions.T
    rest = [[0.5] * len(drive.yaws)] * 9
    columns = (drive.times_ns, *drive.places.T, [0.3] * len(drive.yaws), w, x, y, z, *rest)
    return lines(*columns, separator=",", heading=titles if heading else "")


def camera_poses(drive: Drive) -> NDArray[np.float64]:
    """[R | t] of a camera with x right, y down and z ahead, in a world that is the same, shape (n, 3, 4)."""
    cos, sin, none, one = np.cos(drive.yaws), np.sin(drive.yaws), np.zeros(len(drive.yaws)), np.ones(len(drive.yaws))
    x, y = drive.places.T
    # Ahead is (cos, sin) on the ground, whose x is z of the world, and whose y is -x of it.
    rows = [[cos, none, -sin, -y], [none, one, none, 0.1 * one], [sin, none, cos, x]]
    return np.moveaxis(np.array(rows), 2, 0)


def kitti(drive: Drive) -> str:
    return lines(*camera_poses(drive).reshape(-1, 12).T)


def _list(column):
    return column.tolist() if isinstance(column, np.ndarray) else column
