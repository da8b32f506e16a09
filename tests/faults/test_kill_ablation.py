"""An ablation that is killed at any moment leaves true, readable results, and is made whole again."""

import signal
from collections import Counter

import polars as pl
import pytest

from omnieval.results.content import content_hash
from tests.cli.test_cli import in_process
from tests.faults.commands import (
    GRID,
    MORE,
    begun,
    kill_after,
    load,
    one_ahead,
    parts,
    span,
    status,
    table_hash,
    whole,
)

pytestmark = pytest.mark.faults

ABLATIONS = 4


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
