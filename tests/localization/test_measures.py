"""The metrics of localisation, of six answers by hand."""

import numpy as np
import polars as pl
import pytest

from omnieval.localization.measures import METRICS, measure
from omnieval.localization.table import QUERIES

ROWS = [
    # node, error, reachable, rank, nearest_rank, node_right, room, best_room, doubt
    (1, 0.1, 0.1, 1, 1, True, "A", "A", 0.2),
    (1, 0.4, 0.2, 1, 3, True, "A", "B", 0.3),
    (2, 5.0, 0.3, 4, 90, False, "B", "B", 0.4),
    (None, None, 0.2, None, None, None, "B", None, 0.8),
    (2, 2.0, 2.0, None, 1, False, None, "B", 0.5),
    (None, None, 3.0, None, None, None, None, None, 0.9),
]
NAMES = ("node", "error", "reachable", "rank", "nearest_rank", "node_right", "room", "best_room", "doubt")


def answers(rows=ROWS):
    blank = dict.fromkeys(QUERIES) | {"compared": 10, "milliseconds": 2.0}
    named = [dict(zip(NAMES, row, strict=True)) for row in rows]
    roles = ["refused" if row["node"] is None else "joined" for row in named]
    return pl.DataFrame([blank | row | {"role": role} for row, role in zip(named, roles, strict=True)], schema=QUERIES)


def test_every_metric_by_hand():
    measured = measure(answers(), 0.5, 300)
    expected = {
        "queries": 6,
        "posed": 6,
        "refused": 2,
        "error_mean": (0.1 + 0.4 + 5 + 2) / 4,
        "error_median": 1.2,
        "error_p95": np.percentile([0.1, 0.4, 5, 2], 95),
        "reachable_mean": (0.1 + 0.2 + 0.3 + 2) / 4,
        "coverage": 4 / 6,
        "recall@1": 2 / 6,
        "recall@5": 3 / 6,
        "recall@1%": 2 / 6,
        "recall_covered@1": 2 / 4,
        "recall_nearest@1": 2 / 6,
        "recall_nearest@5": 3 / 6,
        "node_accuracy": 2 / 4,
        "room_accuracy": 2 / 3,
        "heading_error_median": None,
        "right": 2,
        "wrong": 2,
        "rightly_refused": 1,
        "wrongly_refused": 1,
        # Covered: 0.2, 0.3, 0.4, 0.8; not covered: 0.5, 0.9: seven of eight pairs in order.
        "refusal_auc": 7 / 8,
        "compared_mean": 10,
        "milliseconds": 2,
    }
    assert measured.values.keys() == METRICS.keys()
    assert measured.values == pytest.approx(expected)
    assert {name: one.count for name, one in measured.proportions.items()} == {
        "coverage": 6,
        "recall@1": 6,
        "recall@5": 6,
        "recall@1%": 6,
        "recall_covered@1": 4,
        "recall_nearest@1": 6,
        "recall_nearest@5": 6,
        "node_accuracy": 4,
        "room_accuracy": 3,
    }
    low, high = measured.proportions["recall@1"].interval
    assert low < 2 / 6 < high


def test_a_hundredth_of_a_large_map_is_several_images():
    assert measure(answers(), 0.5, 301).values["recall@1%"] == pytest.approx(3 / 6)


def test_without_positions_only_what_needs_none_has_a_value():
    blind = [(node, None, None, None, None, None, room, best, doubt) for node, *_, room, best, doubt in ROWS]
    measured = measure(answers(blind), 0.5, 300)
    known = {name for name, value in measured.values.items() if value is not None}
    assert known == {"queries", "posed", "refused", "room_accuracy", "compared_mean", "milliseconds"}
    assert measured.values["posed"] == 0


def test_if_all_is_refused_nothing_is_divided_by_nothing():
    refused = [row for row in ROWS if row[0] is None]
    measured = measure(answers(refused), 0.5, 300)
    assert measured.values["error_mean"] is None
    assert measured.values["recall@1"] == 0.0
    assert measured.values["node_accuracy"] is None


def test_an_image_that_no_node_has_is_an_answer_all_the_same():
    """A map may have images without a node; the nearest image may be one of them."""
    one = answers(ROWS[:1]).with_columns(pl.lit(None, pl.Int32).alias("node"), pl.lit(None).alias("node_right"))
    measured = measure(one, 0.5, 300).values
    assert (measured["refused"], measured["recall@1"], measured["node_accuracy"]) == (0, 1.0, None)
