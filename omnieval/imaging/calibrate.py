"""Estimates where the mirror lies in the images from the images themselves, and how far that can be trusted.

Two things tell. The rim, and the edge of the camera's own reflection, are edges that stay where they are while what the
mirror shows changes (`imaging.edges`): circles are laid through them (`imaging.circles`). And what changes lies within
the rim and outside of the blind spot (`imaging.activity`), which finds a rim that is not an edge, in the dark or before
a background as bright as the scene. Where neither shows a circle there is no estimate.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from omnieval.datasets.sequence import Mirror
from omnieval.imaging.activity import FEWEST_FRAMES, Activity, active_from, active_rim, activity
from omnieval.imaging.circles import Circle, Support, find_circles, refined, support
from omnieval.imaging.edges import LastingEdges
from omnieval.seeding import named_generator

_HEIGHT_PX = 480
"""Larger images are made smaller; a circle is known to a part of a pixel all the same."""
_LEAST_HEIGHT_PX = 240
"""Smaller ones are made larger, twice at most: the tolerances are in pixels."""
_EDGES_FROM = 16
"""Images whose edges are looked at; more do not sharpen the median."""
_RADII = (0.2, 0.8)
"""The rim's radius: at least this share of the image's smaller side, at most this of its diagonal."""
_SEEN = 0.5
"""Share of a rim's visible part that must be an edge. Circles by chance reach 0.45 in a cluttered scene that stands."""
_SURELY_SEEN = 0.75
"""From here on a rim is one even if as much moves outside of it as within: people, or the sky."""
_MOVES_OUTSIDE, _MOVES_LESS = 1.5, 0.7
"""What may move outside of a rim, as a multiple of what moves within."""
_SHOWN = 0.3
"""Share of the whole circle that must be seen."""
_BLIND = (0.04, 0.6)
"""A blind spot is larger and smaller than these shares of the rim."""
_BANDS = (_BLIND[0], 0.2), (0.15, _BLIND[1])
_BLIND_SEEN = 0.55
_CONTRASTS = 4.0, 2.0
"""Of the edges that a blind spot is looked for in: plain ones, then faint ones."""
_BLIND_ASIDE = 0.15
"""A blind spot's centre lies within this share of the rim's radius from the rim's."""
_BLIND_BY_DEFAULT = 0.15 / 0.47
_ASIDE_SAID = 0.02
"""A blind spot whose centre is off by this share of the rim's radius is mentioned."""
_QUIET = 0.25
"""What moves less than this share of what lies within is not a part of the mirror."""
_AGREE = 0.02
"""Halves of the frames must agree to this share of the radius, and to `_AGREE_PX`."""
_AGREE_PX = 2.0


@dataclass(frozen=True, slots=True)
class Trust:
    """How far to trust an estimate, in numbers.

    Attributes
    ----------
    visible
        Share of the rim that lies within the image.
    seen
        Share of that part on which the rim was seen.
    residual
        Root mean square distance of what was seen of the rim from the circle, pixels.
    agreement
        How far apart the rims found in one half and the other half of the frames lie, pixels; None if there are too
        few frames to tell.
    """

    visible: float
    seen: float
    residual: float
    agreement: float | None

    def __str__(self) -> str:
        words = f"rim seen on {100 * self.seen:.0f} % of its visible part ({100 * self.visible:.0f} % of the circle), "
        words += f"residual {self.residual:.1f} px"
        return words if self.agreement is None else f"{words}, halves of the images agree to {self.agreement:.1f} px"


