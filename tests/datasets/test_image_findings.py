"""Images of every kind are read as they are meant, and what is odd about them is found."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import cv2
import numpy as np
import pytest

from omnieval.datasets import load
from omnieval.datasets.check import check
from omnieval.datasets.image_header import read_header, turned
from omnieval.datasets.images import decoded, examine_image, inspect_image
from omnieval.errors import DatasetError
from omnieval.imaging.decode import decode_grey
from omnieval.imaging.soundness import examined
from tests.datasets.pictures import coded, scene, tiff, with_orientation
from tests.datasets.trees import make_folder

LOSSLESS_WEBP = (cv2.IMWRITE_WEBP_QUALITY, 101)
FORMATS = [(".jpg", (cv2.IMWRITE_JPEG_QUALITY, 100)), (".png", ()), (".webp", LOSSLESS_WEBP)]


def folder(root: Path, contents: dict[str, bytes]) -> Path:
    root.mkdir()
    for name, data in contents.items():
        (root / name).write_bytes(data)
    return root


def found(root: Path) -> Counter[str]:
    """What opening finds of the images, which the check finds too."""
    findings = examined(load(root)).findings
    assert {finding for finding in findings if finding.severity != "info"} <= set(check(root).findings)
    return Counter(finding.code for finding in findings if finding.severity != "info")


class TestOrientation:
    @pytest.mark.parametrize("orientation", range(1, 9))
    @pytest.mark.parametrize(("suffix", "options"), FORMATS)
    def test_an_image_is_turned_as_its_exif_block_says(self, suffix, options, orientation):
        """OpenCV, which turns JPEGs by default, is the oracle for all formats."""
        data = with_orientation(coded(suffix, scene(), *options), orientation)
        plain = coded(suffix, scene(), *options)
        oracle = with_orientation(coded(".jpg", scene(), cv2.IMWRITE_JPEG_QUALITY, 100), orientation)
        shape = np.asarray(cv2.imdecode(np.frombuffer(oracle, np.uint8), cv2.IMREAD_GRAYSCALE)).shape
        assert read_header(data).orientation == orientation
        assert decoded(data).shape == shape
        assert np.array_equal(decoded(data), turned(decoded(plain), orientation))
        assert np.array_equal(decoded(data, colour=True), turned(decoded(plain, colour=True), orientation))

    def test_a_jpeg_is_turned_as_opencv_turns_it(self):
        for orientation in range(1, 9):
            for order in "<>":
                data = with_orientation(coded(".jpg", scene(), cv2.IMWRITE_JPEG_QUALITY, 100), orientation, order)
                oracle = np.asarray(cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_GRAYSCALE))
                assert np.array_equal(decoded(data), oracle), orientation

    @pytest.mark.parametrize("orientation", range(1, 9))
    def test_a_tiff_is_turned_once(self, orientation):
        assert np.array_equal(decoded(tiff(scene(), orientation)), turned(scene(), orientation))

    @pytest.mark.parametrize("orientation", [0, 9, 300])
    def test_an_impossible_orientation_is_none(self, orientation):
        data = with_orientation(coded(".png", scene()), orientation)
        assert np.array_equal(decoded(data), scene())

    @pytest.mark.parametrize("look", [examine_image, inspect_image])
    def test_the_size_is_that_of_the_turned_image(self, look, tmp_path):
        (tmp_path / "a.jpg").write_bytes(with_orientation(coded(".jpg", scene(320, 160)), 6))
        assert look(tmp_path / "a.jpg").size == (160, 320)

    def test_images_that_are_all_turned_are_said_to_be(self, tmp_path):
        images = {f"{n}.png": with_orientation(coded(".png", scene(seed=n)), 3) for n in range(4)}
        assert found(folder(tmp_path / "f", images)) == {"turned-image": 4}

    def test_some_that_are_turned_are_reported(self, tmp_path):
        images = {f"{n}.png": with_orientation(coded(".png", scene(seed=n)), 3 if n == 2 else 1) for n in range(4)}
        (finding,) = check(folder(tmp_path / "f", images)).findings[:1]
        assert (finding.code, finding.where) == ("mixed-orientation", "2.png")
        assert "is turned by 180 degrees by its EXIF orientation, most are not turned" in finding.message

    def test_some_that_lie_are_of_another_size(self, tmp_path):
        images = {f"{n}.png": with_orientation(coded(".png", scene(seed=n)), 6 if n == 2 else 1) for n in range(4)}
        with pytest.raises(DatasetError, match=r"2.png is 16 x 32 pixels, most are 32 x 16"):
            examined(load(folder(tmp_path / "f", images)))


class TestBits:
    @pytest.mark.parametrize("suffix", [".png", ".tif", ".pgm"])
    @pytest.mark.parametrize("bits", [8, 10, 12, 14, 16])
    def test_sixteen_bits_are_scaled_by_those_that_are_used(self, bits, suffix, tmp_path):
        deep = [(scene(seed=n).astype(np.uint16) << (bits - 8)) | (1 << bits >> 9) for n in range(3)]
        root = folder(tmp_path / "f", {f"{n}{suffix}": coded(suffix, image) for n, image in enumerate(deep)})
        sequence = examined(load(root))
        assert {frame.bits for frame in sequence.frames} == {bits}
        for n, frame in enumerate(sequence.frames):
            assert np.abs(decode_grey(frame.read(), frame.file, frame.bits).astype(int) - scene(seed=n)).max() <= 1
        assert found(root) == ({} if bits == 16 else {"few-bits": 3})

    def test_a_dark_image_is_scaled_like_the_others(self, tmp_path):
        bright, dark = scene().astype(np.uint16) << 4, scene().astype(np.uint16) // 4
        root = folder(tmp_path / "f", {"1.png": coded(".png", bright), "2.png": coded(".png", dark)})
        pictures = [decode_grey(frame.read(), frame.file, frame.bits) for frame in examined(load(root)).frames]
        assert pictures[0].max() > 200
        assert pictures[1].max() == dark.max() >> 4

    def test_floating_point_numbers_are_no_picture(self, tmp_path):
        root = folder(tmp_path / "f", {"1.tif": coded(".tif", scene().astype(np.float32))})
        with pytest.raises(DatasetError, match=r"1.tif holds other numbers than grey levels"):
            examined(load(root))


def test_images_without_contrast_are_found(tmp_path):
    noise = np.random.default_rng(0).normal(40, 1, (16, 32)).round().astype(np.uint8)
    images = {"1.png": scene(), "2.png": np.zeros_like(scene()), "3.png": noise, "4.png": np.full_like(scene(), 255)}
    root = folder(tmp_path / "f", {name: coded(".png", image) for name, image in images.items()})
    flat = [finding.where for finding in check(root).findings if finding.code == "no-contrast"]
    assert flat == ["2.png", "3.png", "4.png"]
    assert found(root) == {"no-contrast": 3}


@pytest.mark.parametrize("size", [(640, 480), (2048, 512)])
@pytest.mark.parametrize("suffix", [".png", ".jpg", ".bmp"])
def test_a_large_image_without_contrast_is_found_at_a_look(size, suffix, tmp_path):
    path = tmp_path / f"a{suffix}"
    path.write_bytes(coded(suffix, np.zeros(size[::-1], np.uint8)))
    assert inspect_image(path).is_flat
    assert examine_image(path).is_flat


class TestKinds:
    @pytest.mark.parametrize("suffix", [".tif", ".tiff", ".webp", ".pgm", ".ppm", ".TIF"])
    def test_common_kinds_are_read(self, suffix, tmp_path):
        image = np.dstack([scene()] * 3) if suffix == ".ppm" else scene()
        options = LOSSLESS_WEBP if suffix == ".webp" else ()
        images = {f"{n}{suffix}": coded(suffix.lower(), image, *options) for n in range(2)}
        root = folder(tmp_path / "f", images)
        assert len(load(root)) == 2
        assert found(root) == {}
        assert np.array_equal(decoded(images[f"0{suffix}"]), scene())

    @pytest.mark.parametrize("suffix", [".tif", ".webp", ".pgm"])
    def test_half_of_one_is_no_image(self, suffix, tmp_path):
        data = coded(suffix, scene())
        root = folder(tmp_path / "f", {f"1{suffix}": data, f"2{suffix}": data[: len(data) // 2]})
        with pytest.raises(DatasetError, match=f"2{suffix} is not an image"):
            examined(load(root))

    @pytest.mark.parametrize(
        ("suffix", "other"),
        [
            (".png", scene()),  # a mask
            (".png", scene().astype(np.uint16) << 8),  # depth
            (".tif", scene()),
            (".webp", np.dstack([scene()] * 3)),
        ],
    )
    def test_masks_and_depth_beside_the_images_are_reported(self, suffix, other, tmp_path):
        images = {f"{n}.jpg": coded(".jpg", np.dstack([scene(seed=n)] * 3)) for n in range(6)}
        others = {f"{n}_other{suffix}": coded(suffix, other) for n in range(5)}
        assert found(folder(tmp_path / "f", images | others)) == {"mixed-kinds": 5, "twin": 5}

    def test_masks_of_the_same_kind_are_known_by_their_names(self, tmp_path):
        images = {f"{stem}_{n}.png": coded(".png", scene()) for n in range(4) for stem in ("img", "img_mask")}
        findings = [finding for finding in check(folder(tmp_path / "f", images)).findings if finding.code == "twin"]
        assert [finding.where for finding in findings] == [f"img_mask_{n}.png" for n in range(4)]
        assert findings[0].message.startswith("is numbered like img_0.png")

    def test_images_of_one_series_are_no_twins(self, tmp_path):
        names = [f"{n}.png" for n in range(6)] + ["a.png", "b.png", "a 1.png"]
        assert found(make_folder(tmp_path / "f", names)) == {}

    def test_images_that_are_not_read_are_named(self, tmp_path):
        root = make_folder(tmp_path / "f", ["1.png"])
        for name in ("1.heic", "2.GIF", "3.dng", "notes.txt"):
            (root / name).write_bytes(b"x")
        unread = [finding for finding in load(root).findings if finding.code == "unread-image"]
        assert [finding.where for finding in unread] == ["1.heic", "2.GIF", "3.dng"]


class TestEnds:
    @pytest.mark.parametrize("options", [(), (cv2.IMWRITE_JPEG_PROGRESSIVE, 1), (cv2.IMWRITE_JPEG_OPTIMIZE, 1)])
    @pytest.mark.parametrize("lost", [1, 2])
    def test_jpegs_that_lack_their_last_bytes_are_read_with_a_word(self, lost, options, tmp_path):
        whole = [coded(".jpg", scene(64, 48, seed=n), *options) for n in range(3)]
        root = folder(tmp_path / "f", {f"{n}.jpg": data[:-lost] for n, data in enumerate(whole)})
        assert found(root) == {"no-end-marker": 3}
        assert check(root).ok
        for n, data in enumerate(whole):
            assert np.array_equal(decoded(data[:-lost]), decoded(data)), n

    @pytest.mark.parametrize("lost", [5, 30, 200])
    def test_one_that_lacks_pixels_is_truncated(self, lost, tmp_path):
        (tmp_path / "a.jpg").write_bytes(coded(".jpg", scene(64, 48))[:-lost])
        assert examine_image(tmp_path / "a.jpg").code == "truncated-image"

    def test_a_progressive_one_that_lacks_a_scan_is_truncated(self, tmp_path):
        data = coded(".jpg", scene(64, 48), cv2.IMWRITE_JPEG_PROGRESSIVE, 1)
        scans = [at for at in range(len(data)) if data.startswith(b"\xff\xda", at)]
        for at in scans[1:]:
            (tmp_path / "a.jpg").write_bytes(data[:at])
            assert examine_image(tmp_path / "a.jpg").code == "truncated-image"


def test_what_was_found_is_remembered(tmp_path):
    class Memory(dict[str, dict[str, object]]):
        recall = dict.get
        remember = dict.__setitem__

    images = {f"{n}.png": coded(".png", scene().astype(np.uint16) << 4) for n in range(3)}
    sequence = load(folder(tmp_path / "f", images))
    memory = Memory()
    first = examined(sequence, memory)
    assert len(memory) == 1
    assert examined(sequence, memory) == first
    (tmp_path / "f" / "1.png").write_bytes(coded(".png", scene()))
    assert examined(sequence, memory).findings != first.findings
