"""The reader whose layout the card tells: every shape it may have, and what is said of a wrong one."""

from __future__ import annotations

import io
import math
import os
import re
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.io import savemat

from omnieval.datasets import Camera, Mirror, load
from omnieval.datasets.cards import GroundTruth, all_cards, card, overridden
from omnieval.datasets.check import check
from omnieval.datasets.findings import errors
from omnieval.datasets.folder import scan_innova
from omnieval.datasets.poses import scan_table
from omnieval.errors import DatasetError
from tests.datasets.innova_trees import CAPTURES, make_innova, make_named
from tests.datasets.trees import codes, cold_names, image_bytes, make_cold


def read_innova(path):
    return scan_innova(path).sequence()


NUMBERS = range(1, CAPTURES + 1)
POSITIONS = np.array([[i / 2, -i / 4] for i in NUMBERS])
YAWS = np.array([math.radians(15 * i) for i in NUMBERS])
"""The truth that every shape below encodes, in metres and radians."""

TABLE = np.column_stack([POSITIONS, YAWS])


def mat(**variables) -> bytes:
    stream = io.BytesIO()
    savemat(stream, variables, do_compression=True)
    return stream.getvalue()


def truth(**keys) -> str:
    """A card whose ground truth has these keys."""
    lines = [f"{key} = {str(value).lower() if isinstance(value, bool) else value!r}" for key, value in keys.items()]
    return "\n".join(["[layout.ground_truth]", *lines, ""])


def rows(pattern: str, *, separator: str = ",", scale: float = 1.0, degrees: bool = False) -> str:
    values = ((i, x * scale, y * scale, math.degrees(a) if degrees else a) for i, (x, y, a) in enumerate(TABLE, 1))
    return "".join(
        pattern.replace(",", separator).format(i=i, x=repr(float(x)), y=repr(float(y)), a=repr(float(a))) + "\n"
        for i, x, y, a in values
    )


SHAPES: dict[str, tuple[str, dict[str, str | bytes]]] = {
    "no card, csv": ("", {"ground_truth.csv": rows("{x},{y},{a}")}),
    "no card, text": ("", {"ground_truth.txt": rows("{x},{y},{a}", separator="  ")}),
    "no card, mat": ("", {"ground_truth.mat": mat(anything=TABLE)}),
    "heading, names, degrees, centimetres": (
        truth(file="gt.csv", header=True, columns=["file", "yaw", "x", "y"], length_unit="cm", angle_unit="deg"),
        {"gt.csv": "image,heading,X,Y\n" + rows("IMAGE{i},{a},{x},{y}", scale=100, degrees=True)},
    ),
    "names without ending, millimetres, comments": (
        truth(file="gt.dat", columns=["-", "file", "x", "y", "yaw"], length_unit="mm"),
        {"gt.dat": "# n name x y\n% mm\n" + rows("{i},im{i},{x},{y},{a}", separator="\t", scale=1000)},
    ),
    "semicolons and decimal commas": (
        truth(file="gt.csv", delimiter=";", decimal=","),
        {"gt.csv": rows("{x};{y};{a}").replace(".", ",")},
    ),
    "text by name, csv by card": (truth(file="gt.txt", format="csv"), {"gt.txt": rows("{x},{y},{a}")}),
    "one array of several, transposed": (
        truth(file="gt.mat", variable="poses", transposed=True),
        {"gt.mat": mat(poses=TABLE.T, other=np.eye(3), note="text")},
    ),
    "vectors": (
        truth(file="gt.mat", variable=["px", "py", "theta"], angle_unit="deg"),
        {"gt.mat": mat(px=POSITIONS[:, 0], py=POSITIONS[:, 1:], theta=np.degrees(YAWS))},
    ),
    "byte order mark, carriage returns, blank lines": (
        "",
        {"ground_truth.csv": b"\xef\xbb\xbf" + rows("{x},{y},{a}").replace("\n", "\r\n\r\n").encode()},
    ),
}


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("images", ["im{}.png", "pictures/run/im{}.JPG"])
def test_every_shape_tells_the_same_truth(tmp_path, shape, images):
    own_card, files = SHAPES[shape]
    named = {
        name: re.sub(r"IMAGE(\d+)", images.format(r"\1"), text) for name, text in files.items() if isinstance(text, str)
    }
    root = make_innova(tmp_path / "innova", card=own_card, files={**files, **named}, images=images)
    report = check(f"innova:{root}")
    assert codes(report) == []
    sequence = load(f"innova:{root}")
    assert [frame.file for frame in sequence.frames] == [images.format(i) for i in NUMBERS]
    assert sequence.positions == pytest.approx(POSITIONS, abs=1e-12)
    assert sequence.yaws == pytest.approx(YAWS, abs=1e-12)
    assert (sequence.name, sequence.card) == ("innova", "innova")


