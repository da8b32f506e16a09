"""What changes in the images of a moving robot: what the mirror shows, and little else.

The surroundings of the mirror and the camera's own reflection do not change. So the grey levels' standard deviation
over a few frames is high exactly between two circles, once the camera's exposure and noise are accounted for: an
exposure that follows the scene changes what is static, too.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from omnieval.imaging.circles import Circle, through, through_triples

FEWEST_FRAMES = 4
"""Fewer do not tell what moves."""
_RAYS = 720
_TRIPLES = 300
"""Circles that are tried for the rim."""
_INLIER_PX = 2.0
_FEWEST_INLIERS = 0.25
"""Share of the rays that must agree on a rim for it to be believed."""
_ACTIVE = 0.15
"""A pixel is active from this share of the strong activity on."""
_ACTIVE_INSIDE = 0.08
"""The same about the blind spot, where all that changes may be the shade of a plain floor."""
_WEAKEST = 2.0
"""Strong activity below this, in grey levels, is none."""
_STATIC = 0.08
"""Relative scatter up to which the pixels in the middle brighten and darken together, as a static object does."""


@dataclass(frozen=True)
class Activity:
    """How much each pixel changes.

    Attributes
    ----------
    levels
        Standard deviation beyond exposure and noise, grey levels, shape (height, width).
    noise
        What may still be noise.
    strong
        What the most active tenth of the image exceeds.
    """

    levels: NDArray[np.float32]
    noise: float
    strong: float

    @property
    def moves(self) -> bool:
        """Whether anything moves at all."""
        return self.strong >= _WEAKEST

    def within(self, circle: Circle, inner: float, outer: float) -> float:
        """Return the mean activity between two multiples of a circle's radius, 0 where nothing of it is visible."""
        height, width = self.levels.shape
        azimuth = 2.0 * np.pi * np.arange(180) / 180
        radius = circle.radius * np.linspace(inner, outer, 8)
        u = np.rint(circle.cx + np.outer(radius, np.cos(azimuth))).astype(np.int64)
        v = np.rint(circle.cy + np.outer(radius, np.sin(azimuth))).astype(np.int64)
        inside = (u >= 0) & (u < width) & (v >= 0) & (v < height)
        return float(self.levels[v[inside], u[inside]].mean()) if inside.any() else 0.0


@dataclass(frozen=True, slots=True)
class ActiveRim:
    """The circle beyond which nothing moves, the share of rays that show it, and how far they lie from it, pixels."""

    circle: Circle
    seen: float
    residual: float


def activity(images: Sequence[NDArray[np.uint8]]) -> Activity:
    """Return how much each pixel of grey images, shape (height, width) each, changes."""
    smooth: NDArray[np.float32] = np.empty((len(images), *images[0].shape), np.float32)
    for frame, image in zip(smooth, images, strict=True):
        cv2.GaussianBlur(image.astype(np.float32), (0, 0), 1.0, dst=frame)
    exposure = _exposure(smooth)
    if (exposure != 1.0).any():
        smooth /= exposure[:, np.newaxis, np.newaxis]
    variance = _variance(smooth)
    # What does not move still has the sensor's noise, and there is always some of it: the blind spot at the least.
    # The variance of n normal values has the relative standard deviation sqrt(2 / (n - 1)); noise spans six of them.
    floor = float(np.percentile(variance, 2))
    spread = 6.0 * floor * np.sqrt(2.0 / max(len(images) - 1, 1))
    levels = np.sqrt(np.maximum(variance - floor, 0.0)).astype(np.float32)
    return Activity(levels, float(np.sqrt(spread)), float(np.percentile(levels, 90)))


