"""Methods beside each other: what is a pair, what is counted, and what is said of runs that did not finish."""

import pytest

from omnieval.comparison.methods import better, compare_methods
from omnieval.comparison.records import Record
from omnieval.comparison.tables import as_plain, difference_table, estimate_table, rank_table
from omnieval.errors import ConfigError
from omnieval.localization.measures import METRICS as FINDING
from omnieval.metrics.catalogue import METRICS


def record(mapper, case, value, **labels):
    finished = value != "failed"
    metrics = {"pair_f1": value, "nodes": 5} if finished else {}
    return Record({"mapper": mapper, "descriptor": "hog", **labels}, (case,), metrics, finished)


def runs(values):
    return [record(mapper, case, value) for mapper, some in values.items() for case, value in enumerate(some)]


THREE = {
    "ours": [0.9, 0.8, 0.7, 0.9, 0.85, 0.95],
    "theirs": [0.5, 0.6, 0.2, "failed", 0.4, 0.3],
    "control": [0.1, 0.2, 0.1, 0.3, None, 0.2],
}


def test_estimates_say_over_how_many_and_how_many_finished():
    found = compare_methods(runs(THREE), ["mapper"], ["pair_f1"])
    rows = {row["mapper"]: row for row in estimate_table(found).iter_rows(named=True)}
    assert rows["ours"]["estimate"] == pytest.approx(0.85)
    assert (rows["ours"]["n"], rows["ours"]["finished"]) == (6, "6/6")
    assert (rows["theirs"]["n"], rows["theirs"]["finished"]) == (5, "5/6")
    assert (rows["control"]["n"], rows["control"]["finished"]) == (5, "6/6")
    assert rows["ours"]["low"] < 0.85 < rows["ours"]["high"]


def test_pairs_are_where_both_have_a_value():
    found = compare_methods(runs(THREE), ["mapper"], ["pair_f1"])
    rows = {(row["one"], row["minus"]): row for row in difference_table(found).iter_rows(named=True)}
    assert rows["ours", "theirs"]["pairs"] == 5
    assert rows["theirs", "control"]["pairs"] == 4
    assert rows["ours", "theirs"]["difference"] == pytest.approx((0.4 + 0.2 + 0.5 + 0.45 + 0.65) / 5)
    assert rows["ours", "theirs"]["effect"] == 1.0
    assert rows["ours", "theirs"]["p"] == pytest.approx(2 / 2**5)
    assert rows["ours", "theirs"]["p_holm"] == pytest.approx(3 * 2 / 2**5)


def test_ranks_are_over_cases_that_all_have():
    found = compare_methods(runs(THREE), ["mapper"], ["pair_f1"])
    rows = list(rank_table(found).iter_rows(named=True))
    assert [(row["mapper"], row["mean_rank"]) for row in rows] == [("ours", 1.0), ("theirs", 2.0), ("control", 3.0)]
    assert {row["cases"] for row in rows} == {4}
    assert {row["alike"] for row in rows} == {"a"}  # four cases are too few to tell


def test_several_runs_on_one_case_are_one_value_and_none_if_one_failed():
    some = [record("ours", 0, 0.2), record("ours", 0, 0.4), record("ours", 1, 0.9), record("ours", 1, "failed")]
    (estimate,) = compare_methods(some, ["mapper"], ["pair_f1"]).estimates
    assert estimate.estimate.value == pytest.approx(0.3)
    assert estimate.estimate.n == 1
    assert (estimate.finished, estimate.runs) == (3, 4)


def test_what_is_varied_is_paired_unless_it_tells_the_methods_apart():
    some = [
        Record({"mapper": mapper, "omega": omega}, ("a",), {"pair_f1": value}, True, ("omega",))
        for mapper, omega, value in (("m", 1, 0.1), ("m", 2, 0.4), ("n", 1, 0.2), ("n", 2, 0.8))
    ]
    (mappers,) = compare_methods(some, ["mapper"], ["pair_f1"]).differences
    assert mappers.difference.mean.n == 2  # at either omega
    (omegas,) = compare_methods(some, ["omega"], ["pair_f1"]).differences
    assert omegas.difference.mean.n == 1  # on the one sequence, the mean over the mappers
    assert omegas.difference.mean.value == pytest.approx(0.15 - 0.6)


def test_the_order_of_runs_is_of_no_account():
    one = as_plain(compare_methods(runs(THREE), ["mapper"], ["pair_f1"]))
    other = as_plain(compare_methods(runs(dict(reversed(THREE.items()))), ["mapper"], ["pair_f1"]))
    assert sorted(map(repr, one["estimates"])) == sorted(map(repr, other["estimates"]))


def test_a_metric_without_a_better_way_has_no_ranks():
    found = compare_methods(runs(THREE), ["mapper"], ["nodes"])
    assert found.ranks == ()
    assert any("nodes: no ranks" in line for line in found.lacking)


@pytest.mark.parametrize(
    ("by", "metric", "words"),
    [(["maper"], ["pair_f1"], "did you mean mapper"), (["mapper"], ["pair_f2"], "did you mean pair_f1")],
)
def test_unknown_names_get_a_hint(by, metric, words):
    with pytest.raises(ConfigError, match=words):
        compare_methods(runs(THREE), by, metric)


def test_of_every_metric_it_is_said_which_way_is_better():
    lower = {"error_mean", "error_median", "error_p95", "heading_error_median", "refused", "milliseconds"}
    assert {name for name in FINDING if better(name) == "lower"} >= lower
    assert better("recall@1") == better("room_accuracy") == "higher"
    assert better("false_merge_share") == "lower"
    assert all(better(name) in ("higher", "lower", None) for name in METRICS)
