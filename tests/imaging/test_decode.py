"""Image files to pixels, and what is refused."""

import cv2
import numpy as np
import pytest

from omnieval.errors import DatasetError
from omnieval.imaging.decode import decode_colour, decode_grey


def encoded(suffix):
    image = np.random.default_rng(0).integers(0, 256, (40, 60, 3), np.uint8)
    return image, cv2.imencode(suffix, image)[1].tobytes()


@pytest.mark.parametrize("suffix", [".jpeg", ".png", ".bmp"])
def test_shapes(suffix):
    _, data = encoded(suffix)
    assert decode_grey(data, "x").shape == (40, 60)
    assert decode_colour(data, "x").shape == (40, 60, 3)


@pytest.mark.parametrize("options", [[], [cv2.IMWRITE_JPEG_PROGRESSIVE, 1], [cv2.IMWRITE_JPEG_OPTIMIZE, 1]])
def test_pixels_of_a_jpeg_are_those_of_opencv(options):
    image, _ = encoded(".png")
    for picture in (image, image[..., 0]):
        data = cv2.imencode(".jpg", picture, options)[1]
        grey, colour = (np.asarray(cv2.imdecode(data, flag)) for flag in (cv2.IMREAD_GRAYSCALE, cv2.IMREAD_COLOR))
        assert np.array_equal(decode_grey(data.tobytes(), "x"), grey)
        assert np.array_equal(decode_colour(data.tobytes(), "x"), colour)


def test_pixels_survive_png():
    image, data = encoded(".png")
    assert np.array_equal(decode_colour(data, "x"), image)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "has no bytes"),
        (b"not an image at all", "not an image"),
        (encoded(".jpeg")[1][:900], "ends early"),
        (encoded(".png")[1][:30], "ends early"),
    ],
)
def test_what_is_no_image_is_refused_by_name(data, message, capfd):
    with pytest.raises(DatasetError, match=message) as raised:
        decode_grey(data, "some/file.jpeg")
    assert "some/file.jpeg" in str(raised.value)
    assert capfd.readouterr() == ("", "")
