"""Damaged or foreign files of omnieval's own kinds, through the real command line: refused, or computed again."""

from __future__ import annotations

import io
import json
import os
import pickle
import shutil
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from omnieval.descriptors.segments import ENDINGS
from omnieval.results.run_folder import open_run
from tests.trust.inputs import SMALL, CommandLine, flip, half, listing, one_line, refused


@pytest.fixture
def command(capfd, tmp_path):
    (tmp_path / "cwd").mkdir()
    return CommandLine(capfd, tmp_path / "cwd")


@pytest.fixture(scope="module")
def sound(panoramas, tmp_path_factory):
    """A complete run, to be copied and spoilt."""
    import omnieval

    settings = {name: float(value) for name, value in (pair.split("=") for pair in SMALL[1::2])}
    settings |= {name: int(settings[name]) for name in ("n_init", "n_new")}
    folder = tmp_path_factory.mktemp("sound") / "run"
    omnieval.replay(panoramas, config=omnieval.configure(settings), out=folder)
    return folder


def _manifest(**changed: Any) -> Callable[[Path], object]:
    def change(folder: Path) -> None:
        path = folder / "run.json"
        path.write_text(json.dumps(json.loads(path.read_text()) | changed))

    return change


RUN, REPLAY = "run it again", "replay the sequence again"
RUNS = [
    # what is wrong             how to spoil it                                           what the message must say
    ("a newer schema",          _manifest(schema_version=99),                             ["schema version 99", RUN]),
    ("no schema",               _manifest(schema_version=None),                           ["schema version None", RUN]),
    ("another kind",            _manifest(kind="partition"),                              ["a partition", "name the"]),
    ("no run.json",             lambda run: (run / "run.json").unlink(),                  ["not a run folder"]),
    ("half a run.json",         lambda run: half(run / "run.json"),                       ["run.json", RUN]),
    ("an empty run.json",       lambda run: (run / "run.json").write_bytes(b""),          ["run.json", RUN]),
    ("a run.json of a list",    lambda run: (run / "run.json").write_text("[1]"),         ["schema version None", RUN]),
    ("half a table",            lambda run: half(run / "steps.parquet"),                  ["steps.parquet", REPLAY]),
    ("an empty table",          lambda run: (run / "steps.parquet").write_bytes(b""),     ["steps.parquet", REPLAY]),
    ("a table of text",         lambda run: (run / "steps.parquet").write_text("x" * 99), ["steps.parquet", REPLAY]),
    ("a flipped byte",          lambda run: flip(run / "steps.parquet"),                  ["steps.parquet", "damaged"]),
]  # fmt: skip


@pytest.mark.parametrize(("spoil", "words"), [row[1:] for row in RUNS], ids=[row[0] for row in RUNS])
@pytest.mark.parametrize("verb", ["render", "diff"])
def test_a_spoilt_run_is_refused_by_its_file(verb, spoil, words, command, sound, tmp_path):
    run = Path(shutil.copytree(sound, tmp_path / "run"))
    spoil(run)
    before = listing(tmp_path)
    refused(command(verb, run, *([sound] if verb == "diff" else [])), 2, str(run), *words)
    assert {name for name in listing(tmp_path) if "rrd" not in name} == {name for name in before if "rrd" not in name}


def test_a_damaged_recording_is_no_loss(command, sound, tmp_path):
    run = Path(shutil.copytree(sound, tmp_path / "run"))
    (run / "replay.rrd").write_bytes(b"RRF2 and then nothing")
    assert command("diff", run, sound).code == 0
    outcome = command("render", run, "--no-images")
    assert (outcome.code, outcome.err) == (0, "")
    assert (run / "replay.rrd").stat().st_size > 10_000


def _flipped(path: Path) -> None:
    """Turn over a byte every 500; what a file begins with stays, so that it is still read."""
    data = bytearray(path.read_bytes())
    for position in range(100, len(data), 500):
        data[position] ^= 0xFF
    path.write_bytes(data)


def _folder(path: Path) -> None:
    path.unlink()
    path.mkdir()


CACHES = [
    # what is wrong          how to spoil a file of it
    ("flipped bytes",        _flipped),
    ("half its bytes",       half),
    ("no bytes",             lambda path: path.write_bytes(b"")),
    ("another kind of file", lambda path: path.write_bytes(b"no descriptions" * 999)),
    ("a folder",             _folder),
]  # fmt: skip


