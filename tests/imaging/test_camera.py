"""Who decides what the images are and where the mirror lies: configuration, dataset, estimate, in this order."""

from typing import Any

import cv2
import numpy as np
import pytest

from omnieval.datasets.sequence import Camera, Frame, Mirror, Sequence
from omnieval.errors import ConfigError, DatasetError
from omnieval.imaging.camera import resolve_camera
from omnieval.imaging.pictures import Pictures
from omnieval.imaging.settings import ImagingConfig
from tests.imaging.test_calibrate import moving_images

CARD = Mirror(160.0, 120.0, 20.0, 110.0)
BLACK = np.zeros((240, 320), np.uint8)


def a_sequence(tmp_path, images, camera):
    frames = []
    for number, image in enumerate(images):
        path = tmp_path / f"{number:03d}.png"
        cv2.imwrite(str(path), image)
        frames.append(Frame(path, path.name))
    return Sequence("s", "folder:s", tmp_path, tuple(frames), camera)


def test_the_configuration_wins_over_the_dataset(tmp_path):
    sequence = a_sequence(tmp_path, [BLACK], Camera("omnidirectional", CARD))
    camera = resolve_camera(sequence, ImagingConfig(cx=150, cy=121, r_in=10, r_out=90))
    assert camera.mirror == Mirror(150, 121, 10, 90)
    assert camera.origin == "configuration"
    partly = resolve_camera(sequence, ImagingConfig(r_in=30))
    assert partly.mirror == Mirror(160.0, 120.0, 30, 110.0)
    assert "r_in" in partly.origin


def test_the_dataset_wins_over_an_estimate(tmp_path):
    sequence = a_sequence(tmp_path, [BLACK], Camera("omnidirectional", CARD))
    assert resolve_camera(sequence, ImagingConfig()).mirror == CARD


def test_the_estimate_does_not_depend_on_the_cut(tmp_path):
    images = moving_images(Mirror(163.0, 118.0, 22.0, 112.0), count=20)
    sequence = a_sequence(tmp_path, images, Camera("omnidirectional"))
    whole = resolve_camera(sequence, ImagingConfig())
    assert "estimated from" in whole.origin
    assert resolve_camera(sequence.cut(start=15, limit=2), ImagingConfig()) == whole


@pytest.mark.parametrize(("shape", "kind"), [((64, 256), "panoramic"), ((240, 320), "omnidirectional")])
def test_the_aspect_ratio_decides_when_nobody_says(tmp_path, shape, kind):
    sequence = a_sequence(tmp_path, [np.zeros(shape, np.uint8)] * 4, Camera("auto"))
    assert resolve_camera(sequence, ImagingConfig()).kind == kind


def test_the_configuration_can_say_what_the_images_are(tmp_path):
    sequence = a_sequence(tmp_path, [np.zeros((240, 320), np.uint8)] * 4, Camera("auto"))
    camera = resolve_camera(sequence, ImagingConfig(kind="panoramic", rows=64, columns=128))
    assert (camera.kind, camera.mirror) == ("panoramic", None)
    assert camera.panorama(np.zeros((240, 320), np.uint8)).shape == (64, 128)


def test_a_mirror_inside_out_is_refused(tmp_path):
    sequence = a_sequence(tmp_path, [BLACK], Camera("omnidirectional", CARD))
    with pytest.raises(ConfigError, match=r"r_in = 200 must be less than imaging\.r_out = 110"):
        resolve_camera(sequence, ImagingConfig(r_in=200))


def test_images_of_different_size_are_refused(tmp_path):
    images = [np.zeros((240, 320), np.uint8)] * 4 + [np.zeros((120, 160), np.uint8)]
    with pytest.raises(DatasetError, match=r"004\.png is 160 x 120 pixels"):
        resolve_camera(a_sequence(tmp_path, images, Camera("omnidirectional")), ImagingConfig())


def test_a_mirror_outside_the_images_is_refused(tmp_path):
    sequence = a_sequence(tmp_path, [BLACK[:100]], Camera("omnidirectional", CARD))
    with pytest.raises(ConfigError, match=r"centre \(160, 120\) lies outside the images of 320 x 100 pixels"):
        resolve_camera(sequence, ImagingConfig())


@pytest.mark.parametrize("camera", [Camera("panoramic"), Camera("auto")])
def test_panoramas_have_no_mirror_to_give(tmp_path, camera):
    sequence = a_sequence(tmp_path, [np.zeros((64, 256), np.uint8)], camera)
    kind = "panoramic" if camera.kind == "auto" else "auto"
    with pytest.raises(ConfigError, match=r"leave out imaging\.r_in"):
        resolve_camera(sequence, ImagingConfig(kind=kind, r_in=20))


def test_an_image_of_another_size_is_not_unwrapped(tmp_path):
    camera = resolve_camera(a_sequence(tmp_path, [BLACK], Camera("omnidirectional", CARD)), ImagingConfig())
    assert camera.size == (320, 240)
    with pytest.raises(DatasetError, match=r"image b\.png is 640 x 480 pixels, the first one 320 x 240"):
        camera.panorama(np.zeros((480, 640), np.uint8), where="b.png")


class Memory(dict[str, dict[str, Any]]):
    """A notebook in memory."""

    recall = dict.get
    remember = dict.__setitem__


def test_what_was_seen_is_not_read_again_until_a_file_changes(tmp_path, monkeypatch):
    images = moving_images(Mirror(163.0, 118.0, 22.0, 112.0), count=6)
    sequence, memory = a_sequence(tmp_path, images, Camera("auto")), Memory()
    first = resolve_camera(sequence, ImagingConfig(), memory)
    read: list[str] = []
    reading = Frame.read

    def noted(frame):
        read.append(frame.file)
        return reading(frame)

    monkeypatch.setattr(Frame, "read", noted)
    assert resolve_camera(sequence, ImagingConfig(), memory) == first
    assert read == []
    cv2.imwrite(str(sequence.frames[5].path), images[0])
    resolve_camera(sequence, ImagingConfig(), memory)
    assert read == [frame.file for frame in sequence.frames]


def test_pictures_are_the_image_and_its_panorama(tmp_path):
    image = np.random.default_rng(0).integers(0, 256, (240, 320, 3), np.uint8)
    sequence = a_sequence(tmp_path, [image, image[::-1]], Camera("omnidirectional", CARD))
    camera = resolve_camera(sequence, ImagingConfig())
    pictures = Pictures(sequence.frames, camera)
    taken = pictures.omnidirectional(1)
    assert taken is not None
    assert np.array_equal(taken, image[::-1])
    assert np.array_equal(pictures.panorama(0), camera.panorama(image))
    assert pictures.panorama(0).shape == (128, 512, 3)


def test_panoramic_input_has_no_omnidirectional_picture(tmp_path):
    sequence = a_sequence(tmp_path, [np.zeros((64, 256, 3), np.uint8)], Camera("panoramic"))
    assert Pictures(sequence.frames, resolve_camera(sequence, ImagingConfig())).omnidirectional(0) is None
