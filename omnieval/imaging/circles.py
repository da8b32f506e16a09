"""Circles through the points of edges, and how much of a circle the points show."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from omnieval.imaging.edges import EdgePoints

_NEAR_PX = 1.5
"""A point this near to a circle lies on it."""
_ALIGNED = 0.94
"""Least cosine between the direction across an edge and the radius: 20 degrees."""
_SURELY_ALIGNED = 0.985
"""The same for the three points that a circle is laid through: 10 degrees."""
_ARC_PX = 2.5
"""A circle is asked for a point on each such piece of its length."""
_TRIPLES = 100_000
_SCATTERED_PX = 0.65
"""Edges about a circle that is none lie anywhere within `_NEAR_PX`, 0.87 px from it on root mean square."""
_LEAST_AREA = 1.0
"""Twice the area of a parallelogram of points that are not on one line, square pixels."""
_MOST_SCORED = 500
_RATED_BY = 2500
_MOST_REFINED = 40
_BOUND_PX = 2.0


@dataclass(frozen=True, slots=True)
class Circle:
    """A circle in an image, pixels (x right, y down)."""

    cx: float
    cy: float
    radius: float


@dataclass(frozen=True, slots=True)
class Support:
    """How much of a circle the edges show.

    Attributes
    ----------
    circle
        The circle.
    visible
        Share of the circle that lies within the image.
    seen
        Share of the visible part with an edge along it.
    residual
        Root mean square distance of these edges from the circle, pixels.
    """

    circle: Circle
    visible: float
    seen: float
    residual: float

    @property
    def share(self) -> float:
        """Share of the whole circle with an edge along it."""
        return self.visible * self.seen


def support(circle: Circle, edges: EdgePoints, size: tuple[int, int], *, near: float = _NEAR_PX) -> Support:
    """Return how much of a circle the edges show, in an image of this (width, height)."""
    on, distance = _on(circle, edges, near)
    pieces = int(np.clip(2 * np.pi * circle.radius / _ARC_PX, 24, 720))
    azimuth = 2 * np.pi * (np.arange(pieces) + 0.5) / pieces
    x, y = circle.cx + circle.radius * np.cos(azimuth), circle.cy + circle.radius * np.sin(azimuth)
    inside = (x > _BOUND_PX) & (x < size[0] - 1 - _BOUND_PX) & (y > _BOUND_PX) & (y < size[1] - 1 - _BOUND_PX)
    beside = edges.places[on] - (circle.cx, circle.cy)
    piece = np.floor(np.mod(np.arctan2(beside[:, 1], beside[:, 0]) / (2 * np.pi), 1.0) * pieces).astype(np.intp)
    shown = np.zeros(pieces, np.bool_)
    shown[np.minimum(piece, pieces - 1)] = True
    residual = float(np.sqrt(np.mean(np.square(distance[on])))) if on.any() else 0.0
    return Support(
        circle,
        float(inside.mean()),
        float((shown & inside).sum() / max(int(inside.sum()), 1)),
        residual,
    )


def refined(circle: Circle, edges: EdgePoints, *, near: float = 4.0) -> Circle:
    """Return the least-squares circle of the edges near a circle, over ever nearer ones."""
    for reach in (near, 2.5, _NEAR_PX):
        on, _ = _on(circle, edges, reach)
        if on.sum() < 8:
            return circle
        circle = through(edges.places[on])
    return circle


def find_circles(
    edges: EdgePoints,
    size: tuple[int, int],
    radii: tuple[float, float],
    generator: np.random.Generator,
    *,
    about: Circle | None = None,
    least: float = 0.15,
) -> list[Support]:
    """Return the circles that the edges show, those that are shown best first; none twice.

    Parameters
    ----------
    edges
        Points on edges.
    size
        (width, height) of the image.
    radii
        Smallest and largest radius, pixels.
    generator
        Chooses the triples of points that circles are laid through.
    about
        Circle about whose centre they must lie, within its radius; None for anywhere within the image.
    least
        Share of a whole circle that must be shown.
    """
    if len(edges) < 24:
        return []
    some = edges if len(edges) <= _RATED_BY else edges.taken(generator.choice(len(edges), _RATED_BY, replace=False))
    candidates = _candidates(edges, size, radii, generator, about)
    rated = sorted(candidates, key=lambda one: _on(one, some, _NEAR_PX)[0].sum() / one.radius, reverse=True)
    found: list[Support] = []
    tried: list[Circle] = []
    for one in rated:
        if any(_same(one, other) for other in tried):
            continue
        better = support(refined(one, edges), edges, size)
        tried += [one, better.circle]
        sound = radii[0] < better.circle.radius < radii[1] and better.share >= least and better.residual < _SCATTERED_PX
        if sound and not any(_same(better.circle, other.circle) for other in found):
            found.append(better)
        if len(tried) > _MOST_REFINED:
            break
    return sorted(found, key=lambda one: one.share, reverse=True)


def through(points: NDArray[np.float64]) -> Circle:
    """Return the least-squares circle: x^2 + y^2 = 2 a x + 2 b y + c is linear in centre (a, b) and c."""
    matrix = np.column_stack([2.0 * points, np.ones(len(points))])
    a, b, c = np.linalg.lstsq(matrix, np.square(points).sum(axis=1), rcond=None)[0]
    return Circle(float(a), float(b), float(np.sqrt(max(c + a * a + b * b, 0.0))))


def through_triples(
    first: NDArray[np.float64], second: NDArray[np.float64], third: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return centres, shape (2, n), and radii, shape (n,), of circles through three points each, shape (2, n).

    Both are NaN where the three lie on a line, or nearly so.
    """
    # The centre is as far from the first point as from the second and the third: two linear equations.
    (x1, y1), (x2, y2) = second - first, third - first
    twice_area = 2.0 * (x1 * y2 - y1 * x2)
    twice_area[np.abs(twice_area) <= _LEAST_AREA] = np.nan
    length1, length2 = x1 * x1 + y1 * y1, x2 * x2 + y2 * y2
    x, y = (y2 * length1 - y1 * length2) / twice_area, (x1 * length2 - x2 * length1) / twice_area
    return first + np.stack([x, y]), np.hypot(x, y)


