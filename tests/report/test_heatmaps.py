"""The heat maps show the rows of the sweep."""

import re
from pathlib import Path

import polars as pl
import pytest

from omnieval.report.draw import svg_of
from omnieval.report.figure import Skipped
from omnieval.report.heatmaps import best_over_the_rest, chosen_axes, sweep_figures
from omnieval.report.sources import Sweep, open_sources
from tests.report.charts import figure_of, rows_of


def sweep_over(axes, rows):
    """A sweep of made-up rows."""
    columns = {"dataset": "d", "source": "s", "mapper": "roman2020", "descriptor": "hog", "error": None}
    table = pl.DataFrame([columns | {"job": job} | row for job, row in enumerate(rows)], infer_schema_length=None)
    return Sweep(Path("sweep"), "complete", table, axes, {}, (), {})


def grid(silhouettes, **others):
    return [
        {"merge_y": y, "omega": omega, "nodes": 3 + job, "silhouette": silhouettes[job], **others}
        for job, (y, omega) in enumerate((y, omega) for y in (0.75, 1.0) for omega in (1.7, 2.3))
    ]


def only_figure(sweep):
    """The figure of a sweep of one dataset and descriptor."""
    (block,) = sweep_figures(sweep)
    return figure_of(block)


AXES = {"merge_y": [0.75, 1.0], "omega": [1.7, 2.3]}


def test_every_cell_holds_the_number_of_its_run(sweep):
    (opened,) = open_sources([sweep]).sweeps
    figure = only_figure(opened)
    rows = rows_of(figure)
    for run in opened.table.iter_rows(named=True):
        place = (f"{run['merge_y']:g}", f"{run['omega']:g}")
        values = [row["value"] for row in rows if (row.get("x"), row.get("y")) == place]
        assert run["nodes"] in values
        assert run["silhouette"] in values
    drawn = svg_of(figure.chart, "f")
    for run in opened.table.iter_rows(named=True):
        assert f">{run['silhouette']:.3f}<".replace("-", "−") in drawn
    assert figure.data["nodes"].to_list() == opened.table.sort("job")["nodes"].to_list()


def test_the_best_is_framed_and_named_with_its_equals():
    figure = only_figure(sweep_over(AXES, grid([0.1, 0.4, 0.4, -0.2])))
    framed = {(row["x"], row["y"]) for row in rows_of(figure) if row["best"]}
    assert framed == {("0.75", "2.3")}
    assert "0.400 with 4 nodes at merge_y = 0.75, omega = 2.3, the first of 2 equal ones" in figure.caption
    assert "Fig. 9" in figure.caption
    assert "Silhouette from −0.200 to 0.400" in figure.alt


def test_a_failed_run_and_one_without_silhouette_have_no_colour():
    rows = grid([0.1, None, 0.3, 0.2])
    rows[3] |= {"nodes": None, "silhouette": None, "error": "OSError: gone"}
    figure = only_figure(sweep_over(AXES, rows))
    texts = {(row["x"], row["y"], row["text"]) for row in rows_of(figure)}
    assert ("1", "2.3", "failed") in texts
    assert ("0.75", "2.3", "–") in texts
    colored = re.findall(r'fill="rgb[^"]*" stroke="#d8dee4"', svg_of(figure.chart, "f"))
    assert len(colored) == 3 + 2


def test_without_positions_only_the_nodes_are_drawn():
    figure = only_figure(sweep_over(AXES, grid([None] * 4)))
    assert figure.title.startswith("Nodes over")
    assert "There is no silhouette: the sequence has no poses" in figure.caption
    assert not any(row["best"] for row in rows_of(figure))


def test_one_parameter_makes_lines_and_one_choice_points():
    lines = sweep_over(
        {"n_new": [10, 20]},
        [{"n_new": n, "nodes": n // 2, "silhouette": n / 100} for n in (10, 20)],
    )
    figure = only_figure(lines)
    assert sorted(row["value"] for row in rows_of(figure)) == [0.1, 0.2, 5, 10]
    assert "mark-line" in svg_of(figure.chart, "f")
    choices = sweep_over(
        {"covariance": ["pinv", "diagonal"]},
        [{"covariance": name, "nodes": 3, "silhouette": 0.5} for name in ("pinv", "diagonal")],
    )
    figure = only_figure(choices)
    drawn = svg_of(figure.chart, "f")
    assert "mark-line" not in drawn
    assert drawn.index(">pinv<") < drawn.index(">diagonal<")


def test_more_than_two_parameters_show_the_best_over_the_rest():
    rows = grid([0.1, 0.2, 0.3, 0.4], n_new=10) + grid([0.2, 0.1, None, 0.5], n_new=30)
    axes = AXES | {"n_new": [10, 30]}
    figure = only_figure(sweep_over(axes, rows))
    assert figure.data["silhouette"].to_list() == [0.2, 0.2, 0.3, 0.5]
    assert "Where n_new varies too" in figure.caption
    assert figure.data["runs"].to_list() == [2] * 4


@pytest.mark.parametrize(
    ("varied", "axes"),
    [
        ({"n_new": [1, 2, 3], "omega": [1.0, 2.0], "merge_y": [1.0, 2.0]}, ("merge_y", "omega")),
        ({"covariance": ["a", "b", "c"], "gamma": [1.0, 2.0], "n_new": [1, 2, 3]}, ("n_new", "gamma")),
        ({"covariance": ["a", "b"], "gamma": [1.0, 2.0]}, ("gamma", "covariance")),
        ({"gamma": [1.0, 2.0]}, ("gamma",)),
    ],
)
def test_the_axes_are_the_papers_then_numbers_then_the_longest(varied, axes):
    assert chosen_axes(varied) == axes


def test_best_over_the_rest_keeps_the_first_of_equals():
    rows = pl.DataFrame(
        {
            "omega": [1.0, 1.0, 2.0],
            "job": [0, 1, 2],
            "nodes": [5, 6, 7],
            "silhouette": [0.5, 0.5, None],
            "error": [None, None, None],
        }
    )
    assert best_over_the_rest(rows, ["omega"])["nodes"].to_list() == [5, 7]


def test_what_cannot_be_drawn_says_why():
    (nothing,) = sweep_figures(sweep_over({"omega": [1.7]}, grid([0.1] * 4)[:1]))
    assert isinstance(nothing, Skipped)
    assert "no parameter of this sweep has several values" in nothing.reason
    failed = [row | {"nodes": None, "silhouette": None, "error": "x"} for row in grid([0.1] * 4)]
    (failure,) = sweep_figures(sweep_over(AXES, failed))
    assert isinstance(failure, Skipped)
    assert "every run failed" in failure.reason