def test_rooms_and_times_come_in_their_units(tmp_path):
    own_card = truth(file="gt.csv", columns=["time", "x", "y", "room"], time_unit="ms")
    content = "".join(f"{1700000000000 + i}.000001,{i},0,{'CR' if i < 3 else ''}\n" for i in NUMBERS)
    sequence = read_innova(make_innova(tmp_path / "s", card=own_card, files={"gt.csv": content}))
    assert [frame.time_ns for frame in sequence.frames] == [1_700_000_000_000_000_001 + i * 1_000_000 for i in NUMBERS]
    assert sequence.rooms == ("CR", "CR", *[None] * 10)


def test_a_heading_that_is_not_known_is_none(tmp_path):
    own_card = truth(file="gt.csv", columns=["x", "y"])
    root = make_innova(tmp_path / "s", card=own_card, files={"gt.csv": rows("{x},{y}")})
    sequence = read_innova(root)
    assert sequence.positions == pytest.approx(POSITIONS)
    assert sequence.yaws is None
    assert check(f"innova:{root}").findings == ()


def test_headings_are_wrapped(tmp_path):
    content = "".join(f"{i},0,{i * 30}\n" for i in NUMBERS)
    root = make_innova(tmp_path / "s", card=truth(file="gt.csv", angle_unit="deg"), files={"gt.csv": content})
    yaws = read_innova(root).yaws
    assert yaws is not None
    assert yaws[[5, 8, 11]] == pytest.approx([math.pi, -math.pi / 2, 0])


def test_without_ground_truth_there_are_only_images(tmp_path):
    root = make_innova(tmp_path / "s")
    assert codes(check(f"innova:{root}")) == [("no-poses", "ground_truth.*")]
    assert (len(load(f"innova:{root}")), load(f"innova:{root}").positions) == (12, None)


def test_a_card_may_do_without_ground_truth(tmp_path):
    root = make_innova(tmp_path / "s", card="[layout]\n", files={"ground_truth.csv": "nonsense"})
    assert codes(check(f"innova:{root}")) == [("no-poses", ".")]


def test_the_card_chooses_the_images(tmp_path):
    root = make_innova(tmp_path / "s", images="omni/im{}.png", card="[layout]\nimages = 'omni/im?.png'\n")
    (root / "omni" / ".im0.png").write_bytes(b"")
    (root / "omni" / "im0.txt").touch()
    assert [frame.file for frame in read_innova(root).frames] == [f"omni/im{i}.png" for i in range(1, 10)]


@pytest.mark.parametrize("name", ["innova.toml", "card.toml"])
@pytest.mark.parametrize(
    ("own", "camera"),
    [
        ("", Camera("auto")),
        ("[layout]\nkind = 'panoramic'\n", Camera("panoramic")),
        ("[mirror]\ncx = 8\ncy = 6\nr_in = 1\nr_out = 5\n", Camera("omnidirectional", Mirror(8, 6, 1, 5))),
    ],
)
def test_the_card_tells_the_camera(tmp_path, name, own, camera):
    root = make_innova(tmp_path / "s", files={name: own})
    assert read_innova(root).camera == camera


def test_a_folder_with_a_card_of_its_own_is_recognised(tmp_path):
    root = make_named(tmp_path / "s")
    assert load(root).source == f"innova:{root}"
    (root / "innova.toml").rename(root / "card.toml")
    assert load(root).source == f"folder:{root}"
    cold = make_cold(tmp_path / "c", cold_names(2))
    (cold / "card.toml").touch()
    assert load(cold).source == f"cold:{cold}"


