"""Bad parameters and options, through the real command line; the rows come from the configuration itself."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest
from pydantic.fields import FieldInfo

from omnieval.config import parameters
from tests.trust.inputs import CommandLine, refused

PARAMETERS = parameters()


@pytest.fixture
def command(capfd, tmp_path):
    (tmp_path / "cwd").mkdir()
    return CommandLine(capfd, tmp_path / "cwd")


def _kinds(field: FieldInfo) -> set[Any]:
    return set(get_args(field.annotation) or (field.annotation,)) - {type(None)}


def _bounds(field: FieldInfo) -> dict[str, float]:
    """Return the bounds of a parameter by their names (ge, gt, le, lt)."""
    names = ("ge", "gt", "le", "lt")
    return {name: getattr(rule, name) for rule in field.metadata for name in names if hasattr(rule, name)}


def _wrong_values(field: FieldInfo) -> Iterator[str]:
    """Yield, as text, what a parameter must refuse: the wrong type, no number, beyond each end of its range."""
    yield from ("", "nonsense", "[1]", "nan")
    if _kinds(field) <= {int, float}:
        yield from ("inf", "-inf", "1,5", "0x1F", "true", "1e999", "9" * 5000)
    if _kinds(field) == {int}:
        yield "20.5"
    bounds = _bounds(field)
    if "ge" in bounds:
        yield str(bounds["ge"] - 1)
    if "gt" in bounds:
        yield from (str(bounds["gt"]), str(bounds["gt"] - 1))
    if "le" in bounds:
        yield str(bounds["le"] + 1)


def _wrong_toml(field: FieldInfo) -> Iterator[str]:
    """Yield values that TOML can hold and a parameter cannot be."""
    yield from ("[]", "[1]", "true", "2020-01-01", "''", "inf", "-nan")
    if _kinds(field) <= {int, float}:
        yield "'many'"
    else:
        yield "1"


@pytest.mark.parametrize("name", PARAMETERS)
def test_no_parameter_takes_what_it_cannot_be(name, command, tmp_path):
    for value in _wrong_values(PARAMETERS[name]):
        outcome = command("replay", "--set", f"{name}={value}")
        refused(outcome, 2, name, f"--set {name}={value}"[:60])
        assert any(word in outcome.err for word in ("expected", "known are", "did you mean")), outcome.err
    assert list((tmp_path / "cwd").iterdir()) == []


@pytest.mark.parametrize("name", PARAMETERS)
def test_no_parameter_takes_from_a_file_what_it_cannot_be(name, command, tmp_path):
    file = tmp_path / "mine.toml"
    for value in _wrong_toml(PARAMETERS[name]):
        file.write_text(f"{name} = {value}\n")
        refused(command("replay", "--config", file), 2, name, str(file))
    assert list((tmp_path / "cwd").iterdir()) == []


@pytest.mark.parametrize("name", PARAMETERS)
def test_every_misspelt_parameter_is_told_the_nearest(name, command):
    wrong = name[:-1] + ("x" if not name.endswith("x") else "q")
    if wrong not in PARAMETERS:
        refused(command("replay", "--set", f"{wrong}=1"), 2, f"unknown parameter '{wrong}'", "did you mean", "--set")


SPELLINGS = [
    # the file                          what the message must say
    ("omgea = 2",                       ["'omgea'", "did you mean omega?"]),
    ("[mapper]\nomgea = 2",             ["'mapper.omgea'", "did you mean omega?"]),
    ("[hog]\nbinz = 8",                 ["'hog.binz'", "did you mean hog.bins?"]),
    ("[hgo]\nbins = 8",                 ["'hgo.bins'", "did you mean hog.bins?"]),
    ("[imaging.mirror]\ncx = 8",        ["'imaging.mirror.cx'", "did you mean imaging."]),
    ("[hog.bins]\ncount = 8",           ["'hog.bins.count'", "did you mean hog.bins?"]),
    ("hog = 8",                         ["'hog'", "omnieval parameters lists them"]),
    ("OMEGA = 2",                       ["'OMEGA'", "did you mean omega?"]),
    ('"" = 2',                          ["''", "omnieval parameters lists them"]),
    ('"a\\nb" = 2',                     ["'a\\nb'", "omnieval parameters lists them"]),
    ("omega = 2\nomega = 3",            ["cannot read configuration", "valid TOML"]),
    ("omega = ",                        ["cannot read configuration", "valid TOML"]),
    ("omega = " + "[" * 5000,           ["cannot read configuration"]),
    ("omega = " + "9" * 5000,           ["cannot read configuration"]),
    ("a." * 3000 + "a = 1",             ["cannot read configuration"]),
    ("omega = 1979-02-30",              ["cannot read configuration"]),
]  # fmt: skip


@pytest.mark.parametrize(("content", "words"), SPELLINGS, ids=[row[0][:24] for row in SPELLINGS])
def test_a_wrong_file_is_refused(content, words, command, tmp_path):
    (tmp_path / "mine.toml").write_text(content)
    refused(command("replay", "--config", tmp_path / "mine.toml"), 2, str(tmp_path / "mine.toml"), *words)
    assert list((tmp_path / "cwd").iterdir()) == []


@pytest.mark.parametrize("verb", ["describe", "baseline", "map", "ablate"])
def test_a_wrong_file_is_refused_wherever_files_are_read(verb, command, panoramas, tmp_path):
    (tmp_path / "mine.toml").write_text("[hog]\nbinz = 8")
    arguments = {"describe": ["--out", "d.npz"], "ablate": ["--vary", "gamma=1,2"]}.get(verb, [])
    outcome = command(verb, panoramas, *arguments, "--config", tmp_path / "mine.toml")
    refused(outcome, 2, "'hog.binz'", "did you mean hog.bins?", str(tmp_path / "mine.toml"))
    assert list((tmp_path / "cwd").iterdir()) == []


FILES = [
    # what it is          how to make it
    ("not there",         lambda path: None),
    ("a folder",          Path.mkdir),
    ("no text",           lambda path: path.write_bytes(b"\xff\xfe\x80")),
    ("a link to itself",  lambda path: path.symlink_to(path)),
]  # fmt: skip


@pytest.mark.parametrize("make", [row[1] for row in FILES], ids=[row[0] for row in FILES])
def test_a_file_of_parameters_that_cannot_be_read_is_refused(make, command, tmp_path):
    make(tmp_path / "mine.toml")
    refused(command("replay", "--config", tmp_path / "mine.toml"), 2, "cannot read configuration", "mine.toml")


OPTIONS = [
    # arguments                                        what the message must say
    (["replay", "--limit", "0"],                       ["--limit", "1"]),
    (["replay", "--limit", "many"],                    ["--limit", "integer"]),
    (["replay", "--stride", "0"],                      ["--stride", "1"]),
    (["replay", "--start", "-1"],                      ["--start", "0"]),
    (["replay", "--every", "0"],                       ["--every", "1"]),
    (["replay", "--limit"],                            ["--limit", "requires an argument"]),
    (["replay", "--descriptor", "sift"],               ["unknown descriptor 'sift'", "known are hog, gist"]),
    (["replay", "--preset", "recomended"],             ["unknown preset", "did you mean recommended?"]),
    (["replay", "a", "b"],                             ["unexpected extra argument"]),
    (["replay", "--skip-bda"],                         ["--skip-bda", "--skip-bad"]),
    (["describe"],                                     ["--out"]),
    (["map"],                                          ["FILE.npz"]),
    (["dataset", "chek"],                              ["chek"]),
    (["ablate", "{data}", "--vary", "omega=2,3", "--jobs", "0"], ["--jobs", "1 or more"]),
    (["baseline", "{data}", "--k", "0"],               ["numbers of clusters", "1 or more"]),
]  # fmt: skip


@pytest.mark.parametrize(("arguments", "words"), OPTIONS, ids=[" ".join(row[0]) for row in OPTIONS])
def test_an_option_that_is_none_is_refused(arguments, words, command, panoramas, tmp_path):
    refused(command(*(argument.format(data=panoramas) for argument in arguments)), 2, *words)
    assert list((tmp_path / "cwd").iterdir()) == []


def _edges(field: FieldInfo) -> list[str]:
    """Return the outermost values a parameter takes, or all its choices."""
    if not _kinds(field) <= {int, float}:
        return sorted(_kinds(field)) if str not in _kinds(field) else ["hog", "gist"]
    whole = _kinds(field) == {int}
    bounds = _bounds(field)
    least = bounds.get("ge", bounds.get("gt", -1e300) if whole else bounds.get("gt", -1e300) + 5e-324)
    return [str(least), str(bounds.get("le", 1e300))]


@pytest.mark.parametrize("name", [name for name in PARAMETERS if "." not in name])
def test_the_mapper_runs_at_the_edges_of_every_range_or_refuses_them(name, command, tmp_path):
    rng = np.random.default_rng(3)
    place = np.repeat(rng.normal(size=(4, 12)), 12, axis=0)
    position = (place + 0.1 * rng.normal(size=place.shape)).astype(np.float32)
    orientation = rng.random((len(position), 8, 4), np.float32)
    np.savez(tmp_path / "d.npz", position=position, orientation=orientation)
    for number, value in enumerate(_edges(PARAMETERS[name])):
        arguments = ["--set", "n_init=10", "--set", "n_new=10", "--set", f"{name}={value}", "--out", f"run{number}"]
        outcome = command("map", tmp_path / "d.npz", *arguments)
        if outcome.code == 2:
            refused(outcome, 2, "n_init = 100000", "lower n_init")
        else:
            assert (outcome.code, outcome.err) == (0, "")


_OF_MIRRORS = ("imaging.cx", "imaging.cy", "imaging.r_in", "imaging.r_out")
_OTHERWISE = ("imaging.kind", "imaging.belt", "imaging.mask")
"""Parameters that the images decide about, tested where they are."""


@pytest.mark.parametrize("name", [name for name in PARAMETERS if "." in name and name not in _OTHERWISE])
def test_descriptors_and_imaging_run_at_the_edges_of_every_range_or_refuse_them(name, command, panoramas, tmp_path):
    descriptor = "gist" if name.startswith("gist.") else "hog"
    mirror = {"cx": 128, "cy": 32, "r_in": 4, "r_out": 30}
    told = [f"imaging.{part}={value}" for part, value in mirror.items()] if name in _OF_MIRRORS else []
    kind = [word for one in told for word in ("--set", one)]
    for number, value in enumerate(_edges(PARAMETERS[name])):
        arguments = ["--limit", "1", "--descriptor", descriptor, *kind, "--set", f"{name}={value}"]
        outcome = command("describe", panoramas, *arguments, "--out", f"{number}.npz")
        if outcome.code == 2:
            refused(outcome, 2, {"cells": "set imaging.", "width": f"lower {name}"}.get(name.rpartition("_")[2], name))
            assert not (tmp_path / "cwd" / f"{number}.npz").exists()
        else:
            assert (outcome.code, outcome.err) == (0, ""), value