@pytest.mark.parametrize("spoil", [row[1] for row in CACHES], ids=[row[0] for row in CACHES])
def test_a_damaged_cache_never_changes_a_result(spoil, command, sound, panoramas, tmp_path, monkeypatch):
    monkeypatch.setenv("OMNIEVAL_CACHE", str(tmp_path / "cache"))
    assert command("replay", panoramas, *SMALL, "--no-rrd", "--out", "cold").code == 0
    kept = [path for path in (tmp_path / "cache").rglob("*") if path.suffix in ENDINGS]
    assert {path.suffix for path in kept} == set(ENDINGS)
    for path in kept:
        spoil(path)
    outcome = command("replay", panoramas, *SMALL, "--no-rrd", "--out", "again")
    assert outcome.code == 0
    if outcome.err:
        one_line(outcome.err, "descriptor cache")
    again, expected = open_run(tmp_path / "cwd" / "again"), open_run(sound)
    assert again.manifest["identity"] == expected.manifest["identity"]
    assert again.steps.drop("milliseconds").equals(expected.steps.drop("milliseconds"))


N = 24


def _arrays(**changed: Any) -> dict[str, Any]:
    """The arrays of a sound archive, some of them changed, those that are None left out."""
    rng = np.random.default_rng(0)
    arrays: dict[str, Any] = {
        "position": rng.normal(size=(N, 6)).astype(np.float32),
        "orientation": rng.random((N, 8, 4)).astype(np.float32),
        "file": np.array([f"{number}.png" for number in range(N)]),
        "xy": rng.normal(size=(N, 2)),
        "yaw": rng.normal(size=N),
        "room": np.array(["R"] * N),
        "time_ns": np.arange(N, dtype=np.int64),
    }
    return {name: array for name, array in (arrays | changed).items() if array is not None}


def _with(value: float, shape: tuple[int, ...], image: int = 7) -> Any:
    array = np.ones(shape, np.float32)
    array[image] = value
    return array


ARCHIVES = [
    # what is wrong, the arrays, what the message must say
    ("no position", _arrays(position=None), ["no array 'position'", "orientation"]),
    ("no orientation", _arrays(orientation=None), ["no array 'orientation'", "position"]),
    ("position of one axis", _arrays(position=np.ones(N, np.float32)), ["'position'", "shape (n, n)", "(24,)"]),
    ("position of three axes", _arrays(position=np.ones((N, 2, 2), np.float32)), ["'position'", "shape (n, n)"]),
    ("no image", _arrays(position=np.ones((0, 6), np.float32)), ["'position'", "no axis of 0"]),
    ("no dimension", _arrays(position=np.ones((N, 0), np.float32)), ["'position'", "no axis of 0"]),
    ("fewer orientations", _arrays(orientation=np.ones((N - 1, 8, 4), np.float32)), ["'orientation'", "(24, n, n)"]),
    ("orientation of two axes", _arrays(orientation=np.ones((N, 8), np.float32)), ["'orientation'", "(24, n, n)"]),
    ("fewer names", _arrays(file=np.array(["a"])), ["'file'", "(24)"]),
    ("poses of three columns", _arrays(xy=np.ones((N, 3))), ["'xy'", "(24, 2)"]),
    ("whole numbers", _arrays(position=np.ones((N, 6), np.int64)), ["'position'", "int64", "floating point"]),
    ("complex numbers", _arrays(position=np.ones((N, 6), np.complex128)), ["'position'", "complex128"]),
    ("text for numbers", _arrays(xy=np.full((N, 2), "1.0")), ["'xy'", "<U3"]),
    ("numbers for names", _arrays(file=np.arange(N)), ["'file'", "int64", "text"]),
    ("times in seconds", _arrays(time_ns=np.linspace(0, 1, N)), ["'time_ns'", "float64", "whole numbers"]),
    ("NaN", _arrays(position=_with(np.nan, (N, 6))), ["'position'", "NaN or infinite", "image 7"]),
    ("infinite", _arrays(orientation=_with(-np.inf, (N, 8, 4))), ["'orientation'", "NaN or infinite", "image 7"]),
    ("beyond single precision", _arrays(position=np.full((N, 6), 1e300)), ["'position'", "NaN or infinite"]),
    ("half a letter", _arrays(file=np.array(["\ud800"] * N)), ["'file'", "not valid Unicode", "image 0", "rename"]),
    ("objects", _arrays(position=np.array([{}] * N, dtype=object)), ["cannot read descriptors", ".npz"]),
]  # fmt: skip


