"""Order and times in the names of images."""

from __future__ import annotations

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from omnieval.datasets import load
from omnieval.datasets.names import natural_key, time_in_name
from tests.datasets.trees import make_folder

ORDERS = [
    ["file2.png", "file10.png"],
    ["img_1.png", "img_1.10.png", "img_1.5.png", "img_2.png"],
    ["t9.1.png", "t12.345.png", "t12.4.png"],
    ["0.05.jpg", "0.5.jpg", "5.jpg"],
    ["run_2004.9.1.png", "run_2004.10.1.png"],  # a date has no decimals
    ["v1.2.9.png", "v1.2.10.png"],
    ["1403636579.763555584.png", "1403636580.063555584.png"],
    ["a/2.png", "a/10.png", "b/1.png"],
]


@pytest.mark.parametrize("names", ORDERS, ids=[names[0] for names in ORDERS])
def test_numbers_are_compared_as_numbers_decimals_too(names):
    assert sorted(set(names), key=natural_key) == names


@given(st.lists(st.decimals(0, 1000, places=3), min_size=2, unique=True))
def test_names_of_decimals_have_their_order(numbers):
    names = [f"t{number.normalize():f}.png" for number in numbers]
    assert sorted(names, key=natural_key) == [name for _, name in sorted(zip(numbers, names, strict=True))]


@given(st.lists(st.text(), min_size=2))
def test_any_names_can_be_sorted(names):
    ordered = sorted(names, key=natural_key)
    assert all(natural_key(one) <= natural_key(other) for one, other in pairwise(ordered))


@pytest.mark.parametrize(
    ("stem", "time_ns"),
    [
        ("1403636579763555584", 1403636579763555584),
        ("1403636579763555", 1403636579763555000),
        ("cam0_1403636579763", 1403636579763000000),
        ("1403636579", 1403636579000000000),
        ("frame_1403636579.5", 1403636579500000000),
        ("t1152904768.652404_x-1.511887_y1.036311_a1.348328", 1152904768652404000),
        ("img_12", None),
        ("t12.345", None),
        ("20060714192212", None),
        ("1403636579_1403636580", None),
        ("14036365797635555841", None),
    ],
)
def test_a_time_since_the_epoch_is_found_in_a_name(stem, time_ns):
    assert time_in_name(stem) == time_ns


def test_images_in_several_folders_are_in_the_order_of_the_times_in_their_names(tmp_path):
    for folder, seconds in (("kitchen", 3), ("hall", 1), ("hall", 5), ("kitchen", 4)):
        make_folder(tmp_path / "f" / folder, [f"140363657{seconds}.5.png"])
    (tmp_path / "f" / "card.toml").write_text('title = "x"\n[layout]\n')
    frames = load(tmp_path / "f").frames
    assert [frame.file.partition(".")[0][-1] for frame in frames] == ["1", "3", "4", "5"]
    assert frames[0].time_ns == 1403636571500000000


def test_one_name_without_a_time_and_none_counts(tmp_path):
    names = ["1403636579.png", "1403636580.png", "last.png"]
    assert {frame.time_ns for frame in load(make_folder(tmp_path / "f", names)).frames} == {None}
