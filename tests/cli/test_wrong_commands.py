"""A command line that is nearly right is told what it was meant to be; the home folder is found everywhere."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

import omnieval
from omnieval.cli.home import with_home
from omnieval.datasets.cachedir import cache_dir
from tests.datasets.trees import make_folder
from tests.trust.inputs import SMALL, CommandLine, refused


@pytest.fixture
def command(capfd, tmp_path):
    """The command line in an empty working directory."""
    (tmp_path / "cwd").mkdir()
    return CommandLine(capfd, tmp_path / "cwd")


@pytest.fixture
def home(tmp_path, monkeypatch):
    """A home folder of its own."""
    folder = tmp_path / "home"
    folder.mkdir()
    monkeypatch.setenv("HOME", str(folder))
    return folder


@pytest.fixture
def run(tmp_path):
    """The files that tell a run folder."""
    folder = tmp_path / "run"
    folder.mkdir()
    (folder / "run.json").write_text("{}")
    (folder / "replay.rrd").touch()
    return folder


WRONG = [
    # arguments                                          code  what the message must say
    (["replay", "{data}", "--omega", "1.85"],            2, ["--omega", "parameter", "--set omega=1.85"]),
    (["replay", "{data}", "--merge-y=0.75"],             2, ["--set merge_y=0.75"]),
    (["ablate", "{data}", "--gamma"],                    2, ["--set gamma=VALUE"]),
    (["replay", "{data}", "--set", "omega=1,85"],        2, ["omega: expected a number with a decimal point"]),
    (["replay", "{data}", "--set", "n_new=ten"],         2, ["n_new: expected a whole number, got 'ten'"]),
    (["explain", "{run}/replay.rrd", "3"],               2, ["it is a file; name the folder, {run}"]),
    (["compare", "{run}/run.json"],                      2, ["it is a file; name the folder, {run}"]),
    (["replay", "{run}"],                                3, ["a folder of results", "`omnieval view {run}`"]),
    (["replay", "tour.mp4"],                             3, ["tour.mp4", "no such file"]),
    (["replay", "cold-freiburg"],                        3, ["a data card", "`omnieval dataset info cold-freiburg`"]),
    (["ablate", "cold:/data/*/seq*", "--vary", "omega=2,3"], 3, ["a shell expands * only in a path without a scheme"]),
    (["map", "{data}"],                                  3, ["a folder", "`omnieval replay {data}` maps images"]),
]  # fmt: skip


@pytest.mark.parametrize(("arguments", "code", "words"), WRONG, ids=[" ".join(row[0][:3]) for row in WRONG])
def test_a_wrong_command_names_the_right_one(arguments, code, words, command, panoramas, run):
    known = {"data": panoramas, "run": run}
    outcome = command(*(argument.format(**known) for argument in arguments))
    refused(outcome, code, *(word.format(**known) for word in words))


@pytest.mark.parametrize(
    ("given", "meant"),
    [
        ("~/x", "{home}/x"),
        ("--out=~/x", "{home}/x"),
        ("--cache-to=~", "{home}"),
        ("--set=weights=~/x", None),
        ("a~b", None),
        ("~nobody-of-this-name/x", None),
        ("cold:~/x", None),  # which the reader fills in
    ],
)
def test_the_home_folder_is_filled_in_where_a_path_begins(given, meant, home):
    expected = given if meant is None else given.partition("~")[0] + meant.format(home=home)
    assert with_home(given) == expected


def test_the_home_folder_is_found_by_every_command(home, command, panoramas):
    shutil.copytree(panoramas, home / "images")
    replayed = command("replay", "folder:~/images", *SMALL, "--no-rrd", "--out=~/run")
    assert replayed.code == 0, replayed.err
    assert (home / "run" / "run.json").is_file()
    assert command("describe", "~/images", "--out=~/d.npz").code == 0
    assert command("map", "~/d.npz", "--mapper=leader", "--out", "~/mapped").code == 0
    assert command("check", "~/run", "--update", "--reference=~/r.toml").code == 0
    assert command("check", "~/run", "--reference=~/r.toml", "--junit=~/j.xml").code == 0
    assert {path.name for path in home.iterdir()} >= {"images", "run", "d.npz", "mapped", "r.toml", "j.xml"}
    assert list(command.cwd.iterdir()) == []


def test_the_home_folder_is_found_from_python_and_in_the_environment(home, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("OMNIEVAL_CACHE", "~/cache")
    assert cache_dir() == home / "cache"
    make_folder(home / "images", ["1.png"])
    assert omnieval.load("~/images").root == home / "images"
    with pytest.raises(omnieval.errors.RegressionError, match=f"there is no reference {home}/r.toml"):
        omnieval.check("~/r.toml")
    assert not Path("~").exists()