class TestCard:
    def test_a_check_compares_the_route_with_the_paper(self, tmp_path):
        root = make_named(tmp_path / "innova" / "route_1")
        assert codes(check(f"innova:{root}")) == [("count-differs", "."), ("length-differs", ".")]

    def test_what_the_card_beside_the_data_expects_is_not_held_against_the_paper(self, tmp_path):
        root = make_named(tmp_path / "innova" / "route_1")
        with (root / "innova.toml").open("a") as stream:
            stream.write("[[sequences]]\npath = 'route_1'\nimages = 12\n")
        assert codes(check(f"innova:{root}")) == []

    def test_a_card_beside_the_data_needs_only_what_differs(self):
        known = overridden(card("innova"), "image_size = [9, 8]", "card.toml")
        assert known.image_size == (9, 8)
        assert known.model_copy(update={"image_size": None}) == card("innova")

    def test_only_innova_leaves_its_layout_to_the_card(self):
        assert [known.name for known in all_cards() if known.layout is not None] == ["innova"]

    @pytest.mark.parametrize(
        ("own", "complaint"),
        [
            ("title = ", "card innova.toml: not valid TOML"),
            ("a = " + "[" * 5000, "not valid TOML"),
            ("layuot = 1", "unknown key 'layuot'; did you mean layout?"),
            ("[layout]\nimages = '../*.png'", "layout.images: "),
            ("[layout]\nimages = '/*.png'", "layout.images: "),
            ("[layout]\nimages = 'a**/b'", "layout.images: "),
            ("[layout]\nkind = 'mirror'", "layout: unknown kind 'mirror'"),
            ("[layout]\nkind = 'panoramic'\n[mirror]\ncx = 1\ncy = 1\nr_in = 1\nr_out = 2", "have no [mirror]"),
            (truth(file="gt.csv", columns=["x", "yaw"]), "columns has no y"),
            (truth(file="gt.csv", columns=["x", "y", "x"]), "columns names x twice"),
            (truth(file="gt.csv", columns=["x", "y", "z"]), "layout.ground_truth.columns: unknown columns 'z'"),
            (truth(file="gt.csv", decimal=","), "the same mark"),
            (truth(file="gt.csv", delimiter="xx"), "layout.ground_truth.delimiter"),
            (truth(file="gt.csv", delimiter="e"), "delimiter must be a mark"),
            (truth(file="C:/gt.csv"), "layout.ground_truth.file"),
            (truth(file="gt.csv", length_unit="km"), "layout.ground_truth: unknown length_unit 'km'"),
            (b"\xff\xfe", "not UTF-8"),
        ],
    )
    def test_a_wrong_card_is_the_one_finding(self, tmp_path, own, complaint):
        root = make_innova(tmp_path / "s", files={"innova.toml": own, "ground_truth.csv": "x"})
        (finding,) = check(f"innova:{root}").findings
        assert (finding.severity, finding.code) == ("error", "bad-card")
        assert complaint in finding.message
        with pytest.raises(DatasetError) as caught:
            read_innova(root)
        assert str(caught.value).isprintable()

    def test_of_two_cards_none_is_chosen(self, tmp_path):
        root = make_innova(tmp_path / "s", files={"innova.toml": "", "card.toml": ""})
        assert "keep one" in check(f"innova:{root}").findings[0].message

    def test_a_card_that_cannot_be_read(self, tmp_path):
        root = make_innova(tmp_path / "s")
        (root / "card.toml").mkdir()
        assert "cannot be read" in check(f"innova:{root}").findings[0].message


