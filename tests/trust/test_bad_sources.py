"""Bad sequences, through the real command line: refused in one line before anything is written, or put up with."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from omnieval.results.run_folder import open_run
from tests.datasets.trees import cold_names, make_cold, make_folder
from tests.trust.inputs import SMALL, CommandLine, copied, listing, one_line, refused

MIRROR = ("cx=8", "cy=6", "r_in=1", "r_out=6")
CAMERA = [argument for setting in (*MIRROR, "kind=omnidirectional") for argument in ("--set", f"imaging.{setting}")]
"""What the tiny images of `make_cold` and `make_folder` do not show themselves."""
TINY = [*CAMERA, "--set", "n_init=10", "--set", "n_new=10"]
"""The same and a first node of 10 images."""


@pytest.fixture
def command(capfd, tmp_path):
    """The command line in an empty working directory; the data lie elsewhere below `tmp_path`."""
    (tmp_path / "cwd").mkdir()
    return CommandLine(capfd, tmp_path / "cwd")


def _nothing(root: Path) -> None:
    del root


def _a_file(root: Path) -> None:
    root.write_text("no folder")


def _a_loop(root: Path) -> None:
    root.symlink_to(root)


def _no_image(root: Path) -> None:
    root.mkdir()
    (root / "readme.txt").write_text("nothing here")


ROOTS = [
    # what it is       how to make it     what the message must say
    ("missing",        _nothing,          ["no such folder", "check the path"]),
    ("a file",         _a_file,           ["not a folder", "name the folder"]),
    ("empty",          Path.mkdir,        [";"]),
    ("without images", _no_image,         [";"]),
    ("a link to itself", _a_loop,         ["no such folder", "check the path"]),
]  # fmt: skip


@pytest.mark.parametrize("scheme", ["cold:", "folder:", "innova:", ""])
@pytest.mark.parametrize(("make", "words"), [row[1:] for row in ROOTS], ids=[row[0] for row in ROOTS])
@pytest.mark.parametrize("verb", ["replay", "describe", "baseline", "ablate"])
def test_a_root_that_holds_no_sequence_is_refused(verb, make, words, scheme, command, tmp_path):
    make(tmp_path / "root")
    before = listing(tmp_path)
    arguments = {"describe": ["--out", "d.npz"], "ablate": ["--vary", "omega=2,3", "--out", "a"]}.get(verb, [])
    refused(command(verb, f"{scheme}{tmp_path}/root", *arguments), 3, f"{tmp_path}/root", *words)
    assert listing(tmp_path) == before


@pytest.mark.parametrize("make", [row[1] for row in ROOTS], ids=[row[0] for row in ROOTS])
def test_a_root_that_holds_no_sequence_is_a_finding_of_the_check(make, command, tmp_path):
    make(tmp_path / "root")
    outcome = command("dataset", "check", f"cold:{tmp_path}/root")
    assert outcome.code == 3
    assert "not ok" in outcome.out
    one_line(outcome.err, f"{tmp_path}/root", "1 error(s)", "correct or remove")


NAMES = [
    # what is wrong             the name of the image
    ("no yaw",                  "t1152904769.000000_x0.000000_y0.000000.jpeg"),
    ("no time",                 "x0.000000_y0.000000_a0.000000.jpeg"),
    ("an empty field",          "t1152904769.000000_x_y0.000000_a0.000000.jpeg"),
    ("a word for a number",     "t1152904769.000000_xleft_y0.000000_a0.000000.jpeg"),
    ("nan",                     "t1152904769.000000_xnan_y0.000000_a0.000000.jpeg"),
    ("infinite",                "t1152904769.000000_xinf_y0.000000_a0.000000.jpeg"),
    ("decimal commas",          "t1152904769,000000_x0,000000_y0,000000_a0,000000.jpeg"),
    ("an exponent",             "t1152904769.000000_x1e3_y0.000000_a0.000000.jpeg"),
    ("digits of another script", "t1152904769.000000_x٠.٠٠٠٠٠٠_y0.000000_a0.000000.jpeg"),
    ("a time beyond 64 bits",   "t99999999999.000000_x0.000000_y0.000000_a0.000000.jpeg"),
    ("a line break",            "t1152904769.000000_x0.000000\n_y0.000000_a0.000000.jpeg"),
    ("an upper-case ending",    "t1152904769.000000_x0.000000_y0.000000_a0.000000.JPEG"),
]  # fmt: skip


@pytest.mark.parametrize("name", [row[1] for row in NAMES], ids=[row[0] for row in NAMES])
def test_a_cold_name_that_is_none_is_refused(name, command, tmp_path):
    root = make_cold(tmp_path / "seq", [*cold_names(4), name], label=None)
    before = listing(tmp_path)
    shown = name.replace("\n", "\\n")
    refused(command("replay", f"cold:{root}"), 3, f"{root}/omni_cam/{shown}", "expected")
    assert command("dataset", "check", f"cold:{root}").code == 3
    assert listing(tmp_path) == before


def _poses(rows: int = 12, **changed: str) -> str:
    """A poses.csv of `rows` rows, some of them (``r5="..."``) changed."""
    lines = [changed.get(f"r{number}", f"{number}.png,{number / 10},0,0,R,{number}") for number in range(rows)]
    return "\n".join(["file,x,y,yaw,room,time", *lines, ""])


TABLES = [
    # what is wrong         poses.csv                            code, words of check and replay
    ("a blank y",            _poses(r5="5.png,1,,0,R,5"),         3, ["poses.csv:7", "y is blank"]),
    ("a word for a number",  _poses(r5="5.png,1,two,0,R,5"),      3, ["poses.csv:7", "not a number"]),
    ("decimal commas",       _poses(r5="5.png,1,5,2,5,0,0,R,5"),  3, ["poses.csv:7", "commas"]),
    ("no column y",          "file,x,yaw\n0.png,0,0\n",           3, ["poses.csv:1", "no column y"]),
    ("an image twice",       _poses(r5="4.png,1,0,0,R,5"),        3, ["poses.csv:7", "keep one"]),
    ("a row without image",  _poses(r5="gone.png,1,0,0,R,5"),     0, ["gone.png", "not there"]),
    ("an image without row", _poses(rows=11),                     0, ["11.png", "no pose"]),
    ("a pose of nan",        _poses(r5="5.png,nan,0,0,R,5"),      0, ["poses.csv:7", "not finite"]),
    ("a pose beyond any building", _poses(r5="5.png,1e300,0,0,R,5"), 0, ["poses.csv:7", "not a position in metres"]),
    ("an infinite pose",     _poses(r5="5.png,0,-inf,0,R,5"),     0, ["poses.csv:7", "not finite"]),
    ("a time twice",         _poses(r5="5.png,1,0,0,R,4"),        0, ["5.png", "same time"]),
    ("a backward time",      _poses(r5="5.png,1,0,0,R,1"),        0, ["5.png", "taken before it"]),
    ("nothing",              "",                                  3, ["poses.csv", "no rows"]),
]  # fmt: skip


@pytest.mark.parametrize(("poses", "code", "words"), [row[1:] for row in TABLES], ids=[row[0] for row in TABLES])
def test_a_table_of_poses_with_a_fault(poses, code, words, command, tmp_path):
    """A table that cannot be understood is refused; what is odd about one is said, by the check and by the replay."""
    data = make_folder(tmp_path / "data", [f"{number}.png" for number in range(12)], poses)
    report = command("dataset", "check", data, *CAMERA)
    assert report.code == code
    assert any(all(word in line for word in words) for line in report.out.splitlines()), report.out
    outcome = command("replay", data, *TINY, "--out", "run")
    if code:
        refused(outcome, code, *words)
        assert list((tmp_path / "cwd").iterdir()) == []
    else:
        assert outcome.code == 0
        said = outcome.err.splitlines()
        assert all(line.startswith("omnieval: warning: ") for line in said)
        assert any(all(word in line for word in words) for line in said), outcome.err
        manifest = json.loads((tmp_path / "cwd" / "run" / "run.json").read_text())
        assert manifest["metrics"]["silhouette"] is None
        assert manifest["null_reasons"]["silhouette"]


LABELS = [
    # what is wrong             places.lst of the images `names`            code, words of check and replay
    ("a label without image",   lambda names: [*names, "gone.jpeg"],        0, ["gone.jpeg", "not there"]),
    ("an image without label",  lambda names: names[:-1],                   0, ["not named in"]),
    ("an image labelled twice", lambda names: [*names, f"{names[0]} PA-A"], 3, ["places.lst:13", "keep one"]),
    ("a line that is not a label", lambda names: [*names, "what is this"],     3, ["places.lst:13", "correct or"]),
]  # fmt: skip


@pytest.mark.parametrize(("lines", "code", "words"), [row[1:] for row in LABELS], ids=[row[0] for row in LABELS])
def test_labels_and_images_at_odds(lines, code, words, command, tmp_path):
    names = cold_names(12)
    root = make_cold(tmp_path / "seq", names)
    labels = [line if " " in line else f"{line} CR-A" for line in lines(names)]
    (root / "localization" / "places.lst").write_text("\n".join(labels))
    report = command("dataset", "check", root, *CAMERA)
    assert report.code == code
    assert any(all(word in line for word in words) for line in report.out.splitlines()), report.out
    outcome = command("replay", root, *TINY, "--no-rrd", "--out", "run")
    if code:
        refused(outcome, code, *words)
        assert list((tmp_path / "cwd").iterdir()) == []
    else:
        assert outcome.code == 0
        one_line(outcome.err, "warning", *words)


def test_labels_that_are_no_text_are_refused(command, tmp_path):
    root = make_cold(tmp_path / "seq", cold_names(4))
    (root / "localization" / "places.lst").write_bytes(b"\xff\xfe\x80")
    refused(command("replay", root), 3, "localization/places.lst", "not UTF-8 text")


def test_two_images_of_one_time_are_said_and_replayed(command, tmp_path):
    names = cold_names(12)
    names[5] = names[4].replace("_y0.000000", "_y1.000000")
    root = make_cold(tmp_path / "seq", names)
    report = command("dataset", "check", root, *CAMERA)
    assert report.code == 0
    assert "[duplicate-time]" in report.out
    outcome = command("replay", root, *TINY, "--no-rrd")
    assert outcome.code == 0
    one_line(outcome.err, names[5], "taken at the same time as", "[duplicate-time]")


def test_without_poses_and_rooms_every_metric_over_them_is_null_with_a_reason(command, panoramas, tmp_path):
    data = copied(panoramas, tmp_path / "data")
    (data / "poses.csv").unlink()
    outcome = command("replay", data, *SMALL, "--no-rrd", "--json")
    assert (outcome.code, outcome.err) == (0, "")
    manifest = json.loads(outcome.out)
    null = {name for name, value in manifest["metrics"].items() if value is None}
    assert null >= {name for name in manifest["metrics"] if name.startswith(("silhouette", "rooms"))}
    assert set(manifest["null_reasons"]) == null


FOLDERS = [
    # what it is         the folder below tmp_path                        the run folder
    ("spaces",           "my  house seq 1",                               "my-house-seq-1-hog"),
    ("umlauts",          "Häuser/Straße Ω",                               "Straße-Ω-hog"),
    ("another script",   "家",                                            "家-hog"),
    ("an emoji",         "\N{HOUSE BUILDING}",                            "sequence-hog"),
    ("a long name",      "n" * 200,                                       f"{'n' * 49}...{'n' * 44}-hog"),
    ("a long path",      "/".join(["p" * 100] * 12),                      f"{'p' * 49}...{'p' * 44}-hog"),
    ("a colon",          "folder:x",                                      "folder-x-hog"),
    ("a leading dash",   "-rf",                                           "rf-hog"),
    ("a leading dot",    "...",                                           "sequence-hog"),
    ("mark-up",          "[red]x[bold]",                                  "red-x-bold-hog"),
    ("a line break",     "a\nb",                                          "a-b-hog"),
    ("an escape",        "\x1b[31mred",                                   "31mred-hog"),
]  # fmt: skip


@pytest.mark.parametrize(("name", "run"), [row[1:] for row in FOLDERS], ids=[row[0] for row in FOLDERS])
def test_whatever_a_folder_is_called_the_run_stays_in_its_place(name, run, command, tmp_path):
    root = tmp_path / "data" / name
    make_folder(root, [f"{number}.png" for number in range(12)])
    outcome = command("replay", f"folder:{root}", *TINY, "--no-rrd")
    assert (outcome.code, outcome.err) == (0, "")
    assert [path.name for path in (tmp_path / "cwd").iterdir()] == ["runs"]
    assert [path.name[: len(run)] for path in (tmp_path / "cwd" / "runs").iterdir()] == [run]
    assert "\x1b" not in outcome.out


@pytest.mark.parametrize("scheme", ["cold:", "folder:", "innova:", "", "any:"])
@pytest.mark.parametrize("length", [300, 5000])
def test_a_path_longer_than_any_is_not_there(scheme, length, command, tmp_path):
    refused(command("replay", f"{scheme}{'n' * length}"), 3, "unknown source" if scheme == "any:" else "no such folder")
    assert list((tmp_path / "cwd").iterdir()) == []


OUTS = [
    # what it is             --out                       the message
    ("a folder",             "taken",                    "exists; choose another --out"),
    ("a file",               "taken/file.npz",           "exists; choose another --out or pass --overwrite"),
    ("in no folder",         "none/d.npz",               "there is no folder none; make it"),
    ("in a file",            "taken/file.npz/d.npz",     "there is no folder taken/file.npz; make it"),
    ("longer than any name", "n" * 300,                  "File name too long; choose another --out"),
]  # fmt: skip


@pytest.mark.parametrize(("out", "words"), [row[1:] for row in OUTS], ids=[row[0] for row in OUTS])
def test_an_archive_that_cannot_be_written_is_refused_before_the_work(out, words, command, panoramas, tmp_path):
    (tmp_path / "cwd" / "taken").mkdir()
    (tmp_path / "cwd" / "taken" / "file.npz").write_text("mine")
    before = listing(tmp_path)
    refused(command("describe", panoramas, "--out", out), 2, out, words)
    assert listing(tmp_path) == before


@pytest.mark.parametrize(
    "arguments",
    [
        ["replay", "{data}", *TINY, "--no-rrd", "--out"],
        ["ablate", "{data}", *TINY, "--vary", "gamma=1,2", "--resume", "--out"],
        ["baseline", "{data}", "--k", "2", "--out"],
        ["report", "{run}", "--out"],
        ["compare", "{run}"],
    ],
    ids=lambda arguments: arguments[0],
)
def test_a_folder_of_an_impossible_name_is_said_to_be_one(arguments, command, panoramas, tmp_path):
    run = tmp_path / "a"
    assert command("replay", panoramas, *TINY, "--limit", 12, "--no-rrd", "--out", run).code == 0
    given = [argument.format(data=panoramas, run=run) for argument in arguments]
    refused(command(*given, "n" * 300), 2, "File name too long")


def test_a_crafted_data_card_cannot_name_files_elsewhere(command, tmp_path):
    data = make_folder(tmp_path / "data", ["1.png"])
    (data / "innova.toml").write_text('[layout]\nimages = "../*"\n')
    refused(command("replay", f"innova:{data}"), 3, "innova.toml", "layout.images", "within the sequence folder")


def test_images_of_any_suffix_and_case_and_name_are_replayed(command, tmp_path):
    names = ["1.PNG", "2.Jpg", "3.JPEG", "4.bmp", "5 é.png", "6 é.png", "7[x].png", "8'\".png", "9#?.png"]
    names += ["10 " + "n" * 200 + ".png", "11家.png", "12\n.png"]
    data = make_folder(tmp_path / "data", names)
    outcome = command("replay", f"folder:{data}", *TINY, "--no-rrd", "--out", "run")
    assert outcome.code == 0
    one_line(outcome.err, "2.Jpg: is JPEG, colour, most are PNG, colour", "[mixed-kinds]")
    assert open_run(tmp_path / "cwd" / "run").steps["file"].to_list() == names


def test_links_that_lead_in_a_circle_are_not_followed(command, tmp_path):
    data = make_folder(tmp_path / "data", [f"{number}.png" for number in range(12)])
    (data / "again").symlink_to(data)
    (data / "innova.toml").write_text('title = "x"\n')
    outcome = command("replay", f"innova:{data}", *TINY, "--no-rrd", "--out", "run")
    assert (outcome.code, outcome.err) == (0, "")
    assert len(open_run(tmp_path / "cwd" / "run").steps) == 12
