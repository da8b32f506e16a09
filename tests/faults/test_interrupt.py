"""Ctrl-C: 130 at once, nobody left behind, what was computed kept and marked."""

import os
import signal
import time

import pytest

from tests.faults.commands import (
    GRID,
    OFTEN,
    REPLAY,
    begun,
    end,
    group_ends,
    one_line,
    prefix_of,
    start,
    status,
    wait_for,
    whole,
)

pytestmark = pytest.mark.faults

SECONDS = 2.0
"""What is promised, on a machine that has a core for us."""


def interrupt(process, *, group):
    """Press Ctrl-C: a terminal signals the whole group, ``kill -INT`` one process. Return what was said."""
    began = time.monotonic()
    (os.killpg if group else os.kill)(process.pid, signal.SIGINT)
    code, out, err = end(process)
    seconds = time.monotonic() - began
    assert code == 130, err
    assert out == ""
    assert "interrupted" in one_line(err)
    assert seconds < SECONDS * max(1.0, os.getloadavg()[0] / (os.cpu_count() or 1))
    group_ends(process)
    return seconds


def parts(folder, least):
    return lambda: len(list((folder / "parts").glob("[!.]*"))) >= least


@pytest.mark.parametrize(("least", "group"), [(1, False), (6, True)])
def test_an_interrupted_replay(panoramas, replayed, tmp_path, least, group, capsys):
    folder = tmp_path / "run"
    process = start(tmp_path, "replay", panoramas, *REPLAY, "--out", folder, prepare=OFTEN)
    wait_for(parts(folder, least) if least else lambda: begun(folder), process)
    seconds = interrupt(process, group=group)
    whole(folder)
    assert status(folder, "replay") == "interrupted"
    steps = prefix_of(folder, replayed)
    assert steps >= 5 * least
    with capsys.disabled():
        print(f"\nreplay interrupted: {steps} steps kept, {seconds:.2f} s")


@pytest.mark.parametrize(("jobs", "least", "group"), [(1, 2, False), (2, 0, True), (2, 1, True)])
def test_an_interrupted_ablation(panoramas, ablated, tmp_path, jobs, least, group, capsys):
    folder = tmp_path / "out"
    process = start(tmp_path, "ablate", panoramas, *GRID, "--jobs", jobs, "--out", folder)
    wait_for(parts(folder, least) if least else lambda: begun(folder), process)
    seconds = interrupt(process, group=group)
    rows = sum(name.startswith("parts/") for name in whole(folder))
    assert status(folder, "ablation") == "interrupted"
    assert rows >= least
    with capsys.disabled():
        print(f"\nablate --jobs {jobs} interrupted: {rows} rows kept, {seconds:.2f} s")
