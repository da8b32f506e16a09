"""The reader of anyone's images."""

from __future__ import annotations

import math
import os
import sys

import numpy as np
import pytest

from omnieval.datasets import Camera, Mirror, load
from omnieval.datasets.check import check
from omnieval.datasets.folder import scan_folder
from omnieval.datasets.names import natural_key
from omnieval.errors import DatasetError
from tests.datasets.innova_trees import make_innova
from tests.datasets.trees import codes, make_folder


def read_folder(path):
    return scan_folder(path).sequence()


def test_natural_order_counts():
    names = ["file10.png", "file2.png", "File1.PNG", "file02.png", "a.png", "10.png", "9.png"]
    assert sorted(names, key=natural_key) == [
        "9.png",
        "10.png",
        "a.png",
        "File1.PNG",
        "file02.png",
        "file2.png",
        "file10.png",
    ]


def test_images_of_every_kind_and_case_are_frames(tmp_path):
    names = ["1.png", "2.JPG", "3.jpeg", "4.Bmp", "5 ünï.PNG"]
    sequence = read_folder(make_folder(tmp_path / "my images", [*names]))
    assert [frame.file for frame in sequence.frames] == names
    assert (sequence.name, sequence.source) == ("my-images", f"folder:{tmp_path / 'my images'}")
    assert sequence.camera == Camera("auto")
    assert sequence.positions is None


def test_other_and_hidden_files_and_subfolders_are_no_frames(tmp_path):
    root = make_folder(tmp_path / "f", ["1.png"])
    make_folder(root / "sub", ["2.png"])
    (root / "notes.txt").touch()
    (root / "._1.png").touch()
    assert [frame.file for frame in read_folder(root).frames] == ["1.png"]


def test_poses_rooms_and_times_come_from_the_table(tmp_path):
    poses = f"yaw,file,room,y,x,time\n{1.5 * math.pi!r},b2.png,KT,2,1,7.5\n0,b10.png,,4,3,8\n"
    sequence = read_folder(make_folder(tmp_path / "f", ["b10.png", "b2.png"], poses))
    assert [frame.file for frame in sequence.frames] == ["b2.png", "b10.png"]
    assert sequence.positions == pytest.approx(np.array([[1, 2], [3, 4]]))
    assert sequence.yaws == pytest.approx(np.array([-0.5 * math.pi, 0]))
    assert sequence.rooms == ("KT", None)
    assert [frame.time_ns for frame in sequence.frames] == [7_500_000_000, 8_000_000_000]


def test_an_image_without_a_row_has_no_pose(tmp_path):
    sequence = read_folder(make_folder(tmp_path / "f", ["1.png", "2.png"], "file,x,y,yaw\n1.png,0,0,0\n"))
    assert [frame.pose is None for frame in sequence.frames] == [False, True]
    np.testing.assert_array_equal(sequence.positions, [[0, 0], [np.nan, np.nan]])
    np.testing.assert_array_equal(sequence.yaws, [0, np.nan])


def test_an_excel_byte_order_mark_does_no_harm(tmp_path):
    root = make_folder(tmp_path / "f", ["1.png"])
    (root / "poses.csv").write_bytes(b"\xef\xbb\xbffile,x,y,yaw\r\n1.png,1,2,0\r\n")
    assert read_folder(root).positions == pytest.approx(np.array([[1, 2]]))


def test_the_camera_comes_from_its_file(tmp_path):
    camera = "kind = 'omnidirectional'\n[mirror]\ncx = 8\ncy = 6\nr_in = 1\nr_out = 5\n"
    sequence = read_folder(make_folder(tmp_path / "f", ["1.png"], camera=camera))
    assert sequence.camera == Camera("omnidirectional", Mirror(8, 6, 1, 5))


@pytest.mark.parametrize(
    ("poses", "camera", "complaint"),
    [
        ("file,x,y,yaww\n", None, "poses.csv:1: unknown column 'yaww'; did you mean yaw?"),
        ("file,x,y,yaw\n1.png,a,b,c\n", None, "poses.csv:2: "),
        (None, "kind = 'panoramc'", "camera.toml: unknown kind 'panoramc'; did you mean panoramic?"),
    ],
)
def test_a_wrong_table_or_camera_refuses_to_load(tmp_path, poses, camera, complaint):
    root = make_folder(tmp_path / "f", ["1.png"], poses, camera)
    with pytest.raises(DatasetError) as caught:
        read_folder(root)
    assert f"{root}/{complaint}" in str(caught.value)


def test_a_folder_without_images_refuses_to_load(tmp_path):
    with pytest.raises(DatasetError, match="no image"):
        read_folder(make_folder(tmp_path / "f", []))


@pytest.mark.parametrize("name", ["poses.csv", "camera.toml"])
def test_a_table_that_cannot_be_read_refuses_to_load(tmp_path, name):
    root = make_folder(tmp_path / "f", ["1.png"])
    (root / name).mkdir()
    with pytest.raises(DatasetError, match=f"{name}: cannot be read"):
        read_folder(root)


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux takes any bytes as a file name")
def test_a_name_that_no_table_can_hold_refuses_to_load(tmp_path):
    root = make_folder(tmp_path / "f", ["1.png"])
    (root / os.fsdecode(b"\xff.png")).write_bytes(b"")
    with pytest.raises(DatasetError, match="not valid Unicode") as caught:
        read_folder(root)
    assert str(caught.value).isprintable()


def test_a_card_beside_the_images_says_where_else_the_poses_are(tmp_path):
    card = (
        "image_size = [9, 9]\n[layout.ground_truth]\nfile = 'gt.txt'\nlength_unit = 'cm'\ncolumns = ['-', 'y', 'x']\n"
    )
    table = "".join(f"{i} {100 * i} 50\n" for i in range(1, 13))
    root = make_innova(tmp_path / "f", files={"card.toml": card, "gt.txt": table}, images="omni/{}.png")
    sequence = load(f"folder:{root}")
    assert (sequence.source, sequence.card) == (f"folder:{root}", "card.toml")
    assert sequence.positions == pytest.approx(np.array([[0.5, i] for i in range(1, 13)]))
    assert sequence.yaws is None
    assert codes(check(sequence.source)) == [("size-differs", ".")]


def test_a_table_may_do_without_yaw_and_without_endings(tmp_path):
    sequence = read_folder(make_folder(tmp_path / "f", ["1.png", "2.png"], "file,x,y\n1,3,4\n2,5,6\n"))
    assert sequence.positions == pytest.approx(np.array([[3, 4], [5, 6]]))
    assert sequence.yaws is None


def test_an_image_may_be_called_like_a_comment(tmp_path):
    sequence = read_folder(make_folder(tmp_path / "f", ["#1.png"], "file,x,y,yaw\n#1.png,3,4,0\n,,,\n"))
    assert sequence.positions == pytest.approx(np.array([[3, 4]]))


def test_the_names_of_the_files_beside_the_images_may_be_of_any_case(tmp_path):
    root = make_folder(tmp_path / "f", ["1.png"])
    (root / "Poses.CSV").write_text("file,x,y\nIMG/1.PNG,3,4\n")
    (root / "Card.TOML").write_text("image_size = [16, 12]\n")
    (root / "Camera.TOML").write_text('kind = "panoramic"\n')
    sequence = load(root)
    assert sequence.camera.kind == "panoramic"
    assert sequence.frames[0].pose is not None
    assert sequence.card == "Card.TOML"
    (root / "CARD.toml").write_text("image_size = [16, 12]\n")
    with pytest.raises(DatasetError, match=r"both CARD.toml and Card.TOML are there; keep one"):
        load(root)
