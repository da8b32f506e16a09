"""COLD as people keep it: a folder per room, all images in one folder, labels of the other camera."""

from __future__ import annotations

import math
from collections import Counter

import pytest

from omnieval.datasets import Pose, load
from omnieval.datasets.check import check
from omnieval.datasets.cold import format_name
from omnieval.errors import DatasetError
from tests.datasets.trees import START_NS, cold_names, image_bytes, make_cold, make_folder

ROUTE = ("CR-A", "2PO1-A", "CR-A", "KT-A", "CR-A")
"""The corridor is visited thrice, so that the folders of rooms interleave in time."""


def make_rooms(root, names, route=ROUTE, *, ending=".jpeg"):
    """The images along a route, each in the folder of its room."""
    for i, name in enumerate(names):
        room = root / route[i * len(route) // len(names)]
        room.mkdir(parents=True, exist_ok=True)
        (room / name.replace(".jpeg", ending)).write_bytes(image_bytes(ending, seed=i))
    return root


def drive(count, *, start_s=0.0):
    return [format_name(START_NS + int((start_s + i / 5) * 1e9), Pose(i / 10, 0.0, 0.5)) for i in range(count)]


def codes(findings):
    return Counter(finding.code for finding in findings)


@pytest.mark.parametrize("scheme", ["cold:", ""])
@pytest.mark.parametrize("ending", [".jpeg", ".png", ".jpg"])
def test_a_folder_a_room_is_one_drive_in_the_order_of_time(scheme, ending, tmp_path):
    names = drive(20)
    root = make_rooms(tmp_path / "cloudy", names, ending=ending)
    sequence = load(f"{scheme}{root}")
    assert [frame.path.name for frame in sequence.frames] == [name.replace(".jpeg", ending) for name in names]
    assert sequence.frames[4].file == f"2PO1-A/{names[4].replace('.jpeg', ending)}"
    assert sequence.rooms == tuple(room.partition("-")[0] for room in ROUTE for _ in range(4))
    assert sequence.frames[7].pose == Pose(0.7, 0.0, 0.5)
    assert (sequence.name, sequence.source) == ("cloudy", f"cold:{root}")
    assert load(sequence.source).frames == sequence.frames
    assert sequence.findings == ()
    assert sequence.camera.kind == "auto"


def test_rooms_of_any_name_are_rooms_where_the_drive_goes_on(tmp_path):
    root = make_rooms(tmp_path / "night", drive(20), ("hall", "office 1", "hall", "kitchen", "hall"))
    assert Counter(load(root).rooms) == {"hall": 12, "office 1": 4, "kitchen": 4}


def test_the_only_light_in_a_folder_is_the_sequence_and_of_several_one_must_be_named(tmp_path):
    make_rooms(tmp_path / "Friburgo" / "cloudy", drive(20))
    assert load(tmp_path / "Friburgo").source == f"cold:{tmp_path}/Friburgo/cloudy"
    make_rooms(tmp_path / "Friburgo" / "night", drive(20, start_s=5000))
    for scheme in ("cold:", ""):
        with pytest.raises(DatasetError, match=r"holds 2 sequences \(cloudy, night\); name one of them"):
            load(f"{scheme}{tmp_path}/Friburgo")


def test_drives_of_other_times_are_no_rooms(tmp_path):
    for number in (1, 2):
        make_folder(tmp_path / "data" / f"seq{number}", drive(5, start_s=4000 * number))
    with pytest.raises(DatasetError, match=r"holds 2 sequences \(seq1, seq2\)"):
        load(f"cold:{tmp_path}/data")


@pytest.mark.parametrize("scheme", ["cold:", ""])
def test_all_images_in_one_folder(scheme, tmp_path):
    names = drive(6)
    root = make_folder(tmp_path / "flat", names)
    (root / "places.lst").write_text("".join(f"{name} CR-A\n" for name in names))
    sequence = load(f"{scheme}{root}")
    assert [frame.file for frame in sequence.frames] == names
    assert sequence.frames[5].pose == Pose(0.5, 0.0, 0.5)
    assert set(sequence.rooms) == {"CR"}
    assert sequence.findings == ()


def test_poses_beside_the_images_are_more_than_their_names(tmp_path):
    names = drive(3)
    root = make_folder(tmp_path / "flat", names, "file,x,y\n" + "".join(f"{name},7,8\n" for name in names))
    sequence = load(root)
    assert sequence.source == f"folder:{root}"
    assert {(frame.pose.x, frame.pose.y) for frame in sequence.frames if frame.pose} == {(7.0, 8.0)}


def test_a_name_that_is_none_among_rooms_is_an_error(tmp_path):
    root = make_rooms(tmp_path / "cloudy", drive(10))
    (root / "KT-A" / "picture.jpeg").write_bytes(image_bytes())
    with pytest.raises(DatasetError, match=r"KT-A/picture.jpeg: .*expected t<seconds>"):
        load(root)


@pytest.mark.parametrize("scheme", ["cold:", ""])
def test_a_refusal_says_which_layouts_are_known(scheme, tmp_path):
    (tmp_path / "sub").mkdir()
    (finding,) = check(f"{scheme}{tmp_path}").findings
    assert "omni_cam/<images>, <ROOM>-<PART>/<images> for each room, and <images> in one folder" in finding.message


class TestLabels:
    def labelled(self, tmp_path, lines):
        root = make_cold(tmp_path / "seq", cold_names(10))
        (root / "localization" / "places.lst").write_text("".join(f"{line}\n" for line in lines))
        return root

    @pytest.mark.parametrize("folder", ["omni_cam/", "./omni_cam/", "omni_cam\\", "/data/seq/omni_cam/"])
    def test_folders_before_the_names_do_not_matter(self, folder, tmp_path):
        sequence = load(self.labelled(tmp_path, [f"{folder}{name} CR-A" for name in cold_names(10)]))
        assert set(sequence.rooms) == {"CR"}
        assert sequence.findings == ()

    def test_another_ending_does_not_matter(self, tmp_path):
        lines = [f"{name.replace('.jpeg', '.png')} CR-A" for name in cold_names(10)]
        assert set(load(self.labelled(tmp_path, lines)).rooms) == {"CR"}

    def test_labels_of_the_other_camera_are_joined_by_time(self, tmp_path):
        """Its images are 90 ms later, of an interval of 200 ms, so that each belongs to the one before it."""
        other = [format_name(START_NS + i * 200_000_000 + 90_000_000, Pose(i, 0.0, math.pi / 4)) for i in range(10)]
        root = self.labelled(tmp_path, [f"std_cam/{name} R{i}-A" for i, name in enumerate(other)])
        sequence = load(root)
        assert sequence.rooms == tuple(f"R{i}" for i in range(10))
        assert codes(sequence.findings) == {"label-by-time": 10}
        assert check(root).ok

    def test_labels_half_a_frame_away_or_more_are_not_joined(self, tmp_path):
        other = [format_name(START_NS + i * 200_000_000 + 100_000_000, Pose(i, 0.0, 0.0)) for i in range(10)]
        with pytest.raises(DatasetError, match=r"places.lst: none of its 10 labels names an image that is here"):
            load(self.labelled(tmp_path, [f"{name} CR-A" for name in other]))

    def test_half_of_them_foreign_is_said_with_its_count(self, tmp_path):
        names = cold_names(10)
        foreign = [format_name(START_NS + (i + 500) * 10**9, Pose(i, 0.0, 0.0)) for i in range(5)]
        sequence = load(self.labelled(tmp_path, [f"{name} CR-A" for name in names[:5] + foreign]))
        assert sequence.rooms == ("CR",) * 5 + (None,) * 5
        assert codes(sequence.findings) == {"missing-image": 5, "image-without-label": 5}
