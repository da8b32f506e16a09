"""The mirror found in images of a robot, under what real optics do to it, and refused where there is none."""

from dataclasses import asdict
from typing import Any

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from omnieval.datasets.sequence import Mirror
from omnieval.imaging.calibrate import Trust, estimate_mirror, estimate_of
from tests.imaging.donuts import donuts, panoramas

CASES: dict[str, tuple[Mirror, dict[str, Any]]] = {
    "plain": (Mirror(163.0, 118.0, 22.0, 112.0), {}),
    "rim cut above and below, a strut, bright surroundings": (
        Mirror(170.0, 112.0, 24.0, 128.0),
        {"strut": True, "background": "bright"},
    ),
    "rim partly outside": (Mirror(40.0, 120.0, 25.0, 110.0), {}),
    "surroundings as grey as the scene": (Mirror(150.0, 125.0, 20.0, 90.0), {"background": "grey", "seed": 1}),
    "blind spot aside": (Mirror(163.0, 118.0, 22.0, 112.0), {"aside": (8, -5)}),
    "a small image": (Mirror(40.0, 30.0, 6.0, 26.0), {"size": (60, 80)}),
    "far from the middle of a wide image": (Mirror(300.0, 75.0, 15.0, 65.0), {"size": (200, 480)}),
    "padded to twice its height": (Mirror(240.0, 120.0, 24.0, 112.0), {"size": (240, 480)}),
    "low light": (Mirror(157.0, 121.0, 25.0, 100.0), {"light": 0.08, "noise": 3.0, "count": 16}),
    "a robot that stands": (Mirror(163.0, 118.0, 22.0, 112.0), {"still": True}),
    "one image": (Mirror(163.0, 118.0, 22.0, 112.0), {"count": 1}),
}


@pytest.mark.parametrize("case", CASES)
def test_the_mirror_is_found(case):
    mirror, conditions = CASES[case]
    estimate = estimate_mirror(donuts(mirror, **conditions))
    found = estimate.mirror
    assert found is not None, estimate.note
    assert np.hypot(found.cx - mirror.cx, found.cy - mirror.cy) < 1.0
    assert found.r_out == pytest.approx(mirror.r_out, abs=1.5)
    assert found.r_in == pytest.approx(mirror.r_in, abs=1.5)
    assert estimate.blind_spot_seen
    assert estimate.moved is not (case in ("a robot that stands", "one image"))


def test_a_rim_that_is_no_edge_is_where_movement_ends():
    """Exposure that follows the scene, and a plain wall along half of the rim: nothing but noise tells it there."""
    mirror = Mirror(165.0, 116.0, 20.0, 105.0)
    rng = np.random.default_rng(0)
    v, u = np.mgrid[0:240, 0:320]
    radius = np.hypot(u - mirror.cx, v - mirror.cy)
    plain = (np.arctan2(v - mirror.cy, u - mirror.cx) > 0) & (np.abs(radius - mirror.r_out) < 12)
    within = (radius < mirror.r_out) & (radius > mirror.r_in) & ~plain
    static = 120 + 60 * gaussian_filter(rng.normal(size=(240, 320)), 12)
    images = []
    for _ in range(12):
        scene = np.where(within, 128 + 900 * gaussian_filter(rng.normal(size=(240, 320)), 5), static)
        images.append(np.clip(rng.uniform(0.8, 1.2) * scene, 0, 255).astype(np.uint8))
    found = estimate_mirror(images).mirror
    assert found is not None
    assert np.hypot(found.cx - mirror.cx, found.cy - mirror.cy) < 2.0
    assert found.r_out == pytest.approx(mirror.r_out, abs=4.0)


def test_trust_is_in_numbers_and_in_words():
    estimate = estimate_mirror(donuts(Mirror(170.0, 112.0, 24.0, 128.0)))
    trust = estimate.trust
    assert trust is not None
    assert trust.visible == pytest.approx(0.75, abs=0.05)
    assert trust.seen > 0.9
    assert trust.residual < 0.5
    assert trust.agreement is not None
    assert trust.agreement < 1.0
    assert str(trust) in estimate.note
    words = "rim seen on 92 % of its visible part (75 % of the circle), residual 0.3 px"
    assert str(Trust(0.75, 0.92, 0.31, None)) == words
    assert str(Trust(0.75, 0.92, 0.31, 0.44)) == f"{words}, halves of the images agree to 0.4 px"
    assert estimate_of(asdict(estimate)) == estimate


def test_halves_of_the_images_that_show_different_rims_are_not_trusted():
    """A camera that was knocked: whatever one circle says of it is wrong for half of the images."""
    one = donuts(Mirror(120.0, 118.0, 22.0, 80.0), count=8)
    other = donuts(Mirror(200.0, 122.0, 22.0, 80.0), count=8)
    mixed = [image for pair in zip(one, other, strict=True) for image in pair]
    assert estimate_mirror(mixed).mirror is None


def test_without_a_blind_spot_its_radius_goes_with_the_rim_and_that_is_said():
    estimate = estimate_mirror(donuts(Mirror(163.0, 118.0, 0.0, 112.0)))
    assert estimate.mirror is not None
    assert not estimate.blind_spot_seen
    assert estimate.mirror.r_in == pytest.approx(estimate.mirror.r_out * 0.15 / 0.47, abs=0.01)
    assert "blind spot not seen" in estimate.note


def side_by_side():
    one, other = (donuts(Mirror(120.0, 120.0, 0.0, 118.0), size=(240, 240), seed=seed) for seed in (1, 2))
    return [np.hstack(pair) for pair in zip(one, other, strict=True)]


@pytest.mark.parametrize(
    ("images", "why"),
    [
        ([np.zeros((240, 320), np.uint8)] * 10, "nothing moves"),
        (list(np.random.default_rng(0).integers(0, 256, (8, 240, 320), np.uint8)), "no circle"),
        (panoramas(), "no circle"),
        (panoramas(count=1), "no circle"),
        ([panoramas()[0]] * 8, "no circle"),
        (side_by_side(), "two discs"),
    ],
)
def test_where_there_is_no_mirror_there_is_no_estimate(images, why):
    estimate = estimate_mirror(images)
    assert estimate.mirror is None
    assert why in estimate.note
