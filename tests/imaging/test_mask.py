"""Masks: what is left out of a panorama, and what stands there instead."""

import hashlib

import cv2
import numpy as np
import pytest

from omnieval.datasets.sequence import Camera, Frame, Mirror, Sequence
from omnieval.errors import DatasetError, ResultError
from omnieval.imaging.camera import camera_in_words, camera_of, resolve_camera
from omnieval.imaging.mask import PanoramaMask, load_mask
from omnieval.imaging.settings import ImagingConfig


def written(path, image):
    cv2.imwrite(str(path), image)
    return path


def a_sequence(tmp_path, image, camera):
    path = written(tmp_path / "image.png", image)
    return Sequence("s", "folder:s", tmp_path, (Frame(path, path.name),), camera)


def test_masked_pixels_are_blended_from_those_beside_them_around_the_panorama():
    seen = np.array([[True, False, False, True], [False, True, True, False], [False, False, False, False]])
    panorama = np.array([[0, 99, 99, 30], [99, 10, 40, 99], [99, 99, 99, 99]], np.uint8)
    filled = PanoramaMask(seen).filled(panorama)
    # From 40 at column 2 around to 10 at column 1 (which is column 5): 30 at column 3, 20 at column 4, which is 0.
    assert filled[:2].tolist() == [[0, 10, 20, 30], [20, 10, 40, 30]]
    assert filled[2].tolist() == filled[1].tolist()


def test_a_mask_comes_to_the_panorama_as_images_do_and_a_pixel_smaller(tmp_path):
    mask = np.full((64, 256), 255, np.uint8)
    mask[:, 100:110] = 0
    mask[60:] = 0
    file = written(tmp_path / "mask.png", mask)
    sequence = a_sequence(tmp_path, np.zeros((64, 256), np.uint8), Camera("panoramic", mask=file))
    camera = resolve_camera(sequence, ImagingConfig(rows=64, columns=256))
    assert camera.panorama_mask is not None
    seen = camera.panorama_mask.seen
    assert np.flatnonzero(~seen[0]).tolist() == list(range(99, 111))
    assert np.flatnonzero(~seen.any(axis=1)).tolist() == [59, 60, 61, 62, 63]


def test_a_strut_in_the_mirror_is_a_column_of_the_panorama(tmp_path):
    """A post downwards in the image stands behind the robot: at both ends of the panorama."""
    mask = np.full((240, 320), 255, np.uint8)
    mask[120:, 155:166] = 0
    file = written(tmp_path / "mask.png", mask)
    mirror = Mirror(160.0, 120.0, 20.0, 110.0)
    sequence = a_sequence(tmp_path, np.zeros((240, 320), np.uint8), Camera("omnidirectional", mirror, mask=file))
    camera = resolve_camera(sequence, ImagingConfig())
    assert camera.panorama_mask is not None
    masked = np.flatnonzero(~camera.panorama_mask.seen[0])
    assert set(masked) < {*range(10), *range(502, 512)}
    assert {0, 511} < set(masked)


def test_the_mask_is_part_of_the_cameras_identity(tmp_path):
    white = np.full((64, 256), 255, np.uint8)
    file = written(tmp_path / "mask.png", white)
    sequence = a_sequence(tmp_path, np.zeros((64, 256), np.uint8), Camera("panoramic"))
    plain, masked = (resolve_camera(sequence, ImagingConfig(mask=mask)) for mask in (None, str(file)))
    digest = hashlib.blake2b(file.read_bytes(), digest_size=16).hexdigest()
    assert masked.settings == {**plain.settings, "mask": digest}
    assert "mask" not in plain.settings
    assert "masked by mask.png" in camera_in_words(masked.about)
    assert camera_of(masked.about, (256, 64)).settings == masked.settings
    white[0, 0] = 0
    written(file, white)
    with pytest.raises(ResultError, match=r"mask\.png is not the one that was replayed"):
        camera_of(masked.about, (256, 64))


def test_a_mask_of_another_size_or_that_leaves_nothing_is_refused(tmp_path):
    file = written(tmp_path / "mask.png", np.zeros((64, 256), np.uint8))
    with pytest.raises(DatasetError, match=r"mask\.png is 256 x 64 pixels, the images are 320 x 240"):
        load_mask(file, (320, 240))
    with pytest.raises(DatasetError, match="cannot read mask"):
        load_mask(tmp_path / "none.png", (256, 64))
    sequence = a_sequence(tmp_path, np.zeros((64, 256), np.uint8), Camera("panoramic", mask=file))
    with pytest.raises(DatasetError, match="leaves nothing"):
        _ = resolve_camera(sequence, ImagingConfig()).panorama_mask
