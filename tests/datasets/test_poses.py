"""poses.csv: columns in any order, every fault by its line."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from omnieval.datasets import Pose
from omnieval.datasets.poses import Capture, scan_table
from omnieval.datasets.sequence import wrapped


def parse_poses(text):
    """The captures by file; there must be no fault."""
    captures, faults = scan_poses(text)
    assert faults == []
    return captures


def scan_poses(text):
    table, faults = scan_table(text.encode(), "poses.csv")
    return {row.file: row.capture for row in table.rows if row.capture is not None}, faults


def test_a_row_says_where_when_and_in_which_room():
    captures = parse_poses("file,x,y,yaw,room,time\na.png,1,-2.5,0.5,kitchen,12.25\n")
    assert captures == {"a.png": Capture(2, Pose(1.0, -2.5, 0.5), "kitchen", 12_250_000_000)}


def test_columns_may_stand_in_any_order_and_be_padded():
    captures = parse_poses("time, yaw ,FILE,y,x\n1, 0.5 , a.png ,2,1\n")
    assert captures["a.png"] == Capture(2, Pose(1.0, 2.0, 0.5), None, 1_000_000_000)


def test_no_digit_of_an_epoch_time_is_lost():
    captures = parse_poses("file,x,y,yaw,time\na.png,0,0,0,1152904768.652404123\n")
    assert captures["a.png"].time_ns == 1152904768652404123


def test_blank_cells_are_unknown():
    captures = parse_poses("file,x,y,yaw,room,time\na.png,,,,,\n")
    assert captures["a.png"] == Capture(2, None, None, None)


def test_blank_lines_are_skipped_and_quotes_understood():
    captures = parse_poses('file,x,y,yaw\n\n"a, b.png",0,0,0\n')
    assert list(captures) == ["a, b.png"]


def test_two_spellings_of_an_accent_are_one_file():
    assert list(parse_poses("file,x,y,yaw\ncafe\u0301.png,0,0,0\n")) == ["caf\u00e9.png"]


@pytest.mark.parametrize(
    ("header", "complaint"),
    [
        ("file,x,y,yaw,rooom", "unknown column 'rooom'; did you mean room?"),
        ("file,x,y,yaw,x", "column x appears twice"),
        ("file,x,yaw", "no column y"),
        ("file;x;y;yaw", "semicolons"),
        ("", "no column file"),
    ],
)
def test_a_wrong_header_is_explained(header, complaint):
    captures, (fault,) = scan_poses(f"{header}\na.png,0,0,0\n" if header else "")
    assert (captures, fault.where) == ({}, "poses.csv:1")
    assert complaint in fault.message


@pytest.mark.parametrize(
    ("row", "complaint"),
    [
        ("a.png,1,5,2,5,0,1", "are there decimal commas?"),
        ('a.png,"1,5",2,0,1', "write a decimal point, not a comma"),
        ('a.png,1,2,0,"1,5"', "write a decimal point, not a comma"),
        ("a.png,1,2", "3 fields for the columns file, x, y, yaw, time"),
        ("a.png,one,2,0,1", "x 'one' is not a number"),
        ("a.png,1_0,2,0,1", "x '1_0' is not a number"),
        ("a.png,1,,0,1", "y is blank"),
        (",1,2,0,1", "no file name"),
        ("a.png,1,2,0,nan", "out of range"),
        ("a.png,1,2,0,1e999999", "out of range"),
        ("a.png,1,2,0,soon", "time 'soon' is not a number"),
    ],
)
def test_a_wrong_row_is_explained_by_its_line(row, complaint):
    captures, faults = scan_poses(f"file,x,y,yaw,time\ngood.png,0,0,0,0\n{row}\n")
    assert list(captures) == ["good.png"]
    (fault,) = faults
    assert (fault.code, fault.where) == ("bad-pose-row", "poses.csv:3")
    assert complaint in fault.message


def test_text_that_is_not_delimited_cannot_be_read():
    _, (fault,) = scan_poses('file,x,y,yaw\na.png,"1"2,2,0\n')
    assert (fault.code, fault.where) == ("unreadable-poses", "poses.csv")
    assert "line 2 is not delimited text" in fault.message


def test_every_wrong_row_is_found():
    _, faults = scan_poses("file,x,y,yaw\na,b,c,d\ne,0,0,0\nf,g,h,i\n")
    assert [fault.where for fault in faults] == ["poses.csv:2", "poses.csv:4"]


@given(st.one_of(st.text(), st.text().map("file,x,y,yaw,time\n{}".format)))
def test_any_text_is_captures_or_findings(text):
    table, faults = scan_table(text.encode("utf-8", "surrogatepass"), "poses.csv")
    assert all(fault.message.isprintable() for fault in faults)
    assert sum(row.capture is None for row in table.rows) <= len(faults)
    assert all(row.file and row.capture.line >= 2 for row in table.rows if row.capture is not None)


NAMES = st.from_regex(r"\A[a-zA-Z0-9_-]{1,12}\.png\Z")
NUMBERS = st.floats(allow_nan=False, allow_infinity=False)


@given(st.dictionaries(NAMES, st.tuples(NUMBERS, NUMBERS, NUMBERS, st.integers(0, 2**63 - 10**9))))
def test_parsing_undoes_formatting(rows):
    lines = [
        f"{name},{x!r},{y!r},{yaw!r},{time // 10**9}.{time % 10**9:09d}" for name, (x, y, yaw, time) in rows.items()
    ]
    captures = parse_poses("\n".join(["file,x,y,yaw,time", *lines]))
    parsed = {name: (c.pose.x, c.pose.y, c.pose.yaw, c.time_ns) for name, c in captures.items() if c.pose}
    assert parsed == rows


@given(NUMBERS)
def test_wrapping_keeps_the_direction(yaw):
    turned = wrapped(yaw)
    assert -math.pi < turned <= math.pi
    assert math.cos(turned) == pytest.approx(math.cos(math.remainder(yaw, math.tau)))


@pytest.mark.parametrize(
    ("yaw", "expected"), [(0.5, 0.5), (math.pi, math.pi), (-math.pi, math.pi), (1.5 * math.pi, -0.5 * math.pi)]
)
def test_wrapping_ends_at_pi(yaw, expected):
    assert wrapped(yaw) == pytest.approx(expected)
