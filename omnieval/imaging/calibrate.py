"""Where the mirror lies in the images, estimated from the images themselves.

While the robot moves, what the mirror shows changes; the surroundings of the mirror and the camera's own reflection do
not. So the grey levels' standard deviation over a few frames is high exactly between two circles.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from omnieval.datasets.sequence import Mirror
from omnieval.seeding import named_generator

_RAYS = 720
_FEWEST_FRAMES = 4
_INLIER_PX = 2.0
_FEWEST_INLIERS = 0.25
"""Share of the rays that must agree on a rim for it to be believed."""
_ACTIVE = 0.15
"""A pixel is active from this share of the strong activity on."""


@dataclass(frozen=True)
class MirrorEstimate:
    """A mirror and how far to trust it.

    Attributes
    ----------
    mirror
        The estimate, or the default when there is none to trust.
    source
        Which of the two.
    residual
        Root mean square distance of the rim's edge points from the circle, pixels; 0 for the default.
    note
        How it came about, in words.
    """

    mirror: Mirror
    source: Literal["estimated", "default"]
    residual: float
    note: str


def default_mirror(width: int, height: int) -> Mirror:
    """Return the mirror to assume when nothing is known: centred, rim 0.47 and blind spot 0.15 of the height."""
    return Mirror(width / 2, height / 2, 0.15 * height, 0.47 * height)


def estimate_mirror(images: Sequence[NDArray[np.uint8]]) -> MirrorEstimate:
    """Estimate the mirror from several frames of a moving robot.

    Parameters
    ----------
    images
        Grey images of equal shape (height, width); a few dozen are plenty.
    """
    height, width = images[0].shape
    if len(images) < _FEWEST_FRAMES:
        return _default(width, height, f"{len(images)} images are too few to see what moves")
    activity = cv2.GaussianBlur(np.std(np.stack(images).astype(np.float32), axis=0), (0, 0), 1.0)
    strong = float(np.percentile(activity, 90))
    if strong < 2.0:
        return _default(width, height, "nothing moves in the images")
    active = activity > _ACTIVE * strong
    center = (width / 2, height / 2)
    rim = None
    for _ in range(2):  # the second time the rays start from the centre found
        edges = _outer_edges(active, center)
        rim = _fit_circle(edges)
        if rim is None:
            return _default(width, height, "no circle fits the mirror's rim")
        center = (rim.cx, rim.cy)
    assert rim is not None
    inner = _inner_radius(active, center, rim.radius)
    if not 0.02 * rim.radius < inner < 0.7 * rim.radius or not 0.2 * height < rim.radius < width:
        return _default(width, height, "the circles found are not those of a mirror")
    mirror = Mirror(rim.cx, rim.cy, inner, rim.radius)
    return MirrorEstimate(
        mirror, "estimated", rim.residual, f"estimated from {len(images)} images, residual {rim.residual:.1f} px"
    )


@dataclass(frozen=True, slots=True)
class _Circle:
    cx: float
    cy: float
    radius: float
    residual: float


def _default(width: int, height: int, why: str) -> MirrorEstimate:
    return MirrorEstimate(default_mirror(width, height), "default", 0.0, f"default, because {why}")


def _rays(
    active: NDArray[np.bool_], center: tuple[float, float]
) -> tuple[NDArray[np.bool_], NDArray[np.float64], NDArray[np.float64]]:
    """Sample the mask along rays from a centre: samples (rays, radii), azimuths (rays,), radii of the samples."""
    height, width = active.shape
    reach = int(np.hypot(width, height))
    azimuth = 2.0 * np.pi * np.arange(_RAYS) / _RAYS
    radius = np.arange(reach, dtype=np.float64) + 0.5
    u = np.rint(center[0] + np.outer(np.cos(azimuth), radius)).astype(np.int64)
    v = np.rint(center[1] + np.outer(np.sin(azimuth), radius)).astype(np.int64)
    inside = (u >= 0) & (u < width) & (v >= 0) & (v < height)
    samples: NDArray[np.bool_] = active[np.clip(v, 0, height - 1), np.clip(u, 0, width - 1)] & inside
    # The image border is no edge of the mirror: rays that are active up to it tell nothing.
    last = inside.sum(axis=1) - 1
    touches = samples[np.arange(_RAYS), last] | samples[np.arange(_RAYS), np.maximum(last - 1, 0)]
    return samples[~touches], azimuth[~touches], radius


def _outer_edges(active: NDArray[np.bool_], center: tuple[float, float]) -> NDArray[np.float64]:
    """Return the outermost active point of each ray, shape (m, 2)."""
    samples, azimuth, radius = _rays(active, center)
    hit = samples.any(axis=1)
    outermost = samples.shape[1] - 1 - samples[hit][:, ::-1].argmax(axis=1)
    distance = radius[outermost] + 0.5 if hit.any() else np.empty(0)
    return np.column_stack([center[0] + distance * np.cos(azimuth[hit]), center[1] + distance * np.sin(azimuth[hit])])


def _fit_circle(points: NDArray[np.float64]) -> _Circle | None:
    """Fit a circle that most points agree on (random samples of three, then least squares on those that agree)."""
    if len(points) < _FEWEST_INLIERS * _RAYS:
        return None
    generator = named_generator(0, "mirror-rim")
    best, best_score = np.zeros(len(points), np.bool_), 0
    for _ in range(300):
        cx, cy, radius = _circle_through(points[generator.choice(len(points), 3, replace=False)])
        beyond = np.hypot(points[:, 0] - cx, points[:, 1] - cy) - radius
        agree = np.abs(beyond) < _INLIER_PX
        # A plain wall at the rim hides it, so points inside the circle say little; nothing moves outside of it.
        score = int(agree.sum()) - int((beyond >= _INLIER_PX).sum())
        if score > best_score:
            best, best_score = agree, score
    if best.sum() < _FEWEST_INLIERS * _RAYS:
        return None
    cx, cy, radius = _circle_through(points[best])
    residual = np.hypot(points[best, 0] - cx, points[best, 1] - cy) - radius
    return _Circle(cx, cy, radius, float(np.sqrt(np.mean(np.square(residual)))))


def _circle_through(points: NDArray[np.float64]) -> tuple[float, float, float]:
    """Least-squares circle: x^2 + y^2 = 2 a x + 2 b y + c is linear in centre (a, b) and c."""
    matrix = np.column_stack([2.0 * points, np.ones(len(points))])
    a, b, c = np.linalg.lstsq(matrix, np.square(points).sum(axis=1), rcond=None)[0]
    return float(a), float(b), float(np.sqrt(max(c + a * a + b * b, 0.0)))


def _inner_radius(active: NDArray[np.bool_], center: tuple[float, float], rim: float) -> float:
    """Return the radius at which rays first become active in numbers: the edge of the camera's own reflection.

    Many rays may become active further out only, where the floor is plain; hardly any does so further in.
    """
    samples, _, radius = _rays(active, center)
    first = radius[samples.argmax(axis=1)] - 0.5
    counts = np.bincount(np.rint(first).astype(np.int64), minlength=int(rim) + 1)[: int(rim)]
    together = np.convolve(counts, np.ones(3), "same")
    edge = int((together >= 0.25 * together.max()).argmax()) + 1
    return float(np.average([edge - 1, edge, edge + 1], weights=counts[edge - 1 : edge + 2] + 1e-9))
