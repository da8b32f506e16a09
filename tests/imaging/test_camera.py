"""Who decides what the images are and where the mirror lies: configuration, dataset, estimate, in this order."""

from typing import Any

import cv2
import numpy as np
import pytest
from pydantic import ValidationError

from omnieval.datasets.sequence import Camera, Frame, Mirror, Sequence
from omnieval.errors import ConfigError, DatasetError
from omnieval.imaging.camera import camera_in_words, camera_of, resolve_camera
from omnieval.imaging.pictures import SequencePictures
from omnieval.imaging.settings import ImagingConfig
from omnieval.imaging.survey import survey_camera
from tests.imaging.donuts import donuts, panoramas

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
    images = donuts(Mirror(163.0, 118.0, 22.0, 112.0), count=20)
    sequence = a_sequence(tmp_path, images, Camera("omnidirectional"))
    whole = resolve_camera(sequence, ImagingConfig())
    assert "estimated from" in whole.origin
    assert resolve_camera(sequence.cut(start=15, limit=2), ImagingConfig()) == whole


def test_a_sequence_that_grows_keeps_its_camera_if_its_first_images_tell_it(tmp_path, monkeypatch):
    monkeypatch.setattr(Sequence, "FIRST_FRAMES", 8)
    images = donuts(Mirror(163.0, 118.0, 22.0, 112.0), count=12)
    short = a_sequence(tmp_path, images[:8], Camera("omnidirectional"))
    long = a_sequence(tmp_path, images, Camera("omnidirectional"))
    assert resolve_camera(long, ImagingConfig()) == resolve_camera(short, ImagingConfig())


def test_a_robot_that_stands_at_first_is_seen_to_move_later(tmp_path, monkeypatch):
    """On a background as bright as the scene the rim is not an edge: only what moves tells it."""
    monkeypatch.setattr(Sequence, "FIRST_FRAMES", 8)
    mirror = Mirror(150.0, 125.0, 20.0, 90.0)
    moving = donuts(mirror, count=12, background="grey", seed=1)
    sequence = a_sequence(tmp_path, [*[moving[0]] * 8, *moving], Camera("omnidirectional"))
    camera = resolve_camera(sequence, ImagingConfig())
    assert camera.mirror is not None
    assert camera.mirror.r_out == pytest.approx(mirror.r_out, abs=1.5)
    assert camera.findings == ()
    assert resolve_camera(sequence.cut(start=3, limit=4), ImagingConfig()) == camera


def test_a_robot_that_never_moves_has_its_mirror_from_its_edges_and_a_warning(tmp_path):
    images = donuts(Mirror(163.0, 118.0, 22.0, 112.0), still=True)
    camera = resolve_camera(a_sequence(tmp_path, images, Camera("omnidirectional")), ImagingConfig())
    assert [finding.code for finding in camera.findings] == ["mirror-from-still-images"]


def test_wide_images_are_panoramas_when_nobody_says_and_that_is_said(tmp_path):
    camera = resolve_camera(a_sequence(tmp_path, panoramas(size=(64, 256)), Camera("auto")), ImagingConfig())
    assert (camera.kind, camera.told) == ("panoramic", False)
    assert "treated as panoramas" in camera.origin
    assert "4 times as wide as high" in camera.origin


def test_wide_images_that_show_a_mirror_are_not_panoramas(tmp_path):
    images = donuts(Mirror(240.0, 120.0, 24.0, 112.0), size=(240, 480))
    camera = resolve_camera(a_sequence(tmp_path, images, Camera("auto")), ImagingConfig())
    assert camera.kind == "omnidirectional"
    assert camera.mirror is not None
    assert camera.mirror.cx == pytest.approx(240.0, abs=1.0)


def two_fisheyes():
    one, other = (donuts(Mirror(120.0, 120.0, 0.0, 118.0), size=(240, 240), seed=seed) for seed in (1, 2))
    return [np.hstack(pair) for pair in zip(one, other, strict=True)]


@pytest.mark.parametrize(
    ("images", "why"),
    [(panoramas(), "no circle fits"), (two_fisheyes(), "two discs"), ([BLACK] * 4, "nothing moves")],
)
def test_images_that_do_not_show_what_they_are_are_refused_saying_how_to_tell(tmp_path, images, why):
    sequence = a_sequence(tmp_path, images, Camera("auto"))
    with pytest.raises(DatasetError) as refusal:
        resolve_camera(sequence, ImagingConfig())
    for word in (why, "--set imaging.cx=", "imaging.kind=panoramic", "camera.toml", "--camera", "--preview"):
        assert word in str(refusal.value)
    survey = survey_camera(sequence, ImagingConfig())
    assert (survey.camera, [finding.code for finding in survey.findings]) == (None, ["camera-unknown"])
    told = resolve_camera(sequence, ImagingConfig(kind="panoramic"))
    assert (told.kind, told.told) == ("panoramic", True)


def test_a_belt_is_cut_from_panoramas(tmp_path):
    image = np.repeat(np.arange(128, dtype=np.uint8)[:, np.newaxis], 256, axis=1)
    sequence = a_sequence(tmp_path, [image], Camera("panoramic"))
    whole = resolve_camera(sequence, ImagingConfig(rows=128, columns=256))
    assert "whole-sphere" in [finding.code for finding in whole.findings]
    belt = resolve_camera(sequence, ImagingConfig(rows=64, columns=256, belt="45deg:-45deg"))
    assert np.array_equal(belt.panorama(image), image[32:96])
    assert belt.settings == {**whole.settings, "rows": 64, "belt": [0.25, 0.75]}
    assert camera_of(belt.about, (256, 128)) == belt
    shares = resolve_camera(sequence, ImagingConfig(rows=64, columns=256, belt="0.25:0.75"))
    assert shares.settings == belt.settings
    assert "rows from 25 % to 75 % of the height" in camera_in_words(belt.about)


def test_a_belt_in_degrees_needs_the_whole_sphere_and_no_mirror_has_one(tmp_path):
    wide = a_sequence(tmp_path, [np.zeros((64, 256), np.uint8)], Camera("panoramic"))
    with pytest.raises(ConfigError, match="twice as wide as high, not 256 x 64"):
        resolve_camera(wide, ImagingConfig(belt="30deg:-30deg"))
    donut = a_sequence(tmp_path, [BLACK], Camera("omnidirectional", CARD))
    with pytest.raises(ConfigError, match=r"imaging\.belt is for panoramas"):
        resolve_camera(donut, ImagingConfig(belt="0.2:0.8"))


@pytest.mark.parametrize("belt", ["0.8:0.2", "30:-30", "0.1:20deg", "-30deg:30deg", "0.1", "a:b"])
def test_a_belt_upside_down_or_of_no_form_is_refused(belt):
    with pytest.raises(ValidationError):
        ImagingConfig(belt=belt)


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
    images = donuts(Mirror(163.0, 118.0, 22.0, 112.0), count=6)
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
    pictures = SequencePictures(sequence.frames, camera)
    taken = pictures.omnidirectional(1)
    assert taken is not None
    assert np.array_equal(taken, image[::-1])
    assert np.array_equal(pictures.panorama(0), camera.panorama(image))
    assert pictures.panorama(0).shape == (128, 512, 3)


def test_panoramic_input_has_no_omnidirectional_picture(tmp_path):
    sequence = a_sequence(tmp_path, [np.zeros((64, 256, 3), np.uint8)], Camera("panoramic"))
    assert SequencePictures(sequence.frames, resolve_camera(sequence, ImagingConfig())).omnidirectional(0) is None
