"""Perturbations: what they change, how they are written into a source, and how they are drawn."""

import dataclasses
from typing import Any

import numpy as np
import pytest

from omnieval.datasets import load
from omnieval.datasets.perturbation import Perturbation, Replicates, perturbation_apart
from omnieval.datasets.registry import canonical, place_of
from omnieval.datasets.sequence import Camera, Disturbance, Mirror
from omnieval.descriptors.cache import description_key
from omnieval.errors import ConfigError, DatasetError
from omnieval.imaging.camera import camera_of, resolve_camera
from omnieval.imaging.disturb import disturbed
from omnieval.imaging.settings import ImagingConfig

ALL = "start=3,stride=2,reverse=yes,mirror=0.5:-0.25,noise=2,gain=1.1,seed=7"


def test_a_perturbation_is_written_as_it_is_read():
    bare, found = perturbation_apart(f"synthetic:night#{ALL}")
    assert bare == "synthetic:night"
    assert found == Perturbation(3, 2, True, (0.5, -0.25), 2.0, 1.1, 7)
    assert found.text == ALL
    assert Perturbation().written == {}
    assert Perturbation(seed=5).written == {}  # of what is not drawn
    assert perturbation_apart("video:/a.mp4#every=5,noise=2")[0] == "video:/a.mp4#every=5"


def test_images_are_cut_and_turned_round_in_time(panoramas):
    whole = load(panoramas)
    found = load(f"{panoramas}#start=3,stride=2,reverse=yes")
    assert [frame.file for frame in found.frames] == [frame.file for frame in whole.frames[3::2]][::-1]
    assert found.source == f"{whole.source}#start=3,stride=2,reverse=yes"
    assert found.cut_from == whole.cut_from
    before = np.array([frame.time_ns for frame in whole.frames[3::2]], np.int64)
    after = np.array([frame.time_ns for frame in found.frames], np.int64)
    assert after[0] == before[0]
    assert np.diff(after).tolist() == np.diff(before)[::-1].tolist()
    again = load(found.source)
    assert again.frames == found.frames
    assert found.cut(limit=5).cut_from == (0, 1, 5)  # what is cut besides is all that is still to be cut


def test_what_changes_nothing_is_the_sequence_itself(panoramas):
    assert load(f"{panoramas}#start=0,gain=1") == load(panoramas)


def test_one_sequence_has_one_name(panoramas):
    assert canonical(f"folder:{panoramas}#noise=2.0,start=1") == f"folder:{panoramas}#start=1,noise=2"
    assert place_of(f"folder:{panoramas}#noise=2") == panoramas


@pytest.mark.parametrize("option", ["start=-1", "stride=0", "reverse=1", "mirror=1", "noise=nan", "gain=0", "noise="])
def test_nonsense_is_refused_with_what_is_expected(panoramas, option):
    with pytest.raises(DatasetError, match="expected"):
        load(f"{panoramas}#{option}")


def test_the_mirror_is_believed_elsewhere_and_the_cache_knows(panoramas):
    mirror, off = Mirror(100.0, 40.0, 4.0, 20.0), Disturbance((0.5, -0.25), 2.0, 1.0, 7)

    def camera_with(disturbance, kind: Any = "omnidirectional"):
        camera = Camera(kind, mirror if kind == "omnidirectional" else None, disturbance=disturbance)
        return resolve_camera(dataclasses.replace(load(panoramas), camera=camera), ImagingConfig())

    found, plain = camera_with(off), camera_with(None)
    assert found.mirror == Mirror(100.5, 39.75, 4.0, 20.0)
    assert camera_of(found.about, found.size).settings == found.settings
    assert description_key(found.settings, {}) != description_key(plain.settings, {})
    assert "disturbance" not in plain.settings
    assert camera_with(Disturbance(noise=1.0), "panoramic").settings["disturbance"]["noise"] == 1.0
    with pytest.raises(ConfigError, match="no mirror"):
        camera_with(off, "panoramic")


def test_noise_and_gain_by_their_numbers():
    image = np.full((200, 300), 100, np.uint8)
    assert disturbed(image, None, "00" * 16) is image
    assert disturbed(image, Disturbance((1.0, 1.0)), "00" * 16) is image
    assert (disturbed(image, Disturbance(gain=1.25), "00" * 16) == 125).all()
    assert (disturbed(image, Disturbance(gain=9.0), "00" * 16) == 255).all()
    noisy = disturbed(image, Disturbance(noise=4.0, seed=1), "00" * 16)
    assert noisy.std() == pytest.approx(4.0, rel=0.03)
    assert noisy.mean() == pytest.approx(100.0, abs=0.1)
    assert (noisy == disturbed(image, Disturbance(noise=4.0, seed=1), "00" * 16)).all()
    assert (noisy != disturbed(image, Disturbance(noise=4.0, seed=2), "00" * 16)).any()
    assert (noisy != disturbed(image, Disturbance(noise=4.0, seed=1), "01" * 16)).any()


def test_replicates_are_within_what_is_asked_and_differ():
    drawn = Replicates.parse("start=0:30,stride=1:2,mirror=1,noise=2,gain=0.1,reverse").draw(40)
    assert len(set(drawn)) == 40
    assert {one.start for one in drawn} <= set(range(31))
    assert {one.stride for one in drawn} == {1, 2}
    assert {one.reverse for one in drawn} == {False, True}
    assert all(abs(off) <= 1 for one in drawn for off in one.mirror)
    assert {one.noise for one in drawn} == {2.0}
    assert all(0.9 <= one.gain <= 1.1 for one in drawn)
    assert len({one.seed for one in drawn}) == 40


def test_more_replicates_begin_with_the_fewer_and_one_more_name_changes_no_other():
    asked = Replicates.parse("start=0:30,mirror=1")
    assert asked.draw(9)[:4] == asked.draw(4)
    more = Replicates.parse("start=0:30,mirror=1,noise=2").draw(4)
    assert [(one.start, one.mirror) for one in more] == [(one.start, one.mirror) for one in asked.draw(4)]
    assert Replicates.parse("start=0:30,mirror=1,seed=1").draw(4) != asked.draw(4)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("strat=0:3", "did you mean start"),
        ("start=5:2", "start=0:30"),
        ("stride=0:2", "from 1 on"),
        ("mirror=-1", "pixels"),
        ("mirror=x", "pixels"),
        ("gain=1", "far from 1"),
        ("noise=2,noise=3", "twice"),
        ("", "expected"),
    ],
)
def test_what_cannot_be_drawn_is_refused(text, words):
    with pytest.raises(ConfigError, match=words):
        Replicates.parse(text)


def test_fewer_different_replicates_than_asked_for_are_refused():
    with pytest.raises(ConfigError, match="fewer than 3 different"):
        Replicates.parse("reverse").draw(3)
    assert len(Replicates.parse("reverse").draw(2)) == 2
