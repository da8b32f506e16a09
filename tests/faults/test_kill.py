"""A run that is killed at any moment leaves true, readable results, and is made whole again."""

import signal
from collections import Counter

import pytest

from omnieval.results.run_folder import open_run
from tests.cli.test_cli import in_process
from tests.faults.commands import (
    MORE,
    OFTEN,
    REPLAY,
    begun,
    kill_after,
    load,
    one_ahead,
    parts,
    prefix_of,
    span,
    steps_recorded,
    whole,
)

pytestmark = pytest.mark.faults

REPLAYS = 8


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
