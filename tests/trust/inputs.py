"""What the tests of bad input share: the command line run in this process, and sequences to spoil."""

from __future__ import annotations

import contextlib
import os
import shutil
from dataclasses import dataclass
from pathlib import Path

import pytest

from omnieval.cli import main

SMALL = ("--set", "n_init=10", "--set", "n_new=10", "--set", "gamma=1", "--set", "omega=3.5", "--set", "merge_y=0.5")
"""Parameters for the `panoramas` of ``conftest.py``."""


@dataclass(frozen=True)
class Outcome:
    """What a command came to: its exit code and all that was written to the two streams, by whatever library."""

    code: int
    out: str
    err: str


@dataclass(frozen=True)
class CommandLine:
    """The real command line without the cost of a new interpreter; `capfd` sees what C libraries print, too."""

    capfd: pytest.CaptureFixture[str]
    cwd: Path

    def __call__(self, *arguments: object) -> Outcome:
        code = 0
        self.capfd.readouterr()
        with contextlib.chdir(self.cwd):
            try:
                main([str(argument) for argument in arguments])
            except SystemExit as stop:
                code = int(stop.code or 0)
        out, err = self.capfd.readouterr()
        return Outcome(code, out, err)


def refused(outcome: Outcome, code: int, *words: str) -> None:
    """The one way to refuse: nothing on stdout, one line on stderr with these words, and the documented code."""
    assert outcome.code == code, outcome.err
    assert outcome.out == ""
    one_line(outcome.err, *words)


def one_line(err: str, *words: str) -> None:
    """One line of omnieval's own on stderr, and nothing of a library's, which says all of `words`."""
    assert len(err.splitlines()) == 1, err
    assert err.startswith("omnieval: ")
    assert [word for word in words if word not in err] == [], err


def listing(folder: Path) -> dict[str, tuple[int, int]]:
    """Return size and time of change of all below a folder."""
    found = {}
    for directory, folders, files in os.walk(folder):
        for name in (*folders, *files):
            status = (Path(directory) / name).lstat()
            found[str((Path(directory) / name).relative_to(folder))] = (status.st_size, status.st_mtime_ns)
    return found


def copied(folder: Path, to: Path) -> Path:
    """A copy of a sequence, to be spoilt."""
    return Path(shutil.copytree(folder, to, symlinks=True))


def half(path: Path) -> None:
    """Cut a file to half its bytes."""
    data = path.read_bytes()
    path.write_bytes(data[: len(data) // 2])


def flip(path: Path, position: int | None = None) -> None:
    """Turn over all bits of one byte, the middle one by default."""
    data = bytearray(path.read_bytes())
    data[len(data) // 2 if position is None else position] ^= 0xFF
    path.write_bytes(data)
