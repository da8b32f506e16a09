"""A run or ablation that is killed at any moment leaves true, readable results, and is made whole again."""

import signal
from collections import Counter

import polars as pl
import pytest

from omnieval.results.content import content_hash
from omnieval.results.run_folder import open_run
from tests.cli.test_cli import in_process
from tests.faults.commands import (
    GRID,
    OFTEN,
    REPLAY,
    begun,
    kill_after,
    load,
    one_ahead,
    parts,
    prefix_of,
    span,
    status,
    steps_recorded,
    table_hash,
    whole,
)

pytestmark = pytest.mark.faults

REPLAYS, ABLATIONS = 8, 4
MORE = 5
"""Times as many, at most, until one was killed in the middle: how fast a command is may change from one to the next."""


def test_replays_killed_at_any_moment(panoramas, replayed, tmp_path, capsys):
    arguments = ("replay", panoramas, *REPLAY, "--out")
    outcomes: Counter[str] = Counter()
    seconds = span(tmp_path, *arguments, "alone", prepare=OFTEN)
    folders = [tmp_path / f"run{number}" for number in range(REPLAYS * MORE)]
    processes = one_ahead(load(tmp_path, *arguments, folder, prepare=OFTEN) for folder in folders)
    for folder, part, process in zip(folders, parts(REPLAYS, seed=1), processes, strict=False):
        code, took = kill_after(part * seconds, process)
        assert code in {0, -signal.SIGKILL}
        if code == 0:
            seconds = took
        outcomes[_check_killed(folder, replayed, tmp_path)] += 1
        again = in_process(*arguments, folder, "--overwrite", "--no-rrd", cwd=tmp_path)
        assert again.returncode == 0, again.stderr
        assert open_run(folder).content_hash == replayed.content_hash
        assert {path.name for path in folder.rglob("*")} == {path.name for path in replayed.folder.iterdir()} - {
            "replay.rrd"
        }
        if outcomes.total() >= REPLAYS and outcomes["interrupted"]:
            break
    with capsys.disabled():
        print(f"\nreplays killed within {seconds:.1f} s: {dict(outcomes)}; all equal when replayed again")
    assert outcomes["interrupted"] > 0


def _check_killed(folder, reference, cwd):
    """Check what a killed replay left, and say in a word what it was."""
    if not begun(folder):
        assert not folder.exists() or whole(folder) == []
        return "nothing yet"
    whole(folder)
    run = open_run(folder)
    assert run.status in {"interrupted", "complete"}
    steps = prefix_of(folder, reference)
    if run.status == "complete":
        assert run.content_hash == reference.content_hash
    if steps_recorded(folder / "replay.rrd") or steps_recorded(folder / "replay.partial.rrd"):
        return run.status
    if steps:
        assert in_process("render", folder, "--no-images", cwd=cwd).returncode == 0
        assert steps_recorded(folder / "replay.rrd") == steps
        return f"{run.status}, recording rebuilt"
    return f"{run.status} before the first steps were written"


def test_ablations_killed_at_any_moment(panoramas, ablated, tmp_path, capsys):
    outcomes: Counter[str] = Counter()
    arguments = ("ablate", panoramas, *GRID, "--keep-steps")
    jobs = {tmp_path / f"out{number}": 2 if number % 3 == 2 else 1 for number in range(ABLATIONS * MORE)}
    seconds = {count: span(tmp_path, *arguments, "--jobs", count, "--out", f"alone{count}") for count in (1, 2)}
    processes = one_ahead(load(tmp_path, *arguments, "--jobs", jobs[folder], "--out", folder) for folder in jobs)
    for folder, part, process in zip(jobs, parts(ABLATIONS, seed=2), processes, strict=False):
        code, took = kill_after(part * seconds[jobs[folder]], process)
        assert code in {0, -signal.SIGKILL}
        if code == 0:
            seconds[jobs[folder]] = took
        outcomes[_check_killed_ablation(folder)] += 1
        resumed = in_process(*arguments, "--out", folder, "--resume", cwd=tmp_path)
        assert resumed.returncode == 0, resumed.stderr
        assert table_hash(folder) == table_hash(ablated)
        assert status(folder, "ablation") == "complete"
        assert not list(folder.rglob("*.tmp"))
        assert not (folder / "descriptors").exists()
        for trace in sorted((ablated / "steps").iterdir()):
            ours = pl.read_parquet(folder / "steps" / trace.name)
            assert content_hash(ours) == content_hash(pl.read_parquet(trace))
        if outcomes.total() >= ABLATIONS and _interrupted(outcomes):
            break
    with capsys.disabled():
        print(f"\nablations killed within {seconds} s: {dict(outcomes)}; all equal when resumed")
    assert _interrupted(outcomes)


def _interrupted(outcomes):
    return any(outcome.startswith("interrupted") for outcome in outcomes)


def _check_killed_ablation(folder):
    if not begun(folder):
        assert not folder.exists() or whole(folder) == []
        return "nothing yet"
    files = whole(folder)
    rows = sum(name.startswith("parts/") for name in files)
    state = status(folder, "ablation")
    assert state in {"interrupted", "complete"}
    assert state == "interrupted" or "ablation.parquet" in files
    return f"{state} with {rows} rows"
