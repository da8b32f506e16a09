"""Bad images, through the real command line: refused before step 1, found by the check, left out with --skip-bad."""

from __future__ import annotations

import csv
import json
import os
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import polars.selectors as cs
import pytest

from omnieval.datasets.check import check
from omnieval.results.run_folder import open_run
from tests.cli.test_cli import omnieval
from tests.datasets.trees import make_folder
from tests.trust.inputs import SMALL, CommandLine, copied, flip, half, listing, one_line, refused


@pytest.fixture
def command(capfd, tmp_path):
    """The command line in an empty working directory; the data lie elsewhere below `tmp_path`."""
    (tmp_path / "cwd").mkdir()
    return CommandLine(capfd, tmp_path / "cwd")


def _zero_bytes(path: Path) -> None:
    path.write_bytes(b"")


def _no_image_at_all(path: Path) -> None:
    path.write_text("this is text\n" * 100)


def _another_size(path: Path) -> None:
    cv2.imwrite(str(path), np.zeros((32, 128), np.uint8))


def _a_folder(path: Path) -> None:
    path.unlink()
    path.mkdir()


def _a_pipe(path: Path) -> None:
    path.unlink()
    os.mkfifo(path)


def _a_dead_link(path: Path) -> None:
    path.unlink()
    path.symlink_to(path.parent / "gone.png")


def _a_link_to_itself(path: Path) -> None:
    path.unlink()
    path.symlink_to(path)


IMAGES = [
    # what it is            how to spoil it    the finding's code   what the message must say
    ("zero bytes",          _zero_bytes,       "empty-image",       "has no bytes"),
    ("half its bytes",      half,              "truncated-image",   "ends early"),
    ("a flipped byte",      flip,              "damaged-image",     "a checksum is wrong"),
    ("no image",            _no_image_at_all,  "not-an-image",      "is not an image"),
    ("another size",        _another_size,     "wrong-size",        "is 128 x 32 pixels, most are 256 x 64"),
    ("a folder",            _a_folder,         "unreadable-image",  "cannot be read: Is a directory"),
    ("a pipe",              _a_pipe,           "unreadable-image",  "is not a file"),
    ("a dead link",         _a_dead_link,      "unreadable-image",  "cannot be read: No such file"),
    ("a link to itself",    _a_link_to_itself, "unreadable-image",  "cannot be read: Too many levels"),
]  # fmt: skip
spoilt = pytest.mark.parametrize(
    ("spoil", "code", "words"), [row[1:] for row in IMAGES], ids=[row[0] for row in IMAGES]
)


@spoilt
@pytest.mark.parametrize("verb", ["replay", "describe", "baseline"])
def test_a_bad_image_in_the_middle_is_refused_before_step_1(verb, spoil, code, words, command, panoramas, tmp_path):
    data = copied(panoramas, tmp_path / "data")
    spoil(data / "image41.png")
    before = listing(tmp_path)
    arguments = [*SMALL, "--out", "d.npz" if verb == "describe" else "run"]
    outcome = command(verb, data, *arguments)
    refused(outcome, 3, f"{data}/image41.png", words, f"omnieval dataset check folder:{data}", "--skip-bad")
    assert listing(tmp_path) == before


@spoilt
def test_the_check_finds_a_bad_image_by_its_name(spoil, code, words, command, panoramas, tmp_path):
    data = copied(panoramas, tmp_path / "data")
    spoil(data / "image41.png")
    outcome = command("dataset", "check", data)
    assert outcome.code == 3
    finding = next(line for line in outcome.out.splitlines() if line.startswith("error: "))
    assert finding.startswith("error: image41.png: ")
    assert words in finding
    assert finding.endswith(f"[{code}]")
    one_line(outcome.err, "1 error(s)")


@spoilt
def test_skip_bad_goes_on_without_it_and_counts_it(spoil, code, words, command, panoramas, tmp_path):
    data = copied(panoramas, tmp_path / "data")
    spoil(data / "image41.png")
    outcome = command("replay", data, *SMALL, "--no-rrd", "--skip-bad", "--out", "run")
    assert outcome.code == 0
    one_line(outcome.err, "1 of 80 images left out: image41.png", words)
    assert "image41.png" in next(line for line in outcome.out.splitlines() if "skipped" in line)
    run = open_run(tmp_path / "cwd" / "run")
    assert run.manifest["frames"] == 79
    assert [bad["file"] for bad in run.manifest["skipped"]] == ["image41.png"]
    assert words in run.manifest["skipped"][0]["reason"]
    assert run.steps["file"].to_list() == [f"image{number}.png" for number in range(80) if number != 41]