def _on(circle: Circle, edges: EdgePoints, near: float) -> tuple[NDArray[np.bool_], NDArray[np.float64]]:
    """Return which edge points lie along a circle, and how far beyond it all are."""
    x, y = edges.places.T
    u, v = edges.normals.T
    dx, dy = x - circle.cx, y - circle.cy
    reach = np.sqrt(dx * dx + dy * dy)
    aligned = np.abs(dx * u + dy * v) > _ALIGNED * reach
    distance = reach - circle.radius
    return aligned & (np.abs(distance) < near), distance


def _same(one: Circle, other: Circle) -> bool:
    return abs(one.radius - other.radius) < 4 and np.hypot(one.cx - other.cx, one.cy - other.cy) < 4


def _candidates(
    edges: EdgePoints,
    size: tuple[int, int],
    radii: tuple[float, float],
    generator: np.random.Generator,
    about: Circle | None,
) -> list[Circle]:
    """Return circles through three points each that cross all three at right angles, those that agree with most."""
    width, height = size
    chosen = generator.integers(0, len(edges), (_TRIPLES, 3))
    center, radius = through_triples(*(edges.places.T[:, chosen[:, place]] for place in range(3)))
    fit = (radius > radii[0]) & (radius < radii[1])
    if about is None:
        fit &= (center[0] >= 0) & (center[0] < width) & (center[1] >= 0) & (center[1] < height)
    else:
        fit &= np.hypot(center[0] - about.cx, center[1] - about.cy) < about.radius
    chosen, center, radius = chosen[fit], center[:, fit], radius[fit]
    sure = np.ones(len(radius), np.bool_)
    for corner in chosen.T:
        away = edges.places.T[:, corner] - center
        sure &= np.abs((away * edges.normals.T[:, corner]).sum(axis=0)) > _SURELY_ALIGNED * radius
    kept = np.flatnonzero(sure)[:_MOST_SCORED]
    return [Circle(float(center[0, at]), float(center[1, at]), float(radius[at])) for at in kept]
