"""A folder written again holds nothing of before that omnieval wrote, and all that somebody else did."""

import json

import polars as pl
import pytest

from omnieval.errors import ResultError
from omnieval.results.folder import ResultFolder, report_files
from omnieval.results.run_folder import RunWriter
from omnieval.results.schemas import STEPS

REPORT = ("index.html", "figures/01-map.svg", "figures/01-map.png", "figures/01-map.csv")


def replay(folder, *, overwrite=False):
    with RunWriter(folder, {}, overwrite=overwrite) as writer:
        writer.finish({"steps": STEPS.to_frame(), "nodes": pl.DataFrame(), "transitions": pl.DataFrame()}, {})


def baseline(folder, *, overwrite=False):
    with ResultFolder(folder, "baseline", {}, files=["baseline.parquet"], overwrite=overwrite) as held:
        held.complete()


def report(folder, files=REPORT):
    with ResultFolder(folder, "report", {"files": list(files)}) as held:
        (folder / "figures").mkdir()
        for name in REPORT:
            (folder / name).write_text("drawn")
        held.complete()


def listing(folder):
    return sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*"))


@pytest.mark.parametrize("write", [replay, baseline])
def test_a_report_goes_with_what_it_tells_of(write, tmp_path):
    write(tmp_path / "run")
    alone = listing(tmp_path / "run")
    report(tmp_path / "run" / "report")
    write(tmp_path / "run", overwrite=True)
    assert listing(tmp_path / "run") == alone


def test_what_others_put_there_stays(tmp_path):
    run = tmp_path / "run"
    replay(run)
    report(run / "report")
    for name in ("notes.txt", "report/notes.txt", "report/figures/mine.png", "report/figures/02-mine.svg"):
        (run / name).write_text("mine")
    replay(run, overwrite=True)
    mine = {"notes.txt", "report", "report/figures", "report/figures/02-mine.svg", "report/figures/mine.png"}
    tables = {"nodes.parquet", "run.json", "steps.parquet", "transitions.parquet"}
    assert set(listing(run)) == tables | mine | {"report/notes.txt"}


def test_a_folder_that_is_only_called_so_stays(tmp_path):
    run = tmp_path / "run"
    replay(run)
    (run / "report").mkdir()
    (run / "report" / "index.html").write_text("mine")
    before = listing(run)
    replay(run, overwrite=True)
    assert listing(run) == before
    replay(tmp_path / "other")
    (tmp_path / "other" / "report").symlink_to(tmp_path / "elsewhere")
    report(tmp_path / "elsewhere")
    elsewhere = listing(tmp_path / "elsewhere")
    replay(tmp_path / "other", overwrite=True)
    assert listing(tmp_path / "elsewhere") == elsewhere


def test_a_forged_manifest_cannot_have_other_files_removed(tmp_path):
    run = tmp_path / "run"
    replay(run)
    precious = tmp_path / "precious.txt"
    precious.write_text("mine")
    forged = ["../../precious.txt", str(precious), "../steps.parquet", "figures/../../precious.txt", 7]
    report(run / "report", files=[*REPORT, *forged])
    assert report_files(run / "report") == list(REPORT)
    replay(run, overwrite=True)
    assert precious.read_text() == "mine"
    assert (run / "steps.parquet").exists()


def test_a_report_that_is_being_written_is_not_taken_away(tmp_path):
    run = tmp_path / "run"
    replay(run)
    with ResultFolder(run / "report", "report", {"files": []}):
        with pytest.raises(ResultError, match="being written by another process"):
            replay(run, overwrite=True)
        assert json.loads((run / "run.json").read_text())["status"] == "complete"
    replay(run, overwrite=True)
    assert not (run / "report").exists()
