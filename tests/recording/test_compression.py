"""Pictures are turned so that match and panorama can be compared, and small enough to keep."""

import cv2
import numpy as np
import pytest

from omnieval.recording.compression import (
    OMNIDIRECTIONAL_SIZE,
    PANORAMA_COLUMNS,
    encode_omnidirectional,
    encode_panorama,
    turn,
)
from tests.recording.replays import picture


def cells_of(panorama, cells):
    """An orientation descriptor in miniature: the mean of every vertical cell."""
    return panorama.astype(float).mean(axis=(0, 2)).reshape(cells, -1).mean(axis=1)


@pytest.mark.parametrize("shift", [0, 1, 37, 255, -4])
def test_a_match_turned_by_its_shift_is_aligned_with_the_new_image(shift):
    match = picture((16, 512, 3), seed=1)
    panorama = np.roll(match, 2 * shift, axis=1)
    np.testing.assert_allclose(cells_of(panorama, 256), np.roll(cells_of(match, 256), shift))
    np.testing.assert_array_equal(turn(match, shift, cells=256), panorama)


def test_a_shift_is_measured_in_cells_whatever_the_width_of_the_picture():
    match = picture((8, 128, 3), seed=2)
    np.testing.assert_array_equal(turn(match, 64, cells=256), np.roll(match, 32, axis=1))


def decode(jpeg):
    return cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR)


def test_a_panorama_is_kept_in_size_unless_it_is_wider_than_the_descriptors_see():
    assert decode(encode_panorama(picture((64, 256, 3), 0))).shape == (64, 256, 3)
    assert decode(encode_panorama(picture((256, 1024, 3), 0))).shape == (128, PANORAMA_COLUMNS, 3)


def test_an_omnidirectional_image_is_scaled_to_its_longer_side():
    assert decode(encode_omnidirectional(picture((480, 640, 3), 0))).shape == (192, OMNIDIRECTIONAL_SIZE, 3)


def test_a_compressed_picture_still_shows_the_same():
    image = picture((128, 512, 3), seed=3)
    difference = np.abs(decode(encode_panorama(image)).astype(int) - image.astype(int))
    assert difference.mean() < 8
