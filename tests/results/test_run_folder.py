"""The run folder: whole files, a readable prefix, a true status, nothing overwritten unasked."""

import json
import os
import subprocess
import sys
from pathlib import Path

import polars as pl
import pytest

from omnieval.datasets.sequence import Frame, Pose
from omnieval.errors import ResultError
from omnieval.mapping.step import EventKind, NodeEvent, Step, Verdict
from omnieval.results.run_folder import RunWriter, free_folder, open_run
from omnieval.results.schemas import STEPS
from omnieval.results.tables import step_from_row, step_row


def a_row(number, *, events=()):
    step = Step(number, Verdict.INITIAL, 1, None, None, None, 0, tuple(events), 1, 0, None)
    return step_row(step, Frame(path=Path(), file=f"{number}.png", pose=Pose(1.0, 2.0, 0.5), room="CR"), 0.25)


def test_steps_are_readable_while_the_run_is_under_way(tmp_path, monkeypatch):
    monkeypatch.setattr("omnieval.results.run_folder._PART_ROWS", 4)
    writer = RunWriter(tmp_path / "run", {"source": "here"})
    for number in range(10):
        writer.step(a_row(number))
    run = open_run(tmp_path / "run")
    assert run.status == "running"
    assert run.steps["frame"].to_list() == list(range(8))
    assert run.steps.schema == STEPS


def test_a_complete_run_has_its_tables_and_no_parts(tmp_path, monkeypatch):
    monkeypatch.setattr("omnieval.results.run_folder._PART_ROWS", 4)
    writer = RunWriter(tmp_path / "run", {})
    for number in range(6):
        writer.step(a_row(number))
    writer.complete({"steps": writer.steps()}, {"metrics": {"nodes": 1}})
    run = open_run(tmp_path / "run")
    assert (run.status, run.metrics) == ("complete", {"nodes": 1})
    assert run.steps["frame"].to_list() == list(range(6))
    assert sorted(path.name for path in (tmp_path / "run").iterdir()) == ["run.json", "steps.parquet"]


def test_an_abandoned_run_keeps_its_steps_and_says_why(tmp_path):
    writer = RunWriter(tmp_path / "run", {})
    writer.step(a_row(0))
    writer.abandon("interrupted", "Ctrl-C")
    run = open_run(tmp_path / "run")
    assert (run.status, run.manifest["reason"], len(run.steps)) == ("interrupted", "Ctrl-C", 1)


def test_a_killed_run_is_interrupted(tmp_path):
    code = (
        "import os, sys, pathlib\n"
        "from omnieval.results.run_folder import RunWriter\n"
        "RunWriter(pathlib.Path(sys.argv[1]), {})\n"
        "os._exit(9)\n"
    )
    subprocess.run([sys.executable, "-c", code, str(tmp_path / "run")], check=False)
    run = open_run(tmp_path / "run")
    assert run.manifest["status"] == "running"
    assert run.status == "interrupted"
    assert run.steps.is_empty()


def test_nothing_is_overwritten_unasked(tmp_path):
    RunWriter(tmp_path / "run", {"source": "first"}).complete({}, {})
    with pytest.raises(ResultError, match="holds a replay already"):
        RunWriter(tmp_path / "run", {})
    assert open_run(tmp_path / "run").manifest["source"] == "first"


def test_overwriting_removes_only_what_a_run_wrote(tmp_path):
    writer = RunWriter(tmp_path / "run", {})
    writer.step(a_row(0))
    writer.complete({"steps": writer.steps()}, {})
    (tmp_path / "run" / "notes.txt").write_text("mine")
    RunWriter(tmp_path / "run", {"source": "second"}, overwrite=True)
    assert sorted(path.name for path in (tmp_path / "run").iterdir()) == ["notes.txt", "run.json"]


def test_a_folder_that_is_no_run_is_never_touched(tmp_path):
    (tmp_path / "photos").mkdir()
    (tmp_path / "photos" / "steps.parquet").write_text("not ours")
    with pytest.raises(ResultError, match="not a replay of omnieval"):
        RunWriter(tmp_path / "photos", {}, overwrite=True)
    assert (tmp_path / "photos" / "steps.parquet").read_text() == "not ours"


def test_the_next_free_name_is_numbered(tmp_path):
    assert free_folder(tmp_path, "a-hog").name == "a-hog"
    (tmp_path / "a-hog").mkdir()
    (tmp_path / "a-hog-2").mkdir()
    assert free_folder(tmp_path, "a-hog").name == "a-hog-3"


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (None, "not a run folder"),
        ('{"schema_version": 1, "kind": "baseline"}', "a baseline, not a replay"),
        ("{", "cannot read"),
        ('{"schema_version": 99}', "schema version 99"),
        ("[]", "None"),
    ],
)
def test_what_is_no_run_is_refused(tmp_path, content, message):
    if content is not None:
        (tmp_path / "run.json").write_text(content)
    with pytest.raises(ResultError, match=message):
        open_run(tmp_path)


def test_a_damaged_table_is_refused(tmp_path):
    writer = RunWriter(tmp_path / "run", {})
    writer.step(a_row(0))
    writer.complete({"steps": writer.steps()}, {})
    path = tmp_path / "run" / "steps.parquet"
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    with pytest.raises(ResultError, match="cannot read"):
        _ = open_run(tmp_path / "run").steps


def test_manifest_is_plain_json_with_the_process_that_writes(tmp_path):
    RunWriter(tmp_path / "run", {})
    manifest = json.loads((tmp_path / "run" / "run.json").read_text())
    assert manifest["process"]["pid"] == os.getpid()
    assert manifest["status"] == "running"


def test_events_survive_the_table(tmp_path):
    events = (
        NodeEvent(EventKind.CREATED, 3, frames=(5, 6, 7)),
        NodeEvent(EventKind.MERGED, 3, into=1),
    )
    writer = RunWriter(tmp_path / "run", {})
    writer.step(a_row(7, events=events))
    writer.complete({"steps": writer.steps()}, {})
    (row,) = open_run(tmp_path / "run").steps.iter_rows(named=True)
    assert step_from_row(row).events == events


def test_times_are_nanoseconds_since_the_epoch(tmp_path):
    step = Step(0, Verdict.INITIAL, 1, None, None, None, 0, (), 1, 0, None)
    writer = RunWriter(tmp_path / "run", {})
    writer.step(step_row(step, Frame(path=Path(), file="a", time_ns=1_152_904_768_652_404_000), 0.1))
    assert writer.steps()["time"].cast(pl.Int64).to_list() == [1_152_904_768_652_404_000]
