"""A sweep that splits an interval exactly is drawn piece by piece."""

from dataclasses import replace

import polars as pl
import pytest

import omnieval
from omnieval.report.build import Order, build
from omnieval.report.figure import Skipped, Table
from omnieval.report.pieces import pieces_figures
from omnieval.report.sources import open_sources
from tests.report.charts import figure_of, rows_of
from tests.report.conftest import SMALL


@pytest.fixture(scope="module")
def exact(panoramas, tmp_path_factory):
    folder = tmp_path_factory.mktemp("exact") / "sweep"
    fixed = {name: value for name, value in SMALL.items() if name != "merge_y"}
    omnieval.ablate(panoramas, exact="merge_y=0.5:200", settings=fixed, out=folder)
    return open_sources([folder])


def test_every_piece_is_a_line_at_its_value(exact):
    (sweep,) = exact.sweeps
    assert sweep.exact
    (block,) = pieces_figures(sweep)
    figure = figure_of(block)
    drawn = {(row["from"], row["to"], row["value"]) for row in rows_of(figure)}
    assert len(sweep.table) > 1
    for row in sweep.table.iter_rows(named=True):
        assert (row["exact_from"], row["exact_to"], row["nodes"]) in drawn
        assert row["silhouette"] is None or (row["exact_from"], row["exact_to"], row["silhouette"]) in drawn
    assert "0.5 to 200" in figure.alt
    assert "for merge_y from" in figure.caption


def test_table_2_says_which_values_the_best_holds_for(exact):
    content = build(exact, Order())
    (table,) = [
        block
        for section in content.sections
        for block in section.blocks
        if isinstance(block, Table) and block.key == "table-2"
    ]
    best = exact.sweeps[0].table.sort("silhouette", descending=True, nulls_last=True, maintain_order=True)
    row = best.row(0, named=True)
    assert table.groups[0][1][0][4] == f"{row['exact_from']:g} to {row['exact_to']:g}"
    assert (table.columns[-1], table.groups[0][1][0][-1]) == ("pieces", len(exact.sweeps[0].table))
    assert not any("run" in note for note in table.notes[:2])
    skipped = [block for section in content.sections for block in section.blocks if isinstance(block, Skipped)]
    assert ["makes no single runs" in block.reason for block in skipped] == [True]


def test_pieces_that_all_failed_say_so(exact):
    (sweep,) = exact.sweeps
    failed = sweep.table.with_columns(nodes=pl.lit(None, pl.Int32), silhouette=pl.lit(None, pl.Float64))
    (block,) = pieces_figures(replace(sweep, table=failed))
    assert isinstance(block, Skipped)
    assert "every run failed" in block.reason
