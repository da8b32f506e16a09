"""The run folder: whole files, a readable prefix, a true status, nothing overwritten unasked."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import polars as pl
import pytest

from omnieval.datasets.sequence import Frame, Pose
from omnieval.errors import ResultError
from omnieval.mapping.partition import Partition
from omnieval.mapping.step import EventKind, NodeEvent, Role, Step
from omnieval.results.run_folder import RunWriter, free_folder, open_run
from omnieval.results.schemas import SCHEMA_VERSION, STEPS
from omnieval.results.tables import step_from_row, step_row, steps_frame


def a_row(number, *, events=()):
    step = Step(number, "initial", Role.FOUNDING, 1, events=tuple(events))
    frame = Frame(path=Path(), file=f"{number}.png", pose=Pose(1.0, 2.0, 0.5), room="CR")
    return step_row(step, frame, Partition(), 0.25)


def finished(folder, rows=1):
    with RunWriter(folder, {"frames": rows}) as writer:
        for number in range(rows):
            writer.step(a_row(number))
        return writer.finish({"steps": writer.steps()}, {"metrics": {"nodes": 1}})


def killed(folder, rows):
    """Leave a folder as a process does that writes these steps and is killed."""
    code = (
        "import os, sys, pathlib\n"
        "import omnieval.results.run_folder as module\n"
        "from tests.results.test_run_folder import a_row\n"
        "module._PART_ROWS = 4\n"
        "with module.RunWriter(sys.argv[1], {}) as writer:\n"
        "    for number in range(int(sys.argv[2])):\n"
        "        writer.step(a_row(number))\n"
        "    os._exit(9)\n"
    )
    root = Path(__file__).parents[2]
    subprocess.run([sys.executable, "-c", code, str(folder), str(rows)], check=False, cwd=root)


def test_steps_are_readable_while_the_run_is_under_way(tmp_path, monkeypatch):
    monkeypatch.setattr("omnieval.results.run_folder._PART_ROWS", 4)
    with RunWriter(tmp_path / "run", {"source": "here"}) as writer:
        for number in range(10):
            writer.step(a_row(number))
        run = open_run(tmp_path / "run")
        assert run.status == "running"
        assert run.steps["frame"].to_list() == list(range(8))
        assert run.steps.schema == STEPS


def test_a_complete_run_has_its_tables_and_no_parts(tmp_path, monkeypatch):
    monkeypatch.setattr("omnieval.results.run_folder._PART_ROWS", 4)
    finished(tmp_path / "run", rows=6)
    run = open_run(tmp_path / "run")
    assert (run.status, run.metrics) == ("complete", {"nodes": 1})
    assert run.steps["frame"].to_list() == list(range(6))
    assert sorted(path.name for path in (tmp_path / "run").iterdir()) == ["run.json", "steps.parquet"]


def test_a_run_is_shown_in_a_line(tmp_path):
    assert repr(finished(tmp_path / "run", rows=6)) == f"Run({tmp_path / 'run'}: complete, 6 frames, 1 node)"
    killed(tmp_path / "killed", rows=1)
    assert repr(open_run(tmp_path / "killed")) == f"Run({tmp_path / 'killed'}: interrupted)"


@pytest.mark.parametrize(
    ("error", "ending"),
    [
        (KeyboardInterrupt(), ("interrupted", "interrupted by the user")),
        (MemoryError(), ("failed", "MemoryError")),
        (ResultError("no space"), ("failed", "no space")),
    ],
)
def test_a_run_that_is_left_early_keeps_its_steps_and_says_why(tmp_path, monkeypatch, error, ending):
    monkeypatch.setattr("omnieval.results.run_folder._PART_ROWS", 4)

    def write():
        with RunWriter(tmp_path / "run", {}) as writer:
            for number in range(6):
                writer.step(a_row(number))
            raise error

    with pytest.raises(type(error)):
        write()
    run = open_run(tmp_path / "run")
    assert (run.status, run.manifest["reason"]) == ending
    assert run.steps["frame"].to_list() == list(range(6))
    assert sorted(path.name for path in (tmp_path / "run").iterdir()) == ["run.json", "steps.parquet"]


def abandoned(folder, told):
    def write():
        with RunWriter(folder, {"frames": 3}, overwrite=True) as writer:
            writer.when_abandoned = lambda: told(writer)
            writer.step(a_row(0))
            writer.step(a_row(1))
            raise MemoryError

    with pytest.raises(MemoryError):
        write()
    return open_run(folder)


def test_a_run_that_is_left_early_tells_of_its_prefix(tmp_path):
    run = abandoned(tmp_path / "run", lambda writer: {"came_to": len(writer.steps())})
    assert (run.status, run.manifest["came_to"], len(run.steps)) == ("failed", 2, 2)
    with RunWriter(tmp_path / "run", {}, overwrite=True) as writer:
        writer.when_abandoned = lambda: {"came_to": 0}
        writer.finish({}, {})
    assert "came_to" not in open_run(tmp_path / "run").manifest


@pytest.mark.parametrize("told", [lambda writer: 1 // 0, lambda writer: {"came_to": Path()}])
def test_what_cannot_be_told_of_a_prefix_costs_nothing_else(tmp_path, told):
    run = abandoned(tmp_path / "run", told)
    assert (run.manifest["status"], run.manifest["reason"]) == ("failed", "MemoryError")
    assert run.manifest["file_digests"]
    assert run.steps["frame"].to_list() == [0, 1]


def test_a_prefix_that_could_not_be_kept_is_not_told_of(tmp_path, monkeypatch):
    def full(*arguments):
        raise ResultError("no space left")

    monkeypatch.setattr("omnieval.results.run_folder.write_table", full)
    run = abandoned(tmp_path / "run", lambda writer: {"came_to": len(writer.steps())})
    assert run.manifest["status"] == "failed"
    assert "came_to" not in run.manifest


@pytest.mark.parametrize("rows", [1, 100])
def test_ctrl_c_while_steps_are_put_together_keeps_each_once(tmp_path, monkeypatch, rows):
    monkeypatch.setattr("omnieval.results.run_folder._PART_ROWS", rows)
    together = pl.concat

    def interrupted(*arguments):
        monkeypatch.undo()
        signal.raise_signal(signal.SIGINT)
        return together(*arguments)

    def write():
        with RunWriter(tmp_path / "run", {}) as writer:
            for number in range(3):
                writer.step(a_row(number))
            monkeypatch.setattr("polars.concat", interrupted)
            writer.steps()

    with pytest.raises(KeyboardInterrupt):
        write()
    run = open_run(tmp_path / "run")
    assert (run.status, run.steps["frame"].to_list()) == ("interrupted", [0, 1, 2])


def test_a_killed_run_is_interrupted(tmp_path):
    killed(tmp_path / "run", rows=10)
    run = open_run(tmp_path / "run")
    assert run.manifest["status"] == "running"
    assert run.status == "interrupted"
    assert run.steps["frame"].to_list() == list(range(8))


def test_nothing_is_overwritten_unasked(tmp_path):
    finished(tmp_path / "run")
    with pytest.raises(ResultError, match="holds a replay already"):
        finished(tmp_path / "run", rows=2)
    assert open_run(tmp_path / "run").manifest["frames"] == 1


def test_overwriting_removes_only_what_a_run_wrote(tmp_path):
    finished(tmp_path / "run")
    (tmp_path / "run" / "notes.txt").write_text("mine")
    with RunWriter(tmp_path / "run", {"source": "second"}, overwrite=True):
        assert sorted(path.name for path in (tmp_path / "run").iterdir()) == ["notes.txt", "run.json"]


def test_a_run_of_an_earlier_version_can_be_overwritten_though_not_read(tmp_path):
    finished(tmp_path / "run")
    file = tmp_path / "run" / "run.json"
    file.write_text(file.read_text().replace(f'"schema_version": {SCHEMA_VERSION}', '"schema_version": 1'))
    with pytest.raises(ResultError, match="schema version 1"):
        open_run(tmp_path / "run")
    with pytest.raises(ResultError, match="holds a replay already"):
        finished(tmp_path / "run")
    with RunWriter(tmp_path / "run", {"source": "second"}, overwrite=True) as writer:
        writer.finish({}, {})
    assert open_run(tmp_path / "run").manifest["source"] == "second"


def test_a_folder_that_is_no_run_is_never_touched(tmp_path):
    (tmp_path / "photos").mkdir()
    (tmp_path / "photos" / "steps.parquet").write_text("not ours")
    with pytest.raises(ResultError, match="not a replay of omnieval"):
        RunWriter(tmp_path / "photos", {}, overwrite=True).__enter__()
    assert (tmp_path / "photos" / "steps.parquet").read_text() == "not ours"


def test_the_next_free_name_is_numbered(tmp_path):
    assert free_folder(tmp_path, "a-hog").name == "a-hog"
    (tmp_path / "a-hog").mkdir()
    (tmp_path / "a-hog-2").mkdir()
    assert free_folder(tmp_path, "a-hog").name == "a-hog-3"


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (None, "not a run folder: it has no run.json"),
        ('{"schema_version": 3, "kind": "baseline"}', "a baseline, not a replay"),
        ("{", "cannot read"),
        ('{"schema_version": 99}', "schema version 99"),
        ("[]", "None"),
        ('{"schema_version": 3}', "of an unknown kind, not a replay"),
        ('{"schema_version": 3, "kind": 7}', "of an unknown kind, not a replay"),
        (
            '{"schema_version": 3, "kind": "replay", "status": 1}',
            "damaged: it has no status, process, started, metrics",
        ),
    ],
)
def test_what_is_no_run_is_refused(tmp_path, content, message):
    if content is not None:
        (tmp_path / "run.json").write_text(content)
    with pytest.raises(ResultError, match=message):
        open_run(tmp_path)


def test_a_damaged_table_is_refused(tmp_path):
    finished(tmp_path / "run")
    path = tmp_path / "run" / "steps.parquet"
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    with pytest.raises(ResultError, match="is damaged or was changed"):
        _ = open_run(tmp_path / "run").steps


def test_a_damaged_part_of_a_run_that_was_killed_is_refused(tmp_path):
    finished(tmp_path / "run")
    manifest = tmp_path / "run" / "run.json"
    manifest.write_text(json.dumps(json.loads(manifest.read_text()) | {"file_digests": {}}))
    path = tmp_path / "run" / "steps.parquet"
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    with pytest.raises(ResultError, match="cannot read"):
        _ = open_run(tmp_path / "run").steps


def test_manifest_is_plain_json_with_the_process_that_writes(tmp_path):
    with RunWriter(tmp_path / "run", {}):
        manifest = json.loads((tmp_path / "run" / "run.json").read_text())
    assert manifest["process"]["pid"] == os.getpid()
    assert manifest["status"] == "running"


def test_events_survive_the_table(tmp_path):
    events = (
        NodeEvent(EventKind.CREATED, 3, frames=(5, 6, 7)),
        NodeEvent(EventKind.MERGED, 3, into=1),
    )
    with RunWriter(tmp_path / "run", {}) as writer:
        writer.step(a_row(7, events=events))
        writer.finish({"steps": writer.steps()}, {})
    (row,) = open_run(tmp_path / "run").steps.iter_rows(named=True)
    assert step_from_row(row, ()).events == events


def test_times_are_nanoseconds_since_the_epoch(tmp_path):
    step = Step(0, "initial", Role.FOUNDING, 1)
    frame = Frame(path=Path(), file="a", time_ns=1_152_904_768_652_404_000)
    with RunWriter(tmp_path / "run", {}) as writer:
        writer.step(step_row(step, frame, Partition(), 0.1))
        assert writer.steps()["time"].cast(pl.Int64).to_list() == [1_152_904_768_652_404_000]


@pytest.mark.parametrize("name", ["../a", "/a", "a/../../b", "..", "", "a\nb", "é x", "-rf", "a" * 400])
def test_a_folder_of_our_choice_is_always_in_its_parent(tmp_path, name):
    folder = free_folder(tmp_path, name)
    assert folder.parent == tmp_path
    folder.mkdir()
    assert [path.name for path in tmp_path.iterdir()] == [folder.name]


@pytest.mark.parametrize(
    ("error", "reason"), [(KeyboardInterrupt(), "interrupted by the user"), (MemoryError(), "MemoryError")]
)
def test_what_ends_a_complete_run_early_can_only_have_cost_the_recording(tmp_path, error, reason):
    whole = steps_frame([a_row(0)], ()).with_columns(node_final=pl.lit(1, pl.Int32))

    def write():
        with RunWriter(tmp_path / "run", {}) as writer:
            writer.step(a_row(0))
            writer.finish({"steps": whole}, {})
            raise error

    with pytest.raises(type(error)):
        write()
    run = open_run(tmp_path / "run")
    assert (run.status, run.manifest["recording_failure"]) == ("complete", reason)
    assert run.steps.equals(whole)


def test_an_overwritten_run_leaves_no_steps_of_its_own(tmp_path):
    killed(tmp_path / "run", rows=10)
    (tmp_path / "run" / "replay.partial.rrd").write_bytes(b"half")
    assert len(open_run(tmp_path / "run").steps) == 8
    with RunWriter(tmp_path / "run", {}, overwrite=True):
        assert open_run(tmp_path / "run").steps.is_empty()
        assert sorted(path.name for path in (tmp_path / "run").rglob("*")) == ["run.json"]


@pytest.mark.parametrize("trouble", [ResultError("no space left"), MemoryError()])
def test_a_run_whose_steps_cannot_be_kept_says_how_it_ended_and_lets_others_write(tmp_path, monkeypatch, trouble):
    def full(*arguments):
        raise trouble

    with monkeypatch.context() as patch:
        patch.setattr("omnieval.results.run_folder.write_table", full)
        with pytest.raises(ValueError, match="the first"), RunWriter(tmp_path / "run", {}):
            raise ValueError("the first")
    assert open_run(tmp_path / "run").manifest["reason"] == "ValueError: the first"
    with RunWriter(tmp_path / "run", {}, overwrite=True):
        pass
