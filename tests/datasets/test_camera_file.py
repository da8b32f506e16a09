"""camera.toml: what it may say, and how it is refused."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from omnieval.datasets import Camera, Mirror
from omnieval.datasets.cards import parse_camera
from omnieval.errors import DatasetError

MIRROR = "[mirror]\ncx = 320\ncy = 240.5\nr_in = 45\nr_out = 230\n"


@pytest.mark.parametrize(
    ("text", "camera"),
    [
        ('kind = "panoramic"', Camera("panoramic")),
        ('kind = "omnidirectional"', Camera("omnidirectional")),
        ('kind = "omnidirectional"\n' + MIRROR, Camera("omnidirectional", Mirror(320.0, 240.5, 45.0, 230.0))),
    ],
)
def test_kind_and_mirror_are_read(text, camera):
    assert parse_camera(text) == camera


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("", "no kind"),
        ("kind = 'panorama'", "did you mean panoramic?"),
        ("kind = 1", "unknown kind '1'"),
        ("kid = 'panoramic'", "unknown key 'kid'; did you mean kind?"),
        ("kind = ", "not valid TOML"),
        ("kind = 'panoramic'\n" + MIRROR, "no [mirror]"),
        ("kind = 'omnidirectional'\nmirror = 3", "not a table"),
        ("kind = 'omnidirectional'\n" + MIRROR + "r_outer = 1", "unknown key 'r_outer'; did you mean r_out?"),
        ("kind = 'omnidirectional'\n[mirror]\ncx = 1", "mirror: no cy"),
        ("kind = 'omnidirectional'\n" + MIRROR.replace("45", "true"), "mirror.r_in: "),
        ("kind = 'omnidirectional'\n" + MIRROR.replace("45", "nan"), "mirror.r_in: "),
        ("kind = 'omnidirectional'\n" + MIRROR.replace("45", "231"), "0 <= r_in < r_out"),
        ("kind = 'omnidirectional'\n" + MIRROR.replace("45", "-1"), "0 <= r_in < r_out"),
    ],
)
def test_everything_else_is_refused_in_one_line(text, complaint):
    with pytest.raises(DatasetError) as caught:
        parse_camera(text)
    assert complaint in str(caught.value)
    assert "\n" not in str(caught.value)


@given(st.text())
def test_only_dataset_errors_come_out(text):
    with pytest.raises(DatasetError):
        parse_camera(text)
