"""Tables 2 and 3: our rows as measured, the paper's as printed, and never mistaken for each other."""

import shutil
from dataclasses import replace
from decimal import Decimal

import polars as pl
import pytest

import omnieval
from omnieval.report.build import Order, build, tables
from omnieval.report.figure import Skipped, Table
from omnieval.report.published import DOI
from omnieval.report.quality import quality_table
from omnieval.report.sources import open_sources
from omnieval.report.tables import batch_table, best_table, partitions_table, summary_table, theirs_heading
from omnieval.results.run_folder import open_run


@pytest.fixture(scope="session")
def sources(run, sweep, baseline):
    return open_sources([run, sweep, baseline])


def test_table_2_has_the_best_and_the_median_of_the_sweep(sources):
    (sweep,) = sources.sweeps
    (ours,), theirs = (rows for _, rows in best_table(sweep).groups)
    assert ours[2] == sweep.table["silhouette"].max()
    assert ours[6] == sweep.table["silhouette"].median()
    assert ours[8] == 6
    assert len(theirs) == 6
    assert theirs[0][:6] == ("INNOVA", "hog", Decimal("0.3973"), 6, Decimal("2.25"), Decimal("1.7"))


def test_table_2_names_other_parameters_that_vary(sources):
    (sweep,) = sources.sweeps
    wider = replace(sweep, axes={**sweep.axes, "n_new": [10, 20]})
    table = best_table(wider)
    assert table.columns[6] == "n_new"
    assert {len(row) for _, rows in table.groups for row in rows} == {len(table.columns)}
    assert table.groups[0][1][0][6] == 10


def test_table_3_compares_at_the_same_number_of_clusters(sources):
    table = batch_table(sources.sweeps, [(sources.replays[0], 0.25)])
    assert table is not None
    best, replay = table.groups[0][1]
    rows = sources.sweeps[0].table.drop_nulls("silhouette")
    row = rows.sort("silhouette", descending=True, maintain_order=True).row(0, named=True)
    assert best[3:] == (
        row["nodes"],
        row["silhouette"],
        row["batch_silhouette"],
        row["silhouette"] - row["batch_silhouette"],
    )
    found = sources.replays[0].metrics["silhouette"]
    assert replay[3:] == (sources.replays[0].nodes, found, 0.25, found - 0.25)
    assert batch_table([], []) is None


def test_published_numbers_are_marked_as_another_dataset(sources):
    for table in (best_table(sources.sweeps[0]), batch_table(sources.sweeps, [])):
        assert table is not None
        name = table.groups[1][0]
        assert "Published" in name
        assert "other datasets" in name
        assert any(DOI in note and "other image sequences" in note for note in table.notes)


def test_the_papers_own_sequence_is_not_called_another():
    heading = theirs_heading(["cold:/data/cold-freiburg/part_a/seq2_cloudy3", "synthetic:cloudy"])
    assert "probably the same sequence: Freiburg" in heading


def test_the_summary_has_everything_that_was_given(sources):
    rows = summary_table(sources).groups[0][1]
    assert [row[0] for row in rows] == ["three-hog", "sweep, best", "spectral, best: batch spectral"]
    assert rows[0][4:8] == (80, sources.replays[0].nodes, 80, sources.replays[0].metrics["silhouette"])
    assert rows[2][7] == sources.baselines[0].table["silhouette"].max()


def test_a_baseline_is_shown_row_by_row(sources):
    table = partitions_table(sources.baselines[0])
    assert [row[0] for row in table.groups[0][1]] == list(range(2, 9))


def test_tables_alone_are_those_of_the_page(sources):
    alone = tables(build(sources, Order(figures=False)))
    assert [table.key for table in alone] == ["summary", "table-3", "table-2"]
    (third,) = [table for table in alone if table.key == "table-3"]
    replay = third.groups[0][1][1]
    table = sources.baselines[0].table
    expected = table.filter(pl.col("k") == sources.replays[0].nodes)["silhouette"][0]
    assert replay[5] == expected
    page = tables(build(sources, Order()))
    assert alone == page


def test_published_numbers_stand_beside_the_papers_method_only(sources, panoramas, tmp_path):
    leader = open_sources([omnieval.replay(panoramas, mapper="leader", out=tmp_path / "leader").folder])
    order = Order(figures=False)
    alone, both = (
        tables(build(leader, order)),
        tables(build(replace(sources, replays=sources.replays + leader.replays), order)),
    )
    assert [[name for name, _ in table.groups] for table in alone] == [[""], ["Here"]]
    assert not any("paper" in note or DOI in note for table in alone for note in table.notes)
    (third,) = (table for table in both if table.key == "table-3")
    assert [row[1] for row in third.groups[0][1]] == ["hog, roman2020", "hog, roman2020", "hog, leader"]
    assert "Published" in third.groups[1][0]
    omnieval.ablate(panoramas, {"radius": [2, 4]}, mapper="leader", out=tmp_path / "sweep")
    (sweep,) = open_sources([tmp_path / "sweep"]).sweeps
    assert [name for name, _ in best_table(sweep).groups] == ["This sweep"]


def test_the_quality_of_a_map_is_told_at_every_distance(run):
    opened = open_run(run)
    table = quality_table(opened)
    assert isinstance(table, Table)
    assert table.columns[:5] == ("metric", "0.5 m", "1 m", "2 m", "3 m")
    rows = {row[0]: row for row in table.rows}
    assert rows["pair f1"][3] == opened.metrics["pair_f1"]
    assert rows["coverage"][1] is None
    assert "their own numbers" in table.notes[-1]


def test_a_run_from_before_there_was_a_quality_table_says_so(run, tmp_path):
    shutil.copytree(run, tmp_path / "old")
    (tmp_path / "old" / "quality.parquet").unlink()
    assert isinstance(quality_table(open_run(tmp_path / "old")), Skipped)
