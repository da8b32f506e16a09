"""What encodings of ROS mean, on images small enough to be written down."""

import numpy as np
import pytest

from omnieval.datasets.streams.encodings import Raw, pixels
from omnieval.errors import DatasetError

BLUE, GREEN, RED = 50, 100, 200


def raw(encoding, data, shape, step=0, *, big_endian=False):
    return Raw(encoding, shape[1], shape[0], step, big_endian, bytes(data))


@pytest.mark.parametrize("encoding", ["mono8", "8UC1"])
def test_grey_levels_stay_as_they_are_and_padding_is_left_out(encoding):
    assert pixels(raw(encoding, [1, 2, 9, 3, 4, 9], (2, 2), 3)).tolist() == [[1, 2], [3, 4]]
    # The last row may end with its last pixel.
    assert pixels(raw(encoding, [1, 2, 9, 3, 4], (2, 2), 3)).tolist() == [[1, 2], [3, 4]]


@pytest.mark.parametrize("encoding", ["mono16", "16UC1"])
def test_sixteen_bits_are_read_in_their_byte_order(encoding):
    for big_endian, data in ((False, [1, 2, 3, 4]), (True, [2, 1, 4, 3])):
        image = pixels(raw(encoding, data, (1, 2), big_endian=big_endian))
        assert image.dtype == np.uint16
        assert image.tolist() == [[0x0201, 0x0403]]


@pytest.mark.parametrize(
    ("encoding", "values"),
    [
        ("bgr8", [BLUE, GREEN, RED]),
        ("8UC3", [BLUE, GREEN, RED]),
        ("rgb8", [RED, GREEN, BLUE]),
        ("bgra8", [BLUE, GREEN, RED, 255]),
        ("8UC4", [BLUE, GREEN, RED, 255]),
        ("rgba8", [RED, GREEN, BLUE, 255]),
    ],
)
def test_colours_become_blue_green_red(encoding, values):
    assert pixels(raw(encoding, values, (1, 1))).tolist() == [[[BLUE, GREEN, RED]]]


@pytest.mark.parametrize("bits", [8, 16])
@pytest.mark.parametrize("cells", ["rggb", "bggr", "gbrg", "grbg"])
def test_a_mosaic_of_one_colour_is_that_colour_everywhere(cells, bits):
    levels = {"r": RED, "g": GREEN, "b": BLUE}
    dtype = np.uint8 if bits == 8 else np.dtype("<u2")
    block = np.array([[levels[cells[0]], levels[cells[1]]], [levels[cells[2]], levels[cells[3]]]], dtype)
    image = pixels(raw(f"bayer_{cells}{bits}", np.tile(block, (4, 4)).tobytes(), (8, 8)))
    assert np.unique(image.reshape(-1, 3), axis=0).tolist() == [[BLUE, GREEN, RED]]


@pytest.mark.parametrize(("encoding", "values"), [("yuv422", [128, 90, 128, 90]), ("yuv422_yuy2", [90, 128, 90, 128])])
def test_without_colour_differences_a_pixel_is_grey(encoding, values):
    image = pixels(raw(encoding, values * 2, (2, 2)))
    assert image.shape == (2, 2, 3)
    assert np.ptp(image) == 0


@pytest.mark.parametrize("encoding", ["32FC1", "64FC1", "16SC1", "8UC2", "", "h264"])
def test_what_is_no_image_is_refused(encoding):
    with pytest.raises(DatasetError, match="not an image that is read here"):
        pixels(raw(encoding, [0] * 64, (2, 2)))


def test_too_few_bytes_are_refused():
    with pytest.raises(DatasetError, match="has 3 bytes, too few for 2 x 2 pixels mono8"):
        pixels(raw("mono8", [1, 2, 3], (2, 2)))
