"""Where the mirror lies in the images, estimated from the images themselves.

While the robot moves, what the mirror shows changes; the surroundings of the mirror and the camera's own reflection do
not. So the grey levels' standard deviation over a few frames is high exactly between two circles, once the camera's
exposure and noise are accounted for: an exposure that follows the scene changes what is static, too.
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
_ACTIVE_INSIDE = 0.08
"""The same about the blind spot, where all that changes may be the shade of a plain floor."""
_BLIND = (0.05, 0.7)
"""A blind spot is larger and smaller than these shares of the rim."""
_WEAKEST = 2.0
"""Strong activity below this, in grey levels, is none."""
_STATIC = 0.08
"""Relative scatter up to which the pixels in the middle brighten and darken together, as a static object does."""


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
    activity, noise = _activity(images)
    strong = float(np.percentile(activity, 90))
    if strong < _WEAKEST:
        return _default(width, height, "nothing moves in the images")
    moving = _without_specks(activity > max(_ACTIVE * strong, noise))
    center = (width / 2, height / 2)
    rim = None
    for _ in range(2):  # the second time the rays start from the centre found
        rim = _fit_circle(_outer_edges(moving, center))
        if rim is None:
            return _default(width, height, "no circle fits the mirror's rim")
        center = (rim.cx, rim.cy)
    assert rim is not None
    if not 0.2 * height < rim.radius < width:
        return _default(width, height, "the circle found is not that of a mirror")
    note = f"estimated from {len(images)} images, residual {rim.residual:.1f} px"
    inner = _inner_radius(_without_specks(activity > max(_ACTIVE_INSIDE * strong, noise)), center, rim.radius)
    if not _BLIND[0] * rim.radius < inner < _BLIND[1] * rim.radius:
        inner = rim.radius * 0.15 / 0.47
        note += ", blind spot not seen, its radius by default"
    return MirrorEstimate(Mirror(rim.cx, rim.cy, inner, rim.radius), "estimated", rim.residual, note)


def _activity(images: Sequence[NDArray[np.uint8]]) -> tuple[NDArray[np.float32], float]:
    """Return how much each pixel changes beyond exposure and noise, and what may still be noise.

    Both are standard deviations in grey levels.
    """
    smooth: NDArray[np.float32] = np.empty((len(images), *images[0].shape), np.float32)
    for frame, image in zip(smooth, images, strict=True):
        cv2.GaussianBlur(image.astype(np.float32), (0, 0), 1.0, dst=frame)
    smooth /= _exposure(smooth)[:, np.newaxis, np.newaxis]
    variance = smooth.var(axis=0)
    # What does not move still has the sensor's noise, and there is always some of it: the blind spot at the least.
    # The variance of n normal values has the relative standard deviation sqrt(2 / (n - 1)); noise spans six of them.
    floor = float(np.percentile(variance, 2))
    spread = 6.0 * floor * np.sqrt(2.0 / (len(images) - 1))
    return np.sqrt(np.maximum(variance - floor, 0.0)).astype(np.float32), float(np.sqrt(spread))


def _without_specks(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    cleaned: NDArray[np.bool_] = cv2.medianBlur(mask.astype(np.uint8), 5) > 0
    return cleaned


def _exposure(images: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the relative exposure of each frame, shape (n,), from the camera's own reflection in the middle.

    All ones when the middle does not brighten and darken as one, so that it shows something else.
    """
    count, height, width = images.shape
    reach = max(height // 32, 1)
    rows, columns = slice(height // 2 - reach, height // 2 + reach), slice(width // 2 - reach, width // 2 + reach)
    middle = images[:, rows, columns].reshape(count, -1)
    level = middle.mean(axis=0)
    visible = level > 4.0
    if np.mean(visible) < 0.25:
        return np.ones(count, np.float32)
    relative = middle[:, visible] / level[visible]
    exposure: NDArray[np.float32] = np.maximum(np.median(relative, axis=1), 0.1)
    scatter = np.median(np.abs(relative / exposure[:, np.newaxis] - 1.0))
    return exposure if scatter < _STATIC else np.ones(count, np.float32)


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
    first = radius[samples[samples.any(axis=1)].argmax(axis=1)] - 0.5
    counts = np.bincount(np.rint(first).astype(np.int64), minlength=int(rim) + 1)[: int(rim)]
    together = np.convolve(counts, np.ones(3), "same")
    edge = int((together >= 0.25 * together.max()).argmax()) + 1
    return float(np.average([edge - 1, edge, edge + 1], weights=counts[edge - 1 : edge + 2] + 1e-9))
