"""Methods of a sweep are drawn with every case, their means and intervals, and the sets that are alike."""

from pathlib import Path

import polars as pl
import pytest

from omnieval.report.draw import svg_of
from omnieval.report.methods import methods_figures
from omnieval.report.sources import Sweep
from tests.report.charts import rows_of

F1: dict[str, list[float | None]] = {
    "a": [0.9, 0.8, 0.85, 0.95, 0.7, 0.9],
    "b": [0.5, 0.6, 0.4, 0.3, 0.2, 0.1],
    "c": [0.1, 0.2, 0.3, 0.4, 0.5, None],
}


def sweep_of(values):
    rows = [
        {"source": f"folder:/{case}", "mapper": mapper, "descriptor": "hog", "pair_f1": value, "error": None}
        for mapper, some in values.items()
        for case, value in enumerate(some)
    ]
    return Sweep(Path("sweep"), "complete", pl.DataFrame(rows), {}, {}, (), {})


def test_every_case_is_drawn_with_mean_and_interval():
    intervals, _ = methods_figures(sweep_of(F1))
    rows = rows_of(intervals)
    drawn = sorted((row["method"], row["value"]) for row in rows if "low" not in row)
    assert drawn == sorted((f"{name} hog", value) for name, some in F1.items() for value in some if value is not None)
    means = {row["method"]: row for row in rows if "low" in row}
    assert means["a hog"]["value"] == pytest.approx(0.85)
    assert means["a hog"]["low"] < 0.85 < means["a hog"]["high"]
    assert "<svg" in svg_of(intervals.chart, "methods")


def test_ranks_are_points_and_what_is_alike_a_bar():
    _, ranks = methods_figures(sweep_of(F1))
    rows = rows_of(ranks)
    points = {row["method"]: row["rank"] for row in rows if "method" in row}
    assert points["a hog"] == 1.0
    assert points["b hog"] == pytest.approx((2 + 2 + 2 + 3 + 3) / 5)  # on the five cases that all have
    (bar,) = (row for row in rows if "first" in row)  # five or six cases are too few to tell three methods apart
    assert (bar["first"], bar["last"]) == (1.0, max(points.values()))
    assert "a hog 1.00" in ranks.alt
    assert "<svg" in svg_of(ranks.chart, "ranks")


@pytest.mark.parametrize("values", [{"a": [0.1, 0.2]}, {"a": [0.1], "b": [0.2]}, {"a": [None] * 2, "b": [None] * 2}])
def test_what_has_no_spread_is_not_drawn(values):
    assert methods_figures(sweep_of(values)) == []


def test_two_methods_have_no_diagram():
    assert [figure.key for figure in methods_figures(sweep_of({name: F1[name] for name in "ab"}))] == ["methods"]