@dataclass(frozen=True, slots=True)
class MirrorEstimate:
    """What the images tell of the mirror.

    Attributes
    ----------
    mirror
        Where it lies; None where no estimate can be trusted.
    images
        How many images it is estimated from.
    why_not
        Why there is none, in words; empty if there is one.
    moved
        Whether the images differ enough to tell the mirror from what it shows.
    blind_spot_seen
        Whether the blind spot was seen; else its radius goes with the rim's.
    aside
        How far the blind spot's centre lies from the rim's, pixels.
    by_edge
        Whether the rim is an edge of the images, and not only where movement ends.
    two_discs
        Whether there is none because each image shows two.
    candidate
        The circle that came nearest to being a rim, if any; the rim where there is an estimate.
    trust
        How far to trust the candidate.
    """

    mirror: Mirror | None
    images: int
    why_not: str = ""
    moved: bool = False
    blind_spot_seen: bool = False
    aside: float = 0.0
    by_edge: bool = False
    two_discs: bool = False
    candidate: Circle | None = None
    trust: Trust | None = None

    @property
    def note(self) -> str:
        """How it came about, or why there is none, in words."""
        if self.mirror is None:
            return self.why_not
        words = f"estimated from {self.images} images, {self.trust}"
        if not self.blind_spot_seen:
            return f"{words}, blind spot not seen, its radius by default"
        off = self.aside >= _ASIDE_SAID * self.mirror.r_out
        return f"{words}, blind spot {self.aside:.0f} px aside of the centre" if off else words


def estimate_mirror(images: Sequence[NDArray[np.uint8]]) -> MirrorEstimate:
    """Estimate the mirror from several frames of a robot, best of a moving one.

    Parameters
    ----------
    images
        Grey images of equal shape (height, width); a few dozen are plenty.
    """
    height = images[0].shape[0]
    scale = min(_HEIGHT_PX / height, 1.0) if height > _LEAST_HEIGHT_PX else min(_LEAST_HEIGHT_PX / height, 2.0)
    estimate = _Evidence([_scaled(image, scale) for image in images]).estimate()
    return _enlarged(estimate, 1.0 / scale)


def estimate_of(values: Mapping[str, Any]) -> MirrorEstimate:
    """Return the estimate that `dataclasses.asdict` made plain values of."""
    mirror, candidate, trust = values["mirror"], values["candidate"], values["trust"]
    made = {
        "mirror": mirror and Mirror(**mirror),
        "candidate": candidate and Circle(**candidate),
        "trust": trust and Trust(**trust),
    }
    return MirrorEstimate(**{**values, **made})


@dataclass(frozen=True, slots=True)
class _Rim:
    """A circle that may be the rim, how much of it the image has and shows, and how far edges lie from it, pixels."""

    circle: Circle
    visible: float
    seen: float
    residual: float
    by_edge: bool


