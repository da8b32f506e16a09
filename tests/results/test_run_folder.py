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
from omnieval.results.schemas import SCHEMA_VERSION, STEPS
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
    del writer
    (tmp_path / "run" / "notes.txt").write_text("mine")
    RunWriter(tmp_path / "run", {"source": "second"}, overwrite=True)
    assert sorted(path.name for path in (tmp_path / "run").iterdir()) == ["notes.txt", "run.json"]


def test_a_run_of_an_earlier_version_can_be_overwritten_though_not_read(tmp_path):
    RunWriter(tmp_path / "run", {"source": "first"}).complete({}, {})
    file = tmp_path / "run" / "run.json"
    file.write_text(file.read_text().replace(f'"schema_version": {SCHEMA_VERSION}', '"schema_version": 1'))
    with pytest.raises(ResultError, match="schema version 1"):
        open_run(tmp_path / "run")
    with pytest.raises(ResultError, match="holds a replay already"):
        RunWriter(tmp_path / "run", {})
    RunWriter(tmp_path / "run", {"source": "second"}, overwrite=True).complete({}, {})
    assert open_run(tmp_path / "run").manifest["source"] == "second"


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
        (None, "not a run folder: it has no run.json"),
        ('{"schema_version": 2, "kind": "baseline"}', "a baseline, not a replay"),
        ("{", "cannot read"),
        ('{"schema_version": 99}', "schema version 99"),
        ("[]", "None"),
        ('{"schema_version": 2}', "nothing we know, not a replay"),
        ('{"schema_version": 2, "kind": 7}', "nothing we know, not a replay"),
        (
            '{"schema_version": 2, "kind": "replay", "status": 1}',
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
    writer = RunWriter(tmp_path / "run", {})
    writer.step(a_row(0))
    writer.complete({"steps": writer.steps()}, {})
    path = tmp_path / "run" / "steps.parquet"
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    with pytest.raises(ResultError, match="is damaged or was changed"):
        _ = open_run(tmp_path / "run").steps


def test_a_damaged_part_of_a_run_that_was_killed_is_refused(tmp_path):
    writer = RunWriter(tmp_path / "run", {})
    writer.step(a_row(0))
    writer.complete({"steps": writer.steps()}, {})
    manifest = tmp_path / "run" / "run.json"
    manifest.write_text(json.dumps(json.loads(manifest.read_text()) | {"file_digests": {}}))
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


@pytest.mark.parametrize("name", ["../a", "/a", "a/../../b", "..", "", "a\nb", "é x", "-rf", "a" * 400])
def test_a_folder_of_our_choice_is_always_in_its_parent(tmp_path, name):
    folder = free_folder(tmp_path, name)
    assert folder.parent == tmp_path
    folder.mkdir()
    assert [path.name for path in tmp_path.iterdir()] == [folder.name]


def test_what_ends_a_complete_run_early_cannot_touch_its_tables(tmp_path):
    writer = RunWriter(tmp_path / "run", {})
    writer.step(a_row(0))
    whole = writer.steps().with_columns(node_final=pl.lit(1, pl.Int32))
    writer.complete({"steps": whole}, {})
    writer.abandon("interrupted", "Ctrl-C while the recording was completed")
    run = open_run(tmp_path / "run")
    assert (run.status, run.manifest["recording_failure"]) == ("complete", "Ctrl-C while the recording was completed")
    assert run.steps.equals(whole)


def test_an_overwritten_run_leaves_no_steps_of_its_own(tmp_path, monkeypatch):
    monkeypatch.setattr("omnieval.results.run_folder._PART_ROWS", 4)
    killed = RunWriter(tmp_path / "run", {})
    for number in range(10):
        killed.step(a_row(number))
    (tmp_path / "run" / "replay.partial.rrd").write_bytes(b"half")
    del killed
    RunWriter(tmp_path / "run", {}, overwrite=True)
    assert open_run(tmp_path / "run").steps.is_empty()
    assert sorted(path.name for path in (tmp_path / "run").rglob("*")) == ["run.json"]


def test_a_run_that_cannot_say_how_it_ended_lets_others_write(tmp_path, monkeypatch):
    writer = RunWriter(tmp_path / "run", {})

    def full(*arguments):
        raise ResultError("no space left")

    with monkeypatch.context() as patch:
        patch.setattr("omnieval.results.run_folder.write_table", full)
        with pytest.raises(ResultError, match="no space"):
            writer.abandon("failed", "no space left")
    RunWriter(tmp_path / "run", {}, overwrite=True)