@pytest.mark.parametrize(("arrays", "words"), [row[1:] for row in ARCHIVES], ids=[row[0] for row in ARCHIVES])
@pytest.mark.parametrize("verb", ["map", "baseline"])
def test_an_archive_with_a_wrong_array_is_refused_by_its_name(verb, arrays, words, command, tmp_path):
    _write(tmp_path / "d.npz", arrays)
    refused(command(verb, tmp_path / "d.npz"), 3, str(tmp_path / "d.npz"), *words)
    assert list((tmp_path / "cwd").iterdir()) == []


def _write(path: Path, arrays: dict[str, Any]) -> None:
    with zipfile.ZipFile(path, "w") as archive:
        for name, array in arrays.items():
            archive.writestr(f"{name}.npy", _npy(array))


def _npy(array: Any) -> bytes:
    stream = io.BytesIO()
    np.lib.format.write_array(stream, array, allow_pickle=True)
    return stream.getvalue()


class _Trap:
    """Says so in a file when it is unpickled."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> tuple[Any, ...]:
        return Path.touch, (self.path,)


def _bare_pickle(path: Path, trap: Path) -> None:
    path.write_bytes(pickle.dumps(_Trap(trap)))


def _bare_array(path: Path, trap: Path) -> None:
    path.write_bytes(_npy(np.array([_Trap(trap)], dtype=object)))


def _pickle_inside(path: Path, trap: Path) -> None:
    _write(path, _arrays(room=np.array([_Trap(trap)], dtype=object)))


def _pickle_as_member(path: Path, trap: Path) -> None:
    _write(path, _arrays())
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr("more.npy", pickle.dumps(_Trap(trap)))
        archive.writestr("plain", pickle.dumps(_Trap(trap)))


@pytest.mark.parametrize("craft", [_bare_pickle, _bare_array, _pickle_inside, _pickle_as_member])
def test_nothing_in_an_archive_is_executed(craft, command, tmp_path):
    craft(tmp_path / "d.npz", tmp_path / "executed")
    outcome = command("map", tmp_path / "d.npz", "--set", "n_init=10", "--set", "n_new=10")
    assert not (tmp_path / "executed").exists()
    if craft is not _pickle_as_member:
        refused(outcome, 3, str(tmp_path / "d.npz"), "expected a .npz archive")


def _half_an_archive(path: Path) -> None:
    _write(path, _arrays())
    half(path)


FILES = [
    # what it is            how to make it
    ("not there",           lambda path: None),
    ("a folder",            Path.mkdir),
    ("a pipe",              os.mkfifo),
    ("no bytes",            lambda path: path.write_bytes(b"")),
    ("text",                lambda path: path.write_text("position")),
    ("a lone array",        lambda path: path.write_bytes(_npy(np.ones((20, 3))))),
    ("half its bytes",      _half_an_archive),
    ("a zip of nothing",    lambda path: _write(path, {})),
]  # fmt: skip


@pytest.mark.parametrize("make", [row[1] for row in FILES], ids=[row[0] for row in FILES])
def test_a_file_that_is_no_archive_is_refused(make, command, tmp_path):
    make(tmp_path / "d.npz")
    refused(command("map", tmp_path / "d.npz"), 3, str(tmp_path / "d.npz"), ";")
    assert list((tmp_path / "cwd").iterdir()) == []


def test_a_monstrous_header_is_refused_before_memory_is_asked_for(command, tmp_path):
    header = b"{'descr': '<f4', 'fortran_order': False, 'shape': (999999999999, 999999), }"
    header += b" " * (117 - len(header)) + b"\n"
    with zipfile.ZipFile(tmp_path / "d.npz", "w") as archive:
        for name in ("position.npy", "orientation.npy"):
            archive.writestr(name, b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header)
    refused(command("map", tmp_path / "d.npz"), 3, "d.npz", "expected a .npz archive")


def test_names_and_rooms_of_an_archive_are_text_whatever_they_say(command, tmp_path):
    names = np.array([f"../../{number}\x1b[31m\n" for number in range(N)])
    _write(tmp_path / "d.npz", _arrays(file=names, room=names))
    outcome = command("map", tmp_path / "d.npz", "--set", "n_init=10", "--set", "n_new=10", "--out", "run")
    assert (outcome.code, outcome.err) == (0, "")
    assert open_run(tmp_path / "cwd" / "run").steps["file"].to_list() == names.tolist()
    assert "\x1b" not in outcome.out
    assert [path.name for path in (tmp_path / "cwd").iterdir()] == ["run"]
