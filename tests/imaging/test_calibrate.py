"""The mirror found in images of a moving robot, under what real images do to it."""

from typing import Any

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from omnieval.datasets.sequence import Mirror
from omnieval.imaging.calibrate import default_mirror, estimate_mirror


def moving_images(
    mirror, *, count=12, size=(240, 320), surround=0.0, noise=0.0, plain_sector=False, light=1.0, gain=0.0, seed=0
):
    """Something different in every frame within the mirror; surroundings and the camera's reflection never change."""
    rng = np.random.default_rng(seed)
    v, u = np.mgrid[0 : size[0], 0 : size[1]]
    radius = np.hypot(u - mirror.cx, v - mirror.cy)
    seen = np.clip(np.minimum(mirror.r_out - radius, radius - mirror.r_in) + 0.5, 0, 1)
    if plain_sector:  # a white wall along the rim and a plain floor about the blind spot, in half of the directions
        plain = (np.arctan2(v - mirror.cy, u - mirror.cx) > 0) & (np.abs(radius - mirror.r_out) < 12)
        plain |= (np.arctan2(v - mirror.cy, u - mirror.cx) < -1) & (np.abs(radius - mirror.r_in) < 15)
    static = surround * gaussian_filter(rng.normal(size=size), 12) * 500 + 30
    images = []
    for _ in range(count):
        scene = 128 + 900 * gaussian_filter(rng.normal(size=size), 5)
        if plain_sector:
            scene = np.where(plain, 200, scene)
        image = light * (seen * scene + (1 - seen) * static)
        if gain:
            image *= rng.uniform(1 - gain, 1 + gain)
        if noise:
            image += noise * rng.normal(size=size)
        images.append(np.clip(image, 0, 255).astype(np.uint8))
    return images


CASES: dict[str, tuple[Mirror, dict[str, Any]]] = {
    "clean": (Mirror(163.0, 118.0, 22.0, 112.0), {}),
    "bright surroundings": (Mirror(163.0, 118.0, 22.0, 112.0), {"surround": 1.0}),
    "noise": (Mirror(157.5, 121.5, 25.0, 100.0), {"noise": 3.0, "surround": 0.5}),
    "rim cut by the image": (Mirror(160.0, 120.0, 25.0, 128.0), {}),
    "night": (Mirror(157.5, 121.5, 25.0, 100.0), {"light": 0.15, "noise": 3.0, "surround": 0.5, "count": 24}),
    "automatic exposure": (Mirror(163.0, 118.0, 22.0, 112.0), {"gain": 0.3, "surround": 0.5}),
    "plain walls and floor": (Mirror(165.0, 116.0, 20.0, 105.0), {"plain_sector": True}),
}


@pytest.mark.parametrize("case", CASES)
def test_the_mirror_is_found(case):
    mirror, conditions = CASES[case]
    estimate = estimate_mirror(moving_images(mirror, **conditions))
    assert estimate.source == "estimated"
    found = estimate.mirror
    assert np.hypot(found.cx - mirror.cx, found.cy - mirror.cy) < 2.0
    assert found.r_out == pytest.approx(mirror.r_out, abs=4.0)
    assert found.r_in == pytest.approx(mirror.r_in, abs=4.0)
    assert f"residual {estimate.residual:.1f} px" in estimate.note


def test_without_a_blind_spot_its_default_goes_with_the_rim_found():
    estimate = estimate_mirror(moving_images(Mirror(163.0, 118.0, 0.0, 112.0)))
    assert estimate.source == "estimated"
    assert estimate.mirror.r_in == pytest.approx(estimate.mirror.r_out * 0.15 / 0.47)
    assert "blind spot not seen" in estimate.note


@pytest.mark.parametrize(
    ("images", "why"),
    [
        ([np.zeros((240, 320), np.uint8)] * 10, "nothing moves"),
        ([np.zeros((240, 320), np.uint8)] * 2, "too few"),
        (list(np.random.default_rng(0).integers(0, 256, (8, 240, 320), np.uint8)), "no circle"),
    ],
)
def test_without_a_mirror_to_see_the_default_is_taken_and_said_so(images, why):
    estimate = estimate_mirror(images)
    assert (estimate.source, estimate.mirror) == ("default", default_mirror(320, 240))
    assert why in estimate.note


def test_the_default_is_centred():
    assert default_mirror(640, 480) == Mirror(320.0, 240.0, 0.15 * 480, 0.47 * 480)
