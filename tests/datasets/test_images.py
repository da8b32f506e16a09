"""Whole and broken image files."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from omnieval.datasets.images import BadImageError, decoded, examine_image, header_size, inspect_image, is_truncated
from tests.datasets.trees import image_bytes

SUFFIXES = [".jpeg", ".png", ".bmp"]


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_sound_image_reports_its_size(tmp_path, suffix):
    path = tmp_path / f"a{suffix}"
    path.write_bytes(image_bytes(suffix, width=20, height=10))
    assert inspect_image(path).size == (20, 10)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_prefix_of_an_image_is_truncated(suffix):
    data = image_bytes(suffix)
    assert not is_truncated(data)
    assert all(is_truncated(data[:length]) for length in range(2 if suffix == ".jpeg" else 8, len(data)))


def test_trailing_bytes_do_no_harm():
    assert not is_truncated(image_bytes() + b"\0" * 100)


def test_the_end_of_a_thumbnail_is_not_the_end_of_the_image():
    data = image_bytes()
    thumbnail = b"Exif\0\0" + image_bytes(width=4, height=4)
    header = b"\xff\xe1" + (len(thumbnail) + 2).to_bytes(2, "big") + thumbnail
    whole = data[:2] + header + data[2:]
    assert not is_truncated(whole)
    assert is_truncated(whole[: len(whole) // 2])
    assert is_truncated(whole[:-2])


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_the_header_tells_the_size(suffix):
    assert header_size(image_bytes(suffix, width=300, height=7)) == (300, 7)


def test_a_progressive_image_and_one_from_top_to_bottom_have_a_size_too():
    pixels = np.zeros((12, 16, 3), np.uint8)
    assert header_size(cv2.imencode(".jpg", pixels, [cv2.IMWRITE_JPEG_PROGRESSIVE, 1])[1].tobytes()) == (16, 12)
    bitmap = bytearray(image_bytes(".bmp"))
    bitmap[22:26] = (-12).to_bytes(4, "little", signed=True)
    assert header_size(bytes(bitmap)) == (16, 12)


@pytest.mark.parametrize("data", [b"", b"text", b"\xff\xd8", b"BM", b"\x89PNG\r\n\x1a\n", b"BM" + b"\0" * 60])
def test_other_bytes_have_no_size(data):
    assert header_size(data) is None


def test_every_flipped_byte_behind_the_signature_of_a_png_is_damage():
    data = image_bytes(".png")
    for position in range(8, len(data)):
        spoilt = bytearray(data)
        spoilt[position] ^= 0x40
        with pytest.raises(BadImageError, match=r"checksum|ends early"):
            decoded(bytes(spoilt))


def test_a_damaged_remark_within_a_png_is_none_to_its_pixels():
    data = image_bytes(".png")
    remark = b"\0\0\0\x03tEXtabc" + b"\0\0\0\0"
    assert np.array_equal(decoded(data[:33] + remark + data[33:]), decoded(data))


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_look_at_the_header_says_what_decoding_says(tmp_path, suffix):
    path = tmp_path / f"a{suffix}"
    data = image_bytes(suffix)
    for content in (data, data[: len(data) // 2], data[:-1], b"", b"text", b"GIF89a" + b"\0" * 30):
        path.write_bytes(content)
        assert examine_image(path) == inspect_image(path)


@pytest.mark.parametrize(
    ("data", "code"),
    [
        (b"", "empty-image"),
        (b"this is text", "not-an-image"),
        (image_bytes()[:-3], "truncated-image"),
        (image_bytes()[: len(image_bytes()) // 2], "truncated-image"),
        (b"\xff\xd8", "truncated-image"),
        (b"\xff\xd8\xff\xda\x00\x02\xff\xd9", "not-an-image"),
    ],
)
def test_a_broken_file_says_how(tmp_path, data, code):
    path = tmp_path / "a.jpeg"
    path.write_bytes(data)
    report = inspect_image(path)
    assert (report.size, report.code) == (None, code)


def test_a_file_that_cannot_be_read_says_why(tmp_path):
    (tmp_path / "folder.jpeg").mkdir()
    assert inspect_image(tmp_path / "folder.jpeg").code == "unreadable-image"
    (tmp_path / "loop.jpeg").symlink_to(tmp_path / "loop.jpeg")
    assert inspect_image(tmp_path / "loop.jpeg").code == "unreadable-image"
    assert "No such file" in inspect_image(tmp_path / "none.jpeg").message


def test_a_decoder_that_raises_is_a_finding_too(tmp_path, monkeypatch):
    def refuse(data, flags):
        raise cv2.error("broken")

    monkeypatch.setattr(cv2, "imdecode", refuse)
    path = tmp_path / "a.png"
    path.write_bytes(image_bytes(".png"))
    assert inspect_image(path).code == "not-an-image"


@pytest.mark.parametrize("filler", [b"\xff", b"\xff\xff", b"\xff\x01", b"\xff\xd0"])
def test_fill_bytes_and_bare_markers_in_a_header_are_stepped_over(filler):
    data = image_bytes()
    whole = data[:2] + filler + data[2:]
    assert not is_truncated(whole)
    assert is_truncated(whole[:-2])
