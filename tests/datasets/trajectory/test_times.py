"""Images get their times from the tables that cameras and data sets leave beside them."""

import numpy as np
import pytest

from omnieval.datasets import load
from omnieval.datasets.registry import scan
from tests.datasets.pictures import coded

NAMES = [f"{number:06d}.png" for number in range(4)]
TAKEN = [1305031102_175304000 + number * 33_512_000 for number in range(4)]
"""10 May 2011, 12:38:22 UTC."""


def images(folder, names=NAMES):
    folder.mkdir(parents=True)
    for name in names:
        (folder / name).write_bytes(coded(".png", np.zeros((4, 16), np.uint8)))
    return folder


def row(form, name, time):
    whole, rest = divmod(time, 10**9)
    spelt = {"s": f"{whole}.{rest:09d}", "ms": f"{time / 10**6:.3f}", "ns": str(time)}
    return form.format(name=name, date=f"2011-05-10 12:38:22.{rest:09d}", **spelt)


def table(form, *, heading="", names=NAMES):
    return "\n".join([*filter(None, [heading]), *(row(form, *one) for one in zip(names, TAKEN, strict=False))]) + "\n"


def said(folder):
    return {finding.code: finding for finding in scan(f"folder:{folder}").findings}


@pytest.mark.parametrize(
    ("where", "file", "text"),
    [
        ("rgb", "rgb.txt", table("{s} rgb/{name}", heading="# color images\n# timestamp filename")),
        ("cam0/data", "cam0/data.csv", table("{ns},{name}", heading="#timestamp [ns],filename")),
        ("image_2", "times.txt", table("{s}")),
        ("image_00/data", "image_00/timestamps.txt", table("{date}")),
        ("tour", "tour/timestamps.csv", table("{ns}")),
        ("tour", "tour/Times.txt", table("{name}\t{s}")),
        ("tour", "tour/times.csv", table("{name};{ms}", heading="image;stamp_ms")),
    ],
)
def test_the_tables_of_well_known_layouts_are_read(tmp_path, where, file, text):
    folder = images(tmp_path / where)
    (tmp_path / file).write_text(text)
    assert [frame.time_ns for frame in load(f"folder:{folder}").frames] == pytest.approx(TAKEN, abs=500)
    assert said(folder)["times-read"].message.endswith(": 4 of 4 images")


def test_frames_are_in_the_order_of_these_times_and_meet_poses_by_them(tmp_path):
    folder = images(tmp_path / "rgb")
    (tmp_path / "rgb.txt").write_text(table("{s} rgb/{name}", names=NAMES[::-1]))
    rows = (row("{s} ", "", time) + f"{number} 0 0 0 0 0 1\n" for number, time in enumerate(TAKEN))
    (tmp_path / "groundtruth.txt").write_text("".join(rows))
    sequence = load(f"folder:{folder}")
    assert [frame.file for frame in sequence.frames] == NAMES[::-1]
    assert sequence.positions is not None
    assert sequence.positions[:, 0].tolist() == [0, 1, 2, 3]


@pytest.mark.parametrize(
    ("text", "why"),
    [
        (table("{s}", names=NAMES[:3]), "3 times for 4 images"),
        (table("{s} left/x{name}"), "it names left/x000000.png, and the first image is 000000.png"),
        (table("{s} 1 2"), "3 columns without a heading"),
        ("0 0\n1 1\n2 2\n3 3\n", "2 columns without a heading"),
        ("0\n1e9\n2e9\n3e9\n", "grows by 1e+09 a row"),
        ("0\n1\nthree\n4\n", "not every row has a time"),
        ("0 000000.png\n1 000000.png\n", "000000.png has two times"),
        ("", "it has no rows"),
    ],
)
def test_a_table_that_does_not_fit_is_said_and_not_read(tmp_path, text, why):
    folder = images(tmp_path / "tour")
    (folder / "times.txt").write_text(text)
    assert [frame.time_ns for frame in load(f"folder:{folder}").frames] == [None] * 4
    found = said(folder)["unread-times"]
    assert (found.severity, found.where) == ("warning", "times.txt")
    assert why in found.message


def test_of_two_tables_none_is_read_and_an_image_that_is_not_in_the_table_is_said(tmp_path):
    folder = images(tmp_path / "tour")
    (folder / "times.txt").write_text(table("{s} {name}", names=NAMES[:3]))
    lacking = said(folder)["image-without-time"].message
    assert lacking == "has no time of 1 of 4 images, such as 000003.png"
    (folder / "timestamps.txt").write_text(table("{s}"))
    assert "times.txt, timestamps.txt may all hold the times" in said(folder)["unread-times"].message