class TestFaults:
    @pytest.mark.parametrize(
        ("own_card", "files", "expected"),
        [
            ("", {"ground_truth.csv": "0,0,0\n" * 11}, ("error", "rows-differ", "ground_truth.csv")),
            ("", {"ground_truth.csv": "0,0,0\n" * 13}, ("error", "rows-differ", "ground_truth.csv")),
            ("", {"ground_truth.csv": ""}, ("error", "rows-differ", "ground_truth.csv")),
            ("", {"ground_truth.csv": "0,0,0\n" * 11 + "0,0\n"}, ("error", "bad-pose-row", "ground_truth.csv:12")),
            ("", {"ground_truth.csv": "0,0,0\n" * 11 + "0,a,0\n"}, ("error", "bad-pose-row", "ground_truth.csv:12")),
            ("", {"ground_truth.csv": "0,0,0\n" * 11 + "0,1_0,0\n"}, ("error", "bad-pose-row", "ground_truth.csv:12")),
            ("", {"ground_truth.csv": "0,0,0\n" * 11 + "0,,0\n"}, ("error", "bad-pose-row", "ground_truth.csv:12")),
            ("", {"ground_truth.csv": "0,0,0\n" * 11 + "0,nan,0\n"}, ("warning", "bad-pose", "ground_truth.csv:12")),
            ("", {"ground_truth.csv": "0,0,0\n" * 11 + "0,1e8,0\n"}, ("warning", "bad-pose", "ground_truth.csv:12")),
            (
                "",
                {"ground_truth.csv": "0,0,0\n" * 11 + "0,0,90\n"},
                ("warning", "yaw-out-of-range", "ground_truth.csv:12"),
            ),
            ("", {"ground_truth.csv": "0,0,0\n" * 11 + ",,\n"}, ("warning", "image-without-pose", "im12.png")),
            ("", {"ground_truth.csv": b"\xff"}, ("error", "unreadable-poses", "ground_truth.csv")),
            ("", {"ground_truth.csv": '0,0,"0\n'}, ("error", "unreadable-poses", "ground_truth.csv")),
            ("", {"ground_truth.csv": "", "ground_truth.txt": ""}, ("error", "several-poses", "ground_truth.*")),
            (truth(file="gt.csv"), {}, ("error", "missing-poses", "gt.csv")),
            ("[layout]\nimages = '*.bmp'\n", {}, ("error", "empty", ".")),
            ("", {"ground_truth.mat": b"plain text"}, ("error", "unreadable-poses", "ground_truth.mat")),
            ("", {"ground_truth.mat": mat(p=TABLE[:, :2])}, ("error", "bad-pose-row", "ground_truth.mat:1")),
            ("", {"ground_truth.mat": mat(p=TABLE.T)}, ("error", "unreadable-poses", "ground_truth.mat")),
            (
                truth(file="gt.mat", columns=["file", "x", "y"]),
                {"gt.mat": mat(p=TABLE)},
                ("error", "unreadable-poses", "gt.mat"),
            ),
        ],
    )
    def test_each_is_found_where_it_is(self, tmp_path, own_card, files, expected):
        root = make_innova(tmp_path / "s", card=own_card, files=files)
        found = check(f"innova:{root}").findings
        assert expected in [(finding.severity, finding.code, finding.where) for finding in found]

    def test_a_heading_that_the_card_does_not_know_of_says_what_to_do(self, tmp_path):
        root = make_innova(tmp_path / "s", files={"ground_truth.csv": "x,y,yaw\n" + rows("{x},{y},{a}")})
        with pytest.raises(DatasetError, match=r"ground_truth\.csv:1: .*set layout\.ground_truth\.header"):
            read_innova(root)

    def test_names_that_do_not_fit_the_images(self, tmp_path):
        root = make_named(tmp_path / "s")
        with (root / "gt.csv").open("a") as stream:
            stream.write("1,0,0,0,CR,1\n99.png,0,0,0,CR,99\n,0,0,0,CR,99\n")
        (root / "13.png").write_bytes(image_bytes(".png"))
        assert codes(check(f"innova:{root}")) == [
            ("bad-pose-row", "gt.csv:15"),
            ("bad-pose-row", "gt.csv:13"),
            ("missing-image", "99.png"),
            ("image-without-pose", "13.png"),
        ]

    def test_a_name_that_two_images_have_needs_its_path(self, tmp_path):
        own_card = truth(file="gt.csv", columns=["file", "x", "y"])
        root = make_innova(
            tmp_path / "s", card=own_card, images="a/{}.png", files={"gt.csv": "1.png,0,0\na/2.png,1,0\n"}
        )
        (root / "b").mkdir()
        for name in ("1.png", "2.png"):
            (root / "b" / name).write_bytes(image_bytes(".png"))
        found = scan_innova(root)
        assert [(fault.code, fault.where) for fault in errors(found.findings)] == [("ambiguous-image", "gt.csv:1")]
        assert ("warning", "several-folders") in [(remark.severity, remark.code) for remark in found.findings]
        assert [frame.file for frame in found.frames if frame.pose is not None] == ["a/2.png"]

    @pytest.mark.parametrize(("swap", "code"), [("7", "duplicate-time"), ("6.5", "names-not-in-order")])
    def test_times_that_do_not_follow_the_names(self, tmp_path, swap, code):
        root = make_named(tmp_path / "s")
        content = (root / "gt.csv").read_text()
        (root / "gt.csv").write_text(content.replace("8.png,8,0,0,CR,8", f"8.png,8,0,0,CR,{swap}"))
        assert codes(check(f"innova:{root}")) == [(code, "8.png")]

    @pytest.mark.parametrize("time", ["noon", "nan", "1e300"])
    def test_times_that_are_none(self, tmp_path, time):
        root = make_named(tmp_path / "s")
        (root / "gt.csv").write_text((root / "gt.csv").read_text().replace("CR,8\n", f"CR,{time}\n"))
        assert ("bad-pose-row", "gt.csv:8") in codes(check(f"innova:{root}"))

    def test_a_missing_folder(self, tmp_path):
        assert codes(check(f"innova:{tmp_path / 'none'}")) == [("missing-folder", ".")]

    def test_a_ground_truth_that_cannot_be_opened(self, tmp_path):
        root = make_innova(tmp_path / "s", card=truth(file="gt.*"))
        (root / "gt.csv").symlink_to("gt.csv")
        assert ("unreadable-poses", "gt.csv") in codes(check(f"innova:{root}"))

    @pytest.mark.skipif(sys.platform != "linux", reason="only Linux takes any bytes as a file name")
    def test_a_name_that_no_table_can_hold(self, tmp_path):
        root = make_innova(tmp_path / "s")
        (root / os.fsdecode(b"\xff.png")).write_bytes(b"")
        with pytest.raises(DatasetError, match="not valid Unicode"):
            read_innova(root)