def _variance(frames: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the variance over the first axis, frame by frame, which the memory of a processor holds."""
    mean: NDArray[np.float32] = frames.mean(axis=0)
    total = np.zeros_like(mean)
    for frame in frames:
        off = frame - mean
        off *= off
        total += off
    return total / np.float32(len(frames))


def active_rim(moving: Activity, generator: np.random.Generator) -> ActiveRim | None:
    """Return the circle beyond which nothing moves; None if there is no such circle."""
    active = _without_specks(moving.levels > max(_ACTIVE * moving.strong, moving.noise))
    if not active.any():
        return None
    center, rim = _middle(active), None
    for _ in range(2):  # the second time the rays start from the centre found
        rim = _fit_circle(_outer_edges(active, center), generator)
        if rim is None:
            return None
        center = (rim.circle.cx, rim.circle.cy)
    return rim


def active_from(moving: Activity, rim: Circle) -> float | None:
    """Return the radius at which rays first become active in numbers: the edge of the camera's own reflection.

    Many rays may become active further out only, where the floor is plain; hardly any does so further in.
    """
    active = _without_specks(moving.levels > max(_ACTIVE_INSIDE * moving.strong, moving.noise))
    samples, _, radius = _rays(active, (rim.cx, rim.cy))
    samples = samples[samples.any(axis=1)]
    if not len(samples):
        return None
    first = radius[samples.argmax(axis=1)] - 0.5
    length = int(rim.radius)
    counts = np.bincount(np.rint(first).astype(np.int64), minlength=length + 1)[:length]
    together = np.convolve(counts, np.ones(3), "same")
    edge = int((together >= 0.25 * together.max()).argmax()) + 1
    if not 1 < edge < length - 1:
        return None
    return float(np.average([edge - 1, edge, edge + 1], weights=counts[edge - 1 : edge + 2] + 1e-9))


def _without_specks(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    cleaned: NDArray[np.bool_] = cv2.medianBlur(mask.astype(np.uint8), 5) > 0
    return cleaned


def _middle(mask: NDArray[np.bool_]) -> tuple[float, float]:
    """Return the median place of a mask, (x, y): within the mirror even if that lies at the side of the image."""
    rows, columns = np.nonzero(mask)
    return float(np.median(columns)), float(np.median(rows))


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
    # The image border is not an edge of the mirror: rays that are active up to it tell nothing.
    last = np.maximum(inside.sum(axis=1) - 1, 0)
    touches = samples[np.arange(_RAYS), last] | samples[np.arange(_RAYS), np.maximum(last - 1, 0)]
    return samples[~touches], azimuth[~touches], radius


def _outer_edges(active: NDArray[np.bool_], center: tuple[float, float]) -> NDArray[np.float64]:
    """Return the outermost active point of each ray, shape (m, 2)."""
    samples, azimuth, radius = _rays(active, center)
    hit = samples.any(axis=1)
    outermost = samples.shape[1] - 1 - samples[hit][:, ::-1].argmax(axis=1)
    distance = radius[outermost] + 0.5 if hit.any() else np.empty(0)
    return np.column_stack([center[0] + distance * np.cos(azimuth[hit]), center[1] + distance * np.sin(azimuth[hit])])


def _fit_circle(points: NDArray[np.float64], generator: np.random.Generator) -> ActiveRim | None:
    """Fit a circle that most points agree on (random samples of three, then least squares on those that agree)."""
    if len(points) < _FEWEST_INLIERS * _RAYS:
        return None
    triples = np.array([generator.choice(len(points), 3, replace=False) for _ in range(_TRIPLES)])
    center, radius = through_triples(*(points[corner].T for corner in triples.T))
    reach = np.hypot(points[:, :1] - center[0], points[:, 1:] - center[1])
    beyond = np.where(np.isfinite(radius), reach - radius, np.inf)
    # A plain wall at the rim hides it, so points inside the circle say little; nothing moves outside of it.
    scores = (np.abs(beyond) < _INLIER_PX).sum(axis=0) - (beyond >= _INLIER_PX).sum(axis=0)
    best = np.abs(beyond[:, scores.argmax()]) < _INLIER_PX
    if scores.max() <= 0 or best.sum() < _FEWEST_INLIERS * _RAYS:
        return None
    circle = through(points[best])
    residual = np.hypot(points[best, 0] - circle.cx, points[best, 1] - circle.cy) - circle.radius
    return ActiveRim(circle, float(best.sum() / _RAYS), float(np.sqrt(np.mean(np.square(residual)))))