def test_a_bad_image_is_refused_however_warm_the_cache(command, panoramas, tmp_path):
    data = copied(panoramas, tmp_path / "data")
    assert command("replay", data, *SMALL, "--no-rrd", "--out", "sound").code == 0
    half(data / "image79.png")
    refused(command("replay", data, *SMALL, "--no-rrd", "--out", "bad"), 3, "image79.png", "ends early")
    assert not (tmp_path / "cwd" / "bad").exists()


def test_several_bad_images_are_counted_and_the_first_few_named(command, panoramas, tmp_path):
    data = copied(panoramas, tmp_path / "data")
    for number in (3, 5, 8, 13, 21):
        _zero_bytes(data / f"image{number}.png")
    refused(command("replay", data), 3, "image3.png has no bytes", "(and 4 more bad images)")
    archive = command("describe", data, "--skip-bad", "--out", "d.npz", "--json")
    assert archive.code == 0
    one_line(archive.err, "5 of 80 images left out: image3.png", "image5.png", "image8.png", "and 2 more")
    assert [bad["file"] for bad in json.loads(archive.out)["skipped"]] == [f"image{n}.png" for n in (3, 5, 8, 13, 21)]
    assert json.loads(archive.out)["position"][0] == 75


def test_a_sequence_without_its_bad_images_is_another_one(command, panoramas, tmp_path):
    data = copied(panoramas, tmp_path / "data")
    arguments = ("replay", data, *SMALL, "--no-rrd", "--skip-bad", "--out")
    assert command(*arguments, "whole").code == 0
    half(data / "image41.png")
    assert command(*arguments, "without").code == 0
    (data / "image41.png").unlink()
    assert command(*arguments, "removed").code == 0
    whole, without, removed = (open_run(tmp_path / "cwd" / name) for name in ("whole", "without", "removed"))
    for name in ("dataset_fingerprint", "identity"):
        assert whole.manifest[name] != without.manifest[name]
        assert without.manifest[name] == removed.manifest[name]
    assert whole.manifest["skipped"] == []
    assert without.steps.drop("milliseconds").equals(removed.steps.drop("milliseconds"))


def test_the_first_image_is_no_measure_when_it_is_the_odd_one(command, panoramas, tmp_path):
    data = copied(panoramas, tmp_path / "data")
    _another_size(data / "image0.png")
    refused(command("replay", data, *SMALL), 3, "image0.png", "is 128 x 32 pixels, most are 256 x 64")
    outcome = command("replay", data, *SMALL, "--no-rrd", "--skip-bad")
    assert outcome.code == 0
    one_line(outcome.err, "1 of 80 images left out: image0.png")


def test_when_all_images_are_bad_there_is_nothing_to_go_on_with(command, tmp_path):
    data = make_folder(tmp_path / "data", [f"{number}.png" for number in range(12)])
    for image in data.iterdir():
        _zero_bytes(image)
    refused(command("replay", data, "--skip-bad"), 3, str(data), "all 12 images are bad", "omnieval dataset check")


def test_a_recording_is_rendered_again_without_the_bad_images(command, panoramas, tmp_path):
    data = copied(panoramas, tmp_path / "data")
    half(data / "image2.png")
    assert command("replay", data, *SMALL, "--no-rrd", "--skip-bad", "--out", "run").code == 0
    outcome = command("render", "run", "--no-images")
    assert (outcome.code, outcome.err) == (0, "")
    assert (tmp_path / "cwd" / "run" / "replay.rrd").stat().st_size > 0


PICTURES: list[tuple[str, Callable[[int], np.ndarray]]] = [
    ("all black", lambda number: np.zeros((64, 256), np.uint8)),
    ("all white", lambda number: np.full((64, 256), 255, np.uint8)),
    ("constant, each another", lambda number: np.full((64, 256), 5 * number, np.uint8)),
    ("one and the same noise", lambda number: np.random.default_rng(0).integers(0, 256, (64, 256), np.uint8)),
]


