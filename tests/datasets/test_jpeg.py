"""What the bytes of a JPEG tell of it without being decoded."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from omnieval.datasets.images import BadImageError, decoded, examine_image, inspect_image
from omnieval.datasets.jpeg import is_overwritten

SIZE = (160, 200)
PICTURES = {
    "a scene": lambda: scene(0),
    "black": lambda: np.zeros((*SIZE, 3), np.uint8),
    "black around a scene": lambda: scene(1) * (np.hypot(*np.ogrid[-80:80, -100:100]) < 60)[..., None].astype(np.uint8),
    "noise": lambda: np.random.default_rng(2).integers(0, 256, (*SIZE, 3)).astype(np.uint8),
    "grey": lambda: scene(3)[..., 0],
    "a chessboard": lambda: np.repeat(np.kron(np.indices((40, 50)).sum(0) % 2, np.ones((4, 4)))[..., None] * 255, 3, 2),
}
ENCODINGS = {
    "plain": [],
    "poor": [cv2.IMWRITE_JPEG_QUALITY, 5],
    "best": [cv2.IMWRITE_JPEG_QUALITY, 100],
    "own tables": [cv2.IMWRITE_JPEG_OPTIMIZE, 1],
    "progressive": [cv2.IMWRITE_JPEG_PROGRESSIVE, 1],
    "restarting": [cv2.IMWRITE_JPEG_RST_INTERVAL, 3],
    "restarting, own tables": [cv2.IMWRITE_JPEG_RST_INTERVAL, 7, cv2.IMWRITE_JPEG_OPTIMIZE, 1],
    "full colour": [cv2.IMWRITE_JPEG_SAMPLING_FACTOR, cv2.IMWRITE_JPEG_SAMPLING_FACTOR_444],
}


def scene(seed):
    """A picture with coarse and fine structure, shape (160, 200, 3)."""
    noise = np.random.default_rng(seed).normal(size=(2, *SIZE, 3))
    smooth = gaussian_filter(noise[0], (12, 12, 0)) * 30 + gaussian_filter(noise[1], (2, 2, 0))
    return np.clip(128 + 60 * smooth / smooth.std(), 0, 255).astype(np.uint8)


def encoded(picture, encoding):
    return cv2.imencode(".jpg", picture.astype(np.uint8), ENCODINGS[encoding])[1].tobytes()


def overwritten(data, at, content):
    """Return data with other bytes `at` a part of the way from the first coded pixels to the end."""
    first = data.rfind(b"\xff\xda") + 20
    position = int(first + at * (len(data) - first - len(content) - 2))
    return data[:position] + content + data[position + len(content) :]


@pytest.mark.parametrize("encoding", ENCODINGS)
@pytest.mark.parametrize("picture", PICTURES)
def test_no_sound_image_is_taken_for_an_overwritten_one(picture, encoding):
    data = encoded(PICTURES[picture](), encoding)
    assert not is_overwritten(data)
    assert not is_overwritten(data + b"\0" * 200)
    assert not is_overwritten(data + data)
    assert decoded(data).shape == SIZE


@pytest.mark.parametrize("encoding", ["plain", "best", "restarting", "full colour"])
@pytest.mark.parametrize("at", [0.0, 0.3, 0.7, 1.0])
def test_a_hole_of_zeros_is_seen(encoding, at):
    data = encoded(scene(0), encoding)
    assert is_overwritten(overwritten(data, at, bytes(512)))


def test_zeros_that_may_be_pixels_are_left_alone():
    black = encoded(np.zeros((480, 640), np.uint8), "own tables")
    assert bytes(128) in black
    assert not is_overwritten(black)


@pytest.mark.parametrize("encoding", ["plain", "own tables", "progressive", "restarting", "full colour"])
def test_foreign_data_are_nearly_always_seen(encoding):
    data = encoded(
        np.kron(scene(0), np.ones((3, 3, 1))) + np.random.default_rng(0).normal(0, 4, (480, 600, 3)), encoding
    )
    rng = np.random.default_rng(1)
    seen = [is_overwritten(overwritten(data, at, rng.bytes(4096))) for at in np.linspace(0, 1, 40)]
    assert np.mean(seen) > 0.9


def test_a_lost_piece_between_restarts_is_seen():
    data = encoded(scene(0), "restarting")
    first, second = (data.find(marker, data.find(b"\xff\xda")) for marker in (b"\xff\xd2", b"\xff\xd4"))
    assert 0 < first < second
    assert is_overwritten(data[:first] + data[second:])
    assert not is_overwritten(data)


def test_a_restart_that_nothing_announces_is_seen():
    assert is_overwritten(overwritten(encoded(scene(0), "plain"), 0.5, b"\xff\xd0"))


def test_it_is_said_of_the_file(tmp_path):
    path = tmp_path / "a.jpeg"
    path.write_bytes(overwritten(encoded(scene(0), "plain"), 0.5, bytes(600)))
    report = inspect_image(path)
    assert (report.code, report.size) == ("damaged-image", None)
    assert report.message == "is damaged: a part of it was overwritten; copy it again"


def test_what_only_the_decoder_notices_is_found_when_the_image_is_decoded(tmp_path):
    data = encoded(scene(0), "plain")
    spoilt = data[: len(data) // 2] + data[len(data) // 2 + 400 :]
    assert not is_overwritten(spoilt)
    (tmp_path / "a.jpeg").write_bytes(spoilt)
    assert examine_image(tmp_path / "a.jpeg").size == (200, 160)
    assert inspect_image(tmp_path / "a.jpeg").code == "damaged-image"
    with pytest.raises(BadImageError, match="overwritten"):
        decoded(spoilt)
