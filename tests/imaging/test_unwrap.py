"""Unwrapping: where each direction of the image ends up in the panorama."""

import numpy as np
import pytest

from omnieval.datasets.sequence import Mirror
from omnieval.imaging.unwrap import Resizer, Unwrapper

MIRROR = Mirror(cx=101.0, cy=79.0, r_in=15.0, r_out=70.0)


def polar_image(value_of):
    """An image whose grey level is a function of (radius, direction to the left of straight ahead)."""
    v, u = np.mgrid[0:160, 0:200].astype(np.float64)
    radius = np.hypot(u - MIRROR.cx, v - MIRROR.cy)
    azimuth = np.arctan2(MIRROR.cx - u, MIRROR.cy - v)
    return np.clip(value_of(radius, azimuth), 0, 255).astype(np.uint8)


@pytest.mark.parametrize(("azimuth_deg", "column"), [(0, 128), (90, 64), (-90, 192), (45, 96), (170, 7), (-170, 249)])
def test_straight_ahead_is_the_middle_and_left_is_left(azimuth_deg, column):
    spot = np.deg2rad(azimuth_deg)
    image = polar_image(lambda _, azimuth: 255 * (np.abs(np.angle(np.exp(1j * (azimuth - spot)))) < 0.05))
    panorama = Unwrapper(MIRROR, 64, 256).panorama(image)
    brightest = np.average(np.arange(256), weights=panorama[8:56].sum(axis=0).astype(float) + 1e-9)
    assert brightest + 0.5 == pytest.approx(column, abs=1.5)


def test_the_top_row_is_the_rim():
    image = polar_image(lambda radius, _: 3 * radius)
    panorama = Unwrapper(MIRROR, 55, 128).panorama(image)
    radius = 70.0 - (np.arange(55) + 0.5)
    np.testing.assert_allclose(panorama.mean(axis=1), 3 * radius, atol=1.5)


def test_a_turn_of_the_camera_rolls_the_panorama():
    def pattern(turn):
        return polar_image(lambda radius, azimuth: 120 + 60 * np.sin(3 * (azimuth + turn)) + radius)

    step = 2 * np.pi / 128
    unwrap = Unwrapper(MIRROR, 32, 128).panorama
    turned, straight = unwrap(pattern(8 * step)).astype(int), unwrap(pattern(0.0)).astype(int)
    assert np.abs(turned - np.roll(straight, 8, axis=1)).mean() < 1.0
    assert np.abs(turned - straight).mean() > 10


def test_a_rim_cut_off_by_the_image_makes_no_edge():
    image = np.full((160, 200), 90, np.uint8)
    beyond = Unwrapper(Mirror(cx=101.0, cy=79.0, r_in=15.0, r_out=95.0), 40, 128)
    assert np.array_equal(beyond.panorama(image), np.full((40, 128), 90))


def test_colour_is_unwrapped_like_grey():
    image = np.random.default_rng(0).integers(0, 256, (160, 200), np.uint8)
    unwrapper = Unwrapper(MIRROR, 32, 128)
    colour = unwrapper.panorama(np.repeat(image[..., None], 3, axis=2))
    assert np.array_equal(colour[..., 1], unwrapper.panorama(image))


def test_panoramas_are_averaged_down():
    image = np.kron([[10, 20], [30, 60]], np.ones((40, 80))).astype(np.uint8)
    assert Resizer(2, 2).panorama(image).tolist() == [[10, 20], [30, 60]]
    assert Resizer(1, 1).panorama(image).tolist() == [[30]]