@pytest.mark.parametrize("draw", [row[1] for row in PICTURES], ids=[row[0] for row in PICTURES])
@pytest.mark.parametrize("descriptor", ["hog", "gist"])
def test_images_that_show_nothing_are_replayed(draw, descriptor, command, tmp_path):
    data = tmp_path / "data"
    data.mkdir()
    for number in range(40):
        cv2.imwrite(str(data / f"{number}.png"), draw(number))
    arguments = ["--descriptor", descriptor, *SMALL, "--out", "run"]
    outcome = command("replay", data, *arguments)
    assert outcome.code == 0
    if draw(0).std() == 0:
        one_line(outcome.err, "0.png: shows nothing", "(and 39 more) [no-contrast]")
    run = open_run(tmp_path / "cwd" / "run")
    assert (run.status, len(run.steps)) == ("complete", 40)
    assert all(value is None or np.isfinite(value) for value in run.steps["prominence"])


def test_black_omnidirectional_images_show_no_mirror_and_are_refused_saying_how_to_tell(command, tmp_path):
    data = tmp_path / "data"
    data.mkdir()
    for number in range(20):
        cv2.imwrite(str(data / f"{number}.png"), np.zeros((48, 64), np.uint8))
    refused(
        command("replay", data, "--no-rrd"), 3, "nothing moves in the images", "--preview", "imaging.cx", "--camera"
    )
    told = [f"imaging.{name}={value}" for name, value in (("cx", 32), ("cy", 24), ("r_in", 5), ("r_out", 22))]
    outcome = command("replay", data, "--no-rrd", "--json", *(word for one in told for word in ("--set", one)))
    assert outcome.code == 0
    one_line(outcome.err, "shows nothing", "[no-contrast]")
    assert json.loads(outcome.out)["camera"]["origin"] == "configuration"


def test_two_identical_images_are_at_distance_0_and_the_map_is_sound(command, panoramas, tmp_path):
    data = copied(panoramas, tmp_path / "data")
    for number in (6, 30, 55):
        (data / f"image{number}.png").write_bytes((data / "image5.png").read_bytes())
    outcome = command("replay", data, *SMALL, "--out", "run")
    assert (outcome.code, outcome.err) == (0, "")
    steps = open_run(tmp_path / "cwd" / "run").steps
    for column in steps.select(cs.float()).iter_columns():
        assert not column.is_nan().any()


@pytest.mark.parametrize("descriptor", ["hog", "gist"])
def test_fewer_images_than_the_first_node_needs(descriptor, command, panoramas):
    outcome = command("replay", panoramas, "--limit", "19", "--descriptor", descriptor)
    refused(outcome, 2, "n_init = 20", "only 19", "lower n_init")


def test_permission_is_said(command, panoramas, tmp_path):
    if os.geteuid() == 0:
        pytest.skip("root may read everything")
    data = copied(panoramas, tmp_path / "data")
    (data / "image9.png").chmod(0)
    refused(command("replay", data), 3, "image9.png", "Permission denied")


PROGRAM = [
    # arguments                                           code  what the one line on stderr must say
    (["replay", "{data}"],                                3,    ["image41.png", "checksum", "omnieval dataset check"]),
    (["replay", "{data}", "--set", "omgea=2"],            2,    ["--set omgea=2", "did you mean omega?"]),
    (["replay", "{data}", "--skip-bad", "--limit", "42"], 0,    ["1 of 42 images left out: image41.png is damaged"]),
]  # fmt: skip


@pytest.mark.parametrize(("arguments", "code", "words"), PROGRAM, ids=[" ".join(row[0]) for row in PROGRAM])
def test_the_program_itself_says_one_line_and_ends_with_its_code(arguments, code, words, panoramas, tmp_path):
    data = copied(panoramas, tmp_path / "data")
    flip(data / "image41.png")
    given = [argument.format(data=data) for argument in arguments]
    result = omnieval(*given, cwd=tmp_path)
    assert result.returncode == code
    one_line(result.stderr, *(word.format(data=data) for word in words))
    assert bool(result.stdout) == (code == 0)


def test_the_copy_used_here_is_sound(panoramas):
    """Or the refusals above would prove nothing."""
    assert check(panoramas).ok
    with (panoramas / "poses.csv").open() as stream:
        assert len(list(csv.reader(stream))) == 81
