"""Findings are counted by kind, and those of a source reach every command that opens it."""

from __future__ import annotations

import json

import pytest

from omnieval.datasets import load
from omnieval.datasets.findings import Finding, by_kind, errors, in_order
from omnieval.errors import DatasetError
from tests.datasets.trees import make_folder
from tests.trust.inputs import CommandLine, one_line, refused

LOST = [Finding("warning", "lost", f"{number}.png", "no pose") for number in range(3)]
WRONG = Finding("error", "wrong", ".", "no images")
NOTE = Finding("info", "note", "a", "it is so")

MIRROR = ("cx=8", "cy=6", "r_in=1", "r_out=6", "kind=omnidirectional")
TINY = [argument for setting in MIRROR for argument in ("--set", f"imaging.{setting}")]
SHORT = ["--set", "n_init=10", "--set", "n_new=10"]
COMMANDS = [
    ["replay", "{data}", *TINY, *SHORT, "--no-rrd", "--out", "out"],
    ["describe", "{data}", *TINY, "--out", "d.npz"],
    ["baseline", "{data}", *TINY, "--k", "2", "--out", "out"],
    ["ablate", "{data}", *TINY, *SHORT, "--vary", "gamma=1,2", "--out", "out"],
    ["check", "{data}", *TINY, *SHORT, "--update", "--reference", "r.toml"],
]
TIMES = "file,x,y,time\n" + "".join(f"{n}.png,{n},0,{9 - n % 2}\n" for n in range(8))
"""Of 12 images: four have no pose, and the names contradict the times."""


@pytest.fixture
def command(capfd, tmp_path):
    """The command line in an empty working directory."""
    (tmp_path / "cwd").mkdir()
    return CommandLine(capfd, tmp_path / "cwd")


def test_each_kind_is_a_line_with_a_count_errors_first():
    kinds = by_kind([NOTE, *LOST, WRONG])
    assert [(kind.kind, kind.count, kind.first) for kind in kinds] == [
        ("wrong", 1, "."),
        ("lost", 3, "0.png"),
        ("note", 1, "a"),
    ]
    assert list(map(str, kinds)) == [
        "error: no images [wrong]",
        "warning: 0.png: no pose (and 2 more) [lost]",
        "info: a: it is so [note]",
    ]
    assert errors([NOTE, WRONG]) == (WRONG,)
    assert in_order([NOTE, *LOST, WRONG]) == (WRONG, *LOST, NOTE)


@pytest.mark.parametrize("arguments", COMMANDS, ids=[row[0] for row in COMMANDS])
def test_every_command_says_each_kind_once(arguments, command, tmp_path):
    data = make_folder(tmp_path / "data", [f"{number}.png" for number in range(12)], TIMES)
    outcome = command(*(argument.format(data=data) for argument in arguments))
    assert outcome.code == 0, outcome.err
    said = outcome.err.splitlines()
    assert [line.rpartition("[")[2] for line in said] == [
        "image-without-pose]",
        "names-not-in-order]",
        "duplicate-time]",
    ]
    assert said[0] == "omnieval: warning: 8.png: no pose in poses.csv (and 3 more) [image-without-pose]"


def test_run_json_and_the_check_have_the_same_findings(command, tmp_path):
    data = make_folder(tmp_path / "data", [f"{number}.png" for number in range(12)], TIMES)
    run = json.loads(command("replay", data, *TINY, *SHORT, "--no-rrd", "--json").out)
    report = json.loads(command("dataset", "check", data, *TINY, "--json").out)
    counted = {kind["kind"]: kind["count"] for kind in run["findings"]}
    assert counted == {"image-without-pose": 4, "names-not-in-order": 4, "duplicate-time": 6}
    assert [finding["code"] for finding in report["findings"]] == [
        kind for kind, count in counted.items() for _ in range(count)
    ]
    assert run["findings"][0] == {
        "kind": "image-without-pose",
        "severity": "warning",
        "count": 4,
        "first": "8.png",
        "message": "no pose in poses.csv",
    }


@pytest.mark.parametrize("arguments", COMMANDS, ids=[row[0] for row in COMMANDS])
def test_an_error_stops_every_command(arguments, command, tmp_path):
    data = make_folder(tmp_path / "data", [f"{number}.png" for number in range(12)], "file,x,y\n1.png,0,zero\n")
    outcome = command(*(argument.format(data=data) for argument in arguments))
    if arguments[0] == "check":
        assert outcome.code == 3
        one_line(outcome.err, "y 'zero' is not a number")
    else:
        refused(outcome, 3, "poses.csv:2", "y 'zero' is not a number")


def test_a_sequence_keeps_its_findings_whatever_the_cut(tmp_path):
    data = make_folder(tmp_path / "data", [f"{number}.png" for number in range(12)], TIMES)
    sequence = load(data)
    assert len(sequence.findings) == 14
    assert sequence.cut(start=3, limit=2).findings == sequence.findings


def test_frames_are_in_the_order_of_their_times_and_one_without_stays_behind_its_predecessor(tmp_path):
    table = "file,x,y,time\n1.png,0,0,30\n2.png,0,0,10\n3.png,0,0,\n4.png,0,0,20\n"
    data = make_folder(tmp_path / "data", [f"{number}.png" for number in (1, 2, 3, 4)], table)
    assert [frame.file for frame in load(data).frames] == ["2.png", "3.png", "4.png", "1.png"]


def test_the_refusal_counts_the_errors_and_no_warnings(tmp_path):
    data = make_folder(tmp_path / "data", ["1.png", "2.png"], "file,x,y\n1.png,0,zero\n2.png,nan,0\n")
    with pytest.raises(DatasetError, match=r"^[^(]*poses.csv:2: y 'zero' is not a number[^(]*$"):
        load(data)