TRUTHS = st.builds(
    GroundTruth,
    file=st.sampled_from(["gt.csv", "gt.txt"]),
    columns=st.sampled_from([("x", "y"), ("x", "y", "yaw"), ("file", "x", "y", "-"), ("time", "y", "x", "room")]),
    header=st.booleans(),
    delimiter=st.sampled_from([None, ";", "\t", " "]),
    length_unit=st.sampled_from(["m", "cm"]),
    angle_unit=st.sampled_from(["rad", "deg"]),
)
TEXTS = st.text(alphabet='0123456789.,;-+e \t\r\n"#%_nai\0é', max_size=80)


@given(truth=TRUTHS, content=st.one_of(TEXTS.map(str.encode), st.binary(max_size=80)))
def test_any_content_is_rows_or_findings(truth, content):
    table, faults = scan_table(content, truth.file, truth)
    assert all(fault.severity == "error" and fault.message.isprintable() for fault in faults)
    assert sum(row.capture is None for row in table.rows) == sum(fault.code == "bad-pose-row" for fault in faults)
    assert all(row.file for row in table.rows if row.capture is not None and "file" in (truth.columns or ()))


@given(
    poses=st.lists(st.tuples(*[st.floats(-1e5, 1e5)] * 3), min_size=1, max_size=20),
    decimal=st.sampled_from([".", ","]),
    separator=st.sampled_from([";", "\t", None]),
)
def test_numbers_survive_the_text(poses, decimal, separator):
    lines = ((separator or " ").join(repr(value).replace(".", decimal) for value in pose) for pose in poses)
    truth = GroundTruth(file="gt.txt", delimiter=separator, decimal=decimal)
    table, faults = scan_table("\n".join(lines).encode(), "gt.txt", truth)
    assert faults == []
    read = [row.capture.pose for row in table.rows if row.capture is not None and row.capture.pose is not None]
    assert [(pose.x, pose.y, pose.yaw) for pose in read] == poses