class _Evidence:
    """Edges and activity of images of a size to work with."""

    def __init__(self, images: Sequence[NDArray[np.uint8]]) -> None:
        height, width = images[0].shape
        self._images = images
        self._size = width, height
        self._lasting = LastingEdges(images[:: -(-len(images) // _EDGES_FROM)])
        self._edges = self._lasting.points()
        self._activity: Activity | None = activity(images) if len(images) >= FEWEST_FRAMES else None

    @property
    def _moved(self) -> bool:
        return self._activity is not None and self._activity.moves

    def estimate(self) -> MirrorEstimate:
        width, height = self._size
        nothing = MirrorEstimate(None, len(self._images), moved=self._moved)
        radii = _RADII[0] * min(width, height), _RADII[1] * float(np.hypot(width, height))
        shown = find_circles(self._edges, self._size, radii, named_generator(0, "mirror-edges"))
        if disc := _second_disc(shown):
            return replace(nothing, why_not="each image shows two discs", candidate=disc, two_discs=True)
        rim = self._rim(shown)
        if rim is None:
            why = "no circle fits a mirror's rim"
            if not shown:
                return replace(nothing, why_not=why if self._moved else f"{why}, and nothing moves in the images")
            trust = Trust(shown[0].visible, shown[0].seen, shown[0].residual, None)
            why += f" (the best is seen on {100 * shown[0].share:.0f} % of its length)"
            return replace(nothing, why_not=why, candidate=shown[0].circle, trust=trust)
        agreement = self._agreement(rim)
        trust = Trust(rim.visible, rim.seen, rim.residual, agreement)
        if agreement is not None and agreement > max(_AGREE * rim.circle.radius, _AGREE_PX):
            why = "the rim found in one half of the images is not that of the other half"
            return replace(nothing, why_not=why, candidate=rim.circle, trust=trust)
        inner, aside = self._blind_spot(rim.circle)
        radius = rim.circle.radius * _BLIND_BY_DEFAULT if inner is None else inner
        return replace(
            nothing,
            mirror=Mirror(rim.circle.cx, rim.circle.cy, radius, rim.circle.radius),
            blind_spot_seen=inner is not None,
            aside=aside,
            by_edge=rim.by_edge,
            candidate=rim.circle,
            trust=trust,
        )

    def _rim(self, shown: list[Support]) -> _Rim | None:
        """Return the outermost circle that is an edge, else the one beyond which nothing moves."""
        found = [one for one in shown if one.seen >= _SEEN and one.share >= _SHOWN and self._is_rim(one)]
        found.sort(key=lambda one: one.circle.radius, reverse=True)
        while len(found) > 1 and self._is_housing(found[0].circle, found[1].circle):
            found = found[1:]
        ends = active_rim(self._activity, named_generator(0, "mirror-rim")) if self._activity and self._moved else None
        inside = not found or (ends is not None and found[0].circle.radius < 0.95 * ends.circle.radius)
        if ends is not None and self._is_mirror(ends.circle) and inside:
            visible = support(ends.circle, self._edges, self._size).visible
            return _Rim(ends.circle, visible, min(ends.seen / max(visible, 0.01), 1.0), ends.residual, False)
        if not found:
            return None
        return _Rim(found[0].circle, found[0].visible, found[0].seen, found[0].residual, True)

    def _is_mirror(self, circle: Circle) -> bool:
        width, height = self._size
        within = 0 <= circle.cx <= width and 0 <= circle.cy <= height
        return bool(within and _RADII[0] * height < circle.radius < width)

    def _is_rim(self, one: Support) -> bool:
        """Whether enough moves within a circle, compared with what moves outside of it; if nothing moves, any is."""
        if self._activity is None or not self._moved:
            return True
        outside, within = self._activity.within(one.circle, 1.03, 1.2), self._activity.within(one.circle, 0.7, 0.97)
        return outside < (_MOVES_OUTSIDE if one.seen >= _SURELY_SEEN else _MOVES_LESS) * within

    def _is_housing(self, outer: Circle, inner: Circle) -> bool:
        """Whether nothing moves between two circles, and much within the inner one."""
        if self._activity is None or not self._moved or inner.radius < 0.6 * outer.radius:
            return False
        between = self._activity.within(inner, 1.02, max(1.03, 0.98 * outer.radius / inner.radius))
        return between < _QUIET * self._activity.within(inner, 0.7, 0.97)

    def _agreement(self, rim: _Rim) -> float | None:
        """Return how far apart the rims lie that the halves of the images show, pixels."""
        if len(self._images) < 2 * FEWEST_FRAMES:
            return None
        halves: list[Circle] = []
        for first in (0, 1):
            if rim.by_edge:
                edges = self._lasting.points(first, 2)
                half = refined(rim.circle, edges)
                if support(half, edges, self._size).seen >= 0.5 * rim.seen:
                    halves.append(half)
            else:
                ends = active_rim(activity(self._images[first::2]), named_generator(0, "mirror-rim"))
                if ends is not None:
                    halves.append(ends.circle)
        if not halves and rim.by_edge:
            return None  # it takes all images to see it
        if len(halves) < 2:
            return rim.circle.radius  # there is nothing like it in one of the halves
        return _apart(*halves)

    def _blind_spot(self, rim: Circle) -> tuple[float | None, float]:
        """Return the radius of the camera's own reflection, None if it is not seen, and how far aside it lies."""
        for contrast in _CONTRASTS:
            if spot := self._ring(rim, contrast):
                return spot.radius, float(np.hypot(spot.cx - rim.cx, spot.cy - rim.cy))
        inner = active_from(self._activity, rim) if self._activity is not None and self._moved else None
        return (inner if inner is not None and _BLIND[0] * rim.radius < inner < 0.7 * rim.radius else None), 0.0

    def _ring(self, rim: Circle, contrast: float) -> Circle | None:
        """Return the outermost circle about the middle within which nothing moves."""
        edges = self._lasting.points(contrast=contrast)
        dx, dy = edges.places[:, 0] - rim.cx, edges.places[:, 1] - rim.cy
        reach = np.hypot(dx, dy)
        # An edge that runs along a ray, as those of posts do, is none of a circle about the middle.
        across = np.abs(dx * edges.normals[:, 0] + dy * edges.normals[:, 1]) > 0.7 * reach
        about = Circle(rim.cx, rim.cy, _BLIND_ASIDE * rim.radius)
        generator = named_generator(0, "blind-spot")
        shown: list[Support] = []
        for band in _BANDS:  # a small circle has few of all the points, and many of those nearby
            least, most = band[0] * rim.radius, band[1] * rim.radius
            near = edges.taken(across & (reach < most + about.radius))
            shown += find_circles(near, self._size, (least, most), generator, about=about, least=_BLIND_SEEN)
        shown.sort(key=lambda one: one.share, reverse=True)
        # Rings of the lens lie within the camera: the outermost one ends what is not the scene.
        rings = [one.circle for one in shown if one.seen >= 0.75 * shown[0].seen and self._is_still(one.circle)]
        return max(rings, key=lambda circle: circle.radius, default=None)

    def _is_still(self, spot: Circle) -> bool:
        """Whether more moves about a circle than within; if nothing moves there is no telling."""
        if self._activity is None or not self._moved:
            return True
        return self._activity.within(spot, 0.2, 0.9) < 0.5 * self._activity.within(spot, 1.1, 1.4)


def _second_disc(shown: list[Support]) -> Circle | None:
    """Return a second circle of much the same size beside the first, if both are seen."""
    seen = [one.circle for one in shown if one.seen >= _SEEN and one.share >= _SHOWN]
    for one, other in combinations(seen, 2):
        alike = abs(one.radius - other.radius) < 0.15 * one.radius
        if alike and np.hypot(one.cx - other.cx, one.cy - other.cy) > one.radius:
            return other
    return None


def _apart(one: Circle, other: Circle) -> float:
    """Return how far apart two circles are at most, about."""
    return float(np.hypot(one.cx - other.cx, one.cy - other.cy) + abs(one.radius - other.radius))


def _scaled(image: NDArray[np.uint8], scale: float) -> NDArray[np.uint8]:
    if scale == 1.0:
        return image
    how = cv2.INTER_AREA if scale < 1.0 else cv2.INTER_CUBIC
    return cv2.resize(image, None, fx=scale, fy=scale, interpolation=how).astype(np.uint8, copy=False)


def _enlarged(estimate: MirrorEstimate, factor: float) -> MirrorEstimate:
    """Return an estimate in the pixels of images so many times as large."""

    def place(value: float) -> float:
        return factor * (value + 0.5) - 0.5  # pixels are counted from the middle of the first

    mirror, circle, trust = estimate.mirror, estimate.candidate, estimate.trust
    agreement = None if trust is None or trust.agreement is None else factor * trust.agreement
    return replace(
        estimate,
        mirror=mirror and _rounded(place(mirror.cx), place(mirror.cy), factor * mirror.r_in, factor * mirror.r_out),
        aside=factor * estimate.aside,
        candidate=circle and Circle(place(circle.cx), place(circle.cy), factor * circle.radius),
        trust=trust and replace(trust, residual=factor * trust.residual, agreement=agreement),
    )


def _rounded(*values: float) -> Mirror:
    """Return a mirror to a hundredth of a pixel: finer digits are not known, and depend on the machine."""
    return Mirror(*(round(value, 2) for value in values))
