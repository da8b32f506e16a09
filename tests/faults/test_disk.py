"""Whatever fails on the disk: one line, a true status, no half file under its final name."""

import json
import resource
from collections import Counter

import polars as pl
import pytest

from omnieval.results.content import content_hash
from omnieval.results.run_folder import open_run
from tests.cli.test_cli import in_process
from tests.faults.commands import REPLAY, SETTINGS, begun, one_line, prefix_of, run, steps_recorded, whole
from tests.faults.disk import FAULTS, every_fault

pytestmark = pytest.mark.faults

FRAMES = 24


@pytest.fixture(scope="module")
def short(panoramas, replayed, tmp_path_factory):
    """A complete short run; the descriptions of its images are in the cache."""
    cwd = tmp_path_factory.mktemp("short")
    assert in_process("replay", panoramas, *REPLAY, "--limit", FRAMES, "--out", "run", cwd=cwd).returncode == 0
    return open_run(cwd / "run")


def never_half(folder, result):
    """Check what a command on a failing disk says and leaves; return the status in ``run.json``, if there is one."""
    assert "Traceback" not in result.stderr
    if result.returncode:
        one_line(result.stderr)
    assert not list(folder.rglob("*.tmp"))
    if not begun(folder):
        assert result.returncode
        assert not folder.exists() or whole(folder) == []
        return "no run.json"
    whole(folder)
    state = json.loads((folder / "run.json").read_text())["status"]
    assert (state == "complete") == (result.returncode == 0)
    return state


@pytest.mark.parametrize(("code", "lasting"), FAULTS)
@pytest.mark.parametrize(("recording", "stride"), [("--no-rrd", 1), ("--no-images", 11)])
def test_every_operation_of_a_replay_can_fail(
    panoramas, short, tmp_path, monkeypatch, code, lasting, recording, stride, capsys
):
    monkeypatch.setattr("omnieval.results.run_folder._PART_ROWS", 18)
    arguments = ("replay", panoramas, *REPLAY, "--limit", FRAMES, recording, "--out")
    outcomes: Counter[str] = Counter()
    left: set[tuple[str, ...]] = set()
    for disk in every_fault(tmp_path, code, lasting=lasting, stride=stride + lasting):
        folder = tmp_path / f"run{sum(outcomes.values())}"
        with disk.mounted():
            result = in_process(*arguments, folder, cwd=tmp_path)
        state = never_half(folder, result)
        if begun(folder):
            prefix_of(folder, short)
        if state == "complete":
            assert open_run(folder).content_hash == short.content_hash
            lost = "the recording may be incomplete" in result.stderr
            assert lost or steps_recorded(folder / "replay.rrd") == FRAMES * (recording != "--no-rrd")
            assert lasting or lost == bool(open_run(folder).manifest.get("recording_failure"))
            state += ", recording lost and said so" if lost else ""
        outcomes[state] += 1
        kind = (state, *sorted(str(path.relative_to(folder)) for path in folder.rglob("*")))
        if kind not in left:  # what is left behind is of few kinds, and each can be written over
            left.add(kind)
            assert in_process(*arguments, folder, "--overwrite", "--no-rrd", cwd=tmp_path).returncode == 0
            assert open_run(folder).content_hash == short.content_hash
    assert len(left) > 2
    with capsys.disabled():
        print(f"\nreplay {recording}, {disk.operations} operations: {dict(outcomes)}")
    assert outcomes["complete"] >= 1
    assert not disk.failed


@pytest.mark.parametrize(("code", "lasting"), FAULTS)
def test_every_operation_of_an_ablation_can_fail(panoramas, short, tmp_path, code, lasting, capsys):
    arguments = ("ablate", panoramas, *SETTINGS, "--limit", FRAMES, "--vary", "omega=0.5,3.5", "--out")
    assert in_process(*arguments, "whole", cwd=tmp_path).returncode == 0
    expected = content_hash(pl.read_parquet(tmp_path / "whole" / "ablation.parquet"))
    outcomes: Counter[str] = Counter()
    for disk in every_fault(tmp_path, code, lasting=lasting, stride=4 if lasting else 1):
        folder = tmp_path / f"out{sum(outcomes.values())}"
        with disk.mounted():
            result = in_process(*arguments, folder, cwd=tmp_path)
        outcomes[never_half(folder, result)] += 1
        resumed = in_process(*arguments, folder, "--resume", cwd=tmp_path)
        assert resumed.returncode == 0, resumed.stderr
        assert content_hash(pl.read_parquet(folder / "ablation.parquet")) == expected
    with capsys.disabled():
        print(f"\nablate, {disk.operations} operations: {dict(outcomes)}")
    assert outcomes["complete"] >= 1
    assert not disk.failed


@pytest.mark.parametrize("largest", [512, 1500, 4096, 12000])
def test_a_full_disk(panoramas, short, tmp_path, largest):
    folder = tmp_path / "run"
    code, out, err = run(
        tmp_path,
        *("replay", panoramas, *REPLAY, "--limit", FRAMES, "--no-rrd", "--out", folder),
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (largest, largest)),
    )
    assert (code, out) == (2, "")
    assert "cannot write" in one_line(err)
    assert not list(folder.rglob("*.tmp"))
    if begun(folder):
        whole(folder)
        prefix_of(folder, short)
        assert open_run(folder).status in {"failed", "interrupted"}


def test_a_disk_too_small_for_the_recording_alone(panoramas, short, tmp_path):
    folder, largest = tmp_path / "run", 300_000
    assert short.recording.stat().st_size > largest
    code, _, err = run(
        tmp_path,
        *("replay", panoramas, *REPLAY, "--limit", FRAMES, "--no-map", "--out", folder),
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (largest, largest)),
    )
    assert code == 0
    assert "the recording may be incomplete (the tables are complete): " in one_line(err)
    assert open_run(folder).content_hash == short.content_hash
    assert not (folder / "replay.rrd").exists()
    assert steps_recorded(folder / "replay.partial.rrd") >= 0
    assert in_process("render", folder, cwd=tmp_path).returncode == 0
    assert steps_recorded(folder / "replay.rrd") == FRAMES
    without_map = {path.name for path in short.folder.iterdir()} - {"map.npz", "map.json"}
    assert {path.name for path in folder.iterdir()} == without_map


def test_a_disk_too_small_for_the_map_keeps_the_steps_and_says_what_did_not_fit(panoramas, short, tmp_path):
    folder, largest = tmp_path / "run", 300_000
    assert (short.folder / "map.npz").stat().st_size > largest
    code, out, err = run(
        tmp_path,
        *("replay", panoramas, *REPLAY, "--limit", FRAMES, "--no-rrd", "--out", folder),
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (largest, largest)),
    )
    assert (code, out) == (2, "")
    assert "map.npz: File too large" in one_line(err)
    assert open_run(folder).status == "failed"
    prefix_of(folder, short)
    assert len(open_run(folder).steps) == FRAMES
