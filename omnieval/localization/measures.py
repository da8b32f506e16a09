"""The metrics of localisation: of the answers of one strategy to the images of one sequence.

Refusals count as misses.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import polars as pl

from omnieval.mapping.step import Role
from omnieval.metrics.proportion import Proportion


@dataclass(frozen=True)
class Measures:
    """Metrics by name, null where they have no value; of those that are proportions, what they are of.

    Attributes
    ----------
    values
        Every metric of `METRICS`.
    proportions
        Those that are shares of cases.
    """

    values: dict[str, float | int | None]
    proportions: dict[str, Proportion]


METRICS: dict[str, str] = {
    "queries": "images asked for",
    "posed": "of them, those whose true position is known",
    "refused": "of them, those that the strategy refused",
    "error_mean": "mean distance of the best image from the true position, over what was not refused, metres",
    "error_median": "its median, metres",
    "error_p95": "its 95th percentile, metres",
    "reachable_mean": "mean distance of the map's nearest image from the true position, over the same, metres",
    "coverage": "share of posed queries within theta of an image of the map",
    "recall@1": "share of posed queries whose best image is within theta",
    "recall@5": "share of posed queries with an image within theta among the five most similar",
    "recall@1%": "the same among the most similar hundredth of the map",
    "recall_covered@1": "recall@1 of the queries that the map covers",
    "recall_nearest@1": "share of posed queries whose best image is the map's nearest",
    "recall_nearest@5": "share of posed queries whose best image is among the map's five nearest",
    "node_accuracy": "share of queries located in a node that are within theta of one of its images",
    "room_accuracy": "share of located queries whose best image is in the same room",
    "heading_error_median": "median error of the heading, degrees",
    "right": "open set: located within theta",
    "wrong": "open set: located elsewhere",
    "rightly_refused": "open set: refused, and not covered by the map",
    "wrongly_refused": "open set: refused, though covered by the map",
    "refusal_auc": "chance that a covered query has less doubt than one that is not: area under the ROC curve",
    "compared_mean": "images a query was compared with, mean",
    "milliseconds": "time a query took, mean; without describing it",
}
"""Every metric and its meaning; theta is what `--within` says."""
LOWER_IS_BETTER = frozenset(
    {
        *("refused", "error_mean", "error_median", "error_p95", "heading_error_median"),
        *("wrong", "wrongly_refused", "compared_mean", "milliseconds"),
    }
)
"""The metrics of which less is better; of all others, more."""


def measure(answers: pl.DataFrame, theta: float, images: int) -> Measures:
    """Return the metrics of some answers.

    Parameters
    ----------
    answers
        Rows of `table.QUERIES`, of one sequence and one strategy.
    theta
        Two images at most this far apart show the same place.
    images
        Number of images in the map.
    """
    posed = answers.filter(pl.col("reachable").is_not_null())
    refused = pl.col("role") == Role.REFUSED.value
    found = ~refused
    located = answers.filter(found)
    judged = posed.filter(pl.col("error").is_not_null())
    values: dict[str, Any] = dict.fromkeys(METRICS)
    values |= {
        "queries": len(answers),
        "posed": len(posed),
        "refused": len(answers) - len(located),
        "heading_error_median": _of(answers["heading_error"], "median"),
        "compared_mean": _of(answers["compared"], "mean"),
        "milliseconds": _of(answers["milliseconds"], "mean"),
    }
    proportions = _shares_of_rooms(located)
    if len(posed):
        near, error, reachable, rank = pl.col("error") <= theta, judged["error"], posed["reachable"], pl.col("rank")
        covered = posed.filter(pl.col("reachable") <= theta)
        outside = pl.col("reachable") > theta
        values |= {
            "error_mean": _of(error, "mean"),
            "error_median": _of(error, "median"),
            "error_p95": float(np.percentile(error.to_numpy(), 95)) if len(error) else None,
            "reachable_mean": _of(judged["reachable"], "mean"),
            "right": _count(posed, found & near),
            "wrong": _count(posed, found & ~near.fill_null(value=False)),
            "rightly_refused": _count(posed, refused & outside),
            "wrongly_refused": _count(posed, refused & ~outside),
            "refusal_auc": _auc(posed, theta),
        }
        hundredth = max(1, math.ceil(images / 100))
        shares = {
            "coverage": _share(posed, pl.lit(reachable <= theta)),
            "recall@1": _share(posed, found & near),
            "recall@5": _share(posed, found & (rank <= 5)),
            "recall@1%": _share(posed, found & (rank <= hundredth)),
            "recall_covered@1": _share(covered, found & near),
            "recall_nearest@1": _share(posed, found & (pl.col("nearest_rank") <= 1)),
            "recall_nearest@5": _share(posed, found & (pl.col("nearest_rank") <= 5)),
            "node_accuracy": _share(posed.filter(found & pl.col("node").is_not_null()), pl.col("node_right")),
        }
        proportions |= {name: share for name, share in shares.items() if share is not None}
    values |= {name: one.value for name, one in proportions.items()}
    return Measures(values, proportions)


def _shares_of_rooms(located: pl.DataFrame) -> dict[str, Proportion]:
    known = located.filter(pl.col("room").is_not_null() & pl.col("best_room").is_not_null())
    share = _share(known, pl.col("room") == pl.col("best_room"))
    return {} if share is None else {"room_accuracy": share}


def _share(answers: pl.DataFrame, condition: pl.Expr) -> Proportion | None:
    return Proportion(_count(answers, condition), len(answers)) if len(answers) else None


def _count(answers: pl.DataFrame, condition: pl.Expr) -> int:
    return int(answers.select(condition.fill_null(value=False).sum()).item())


def _of(values: pl.Series, what: str) -> float | None:
    value = getattr(values, what)()
    return None if value is None else float(value)


def _auc(posed: pl.DataFrame, theta: float) -> float | None:
    """Return the area under the ROC curve; None where all queries are covered, or none is."""
    from sklearn.metrics import roc_auc_score

    told = posed.filter(pl.col("doubt").is_not_null())
    outside = (told["reachable"] > theta).to_numpy()
    if outside.all() or not outside.any():
        return None
    return float(roc_auc_score(outside, told["doubt"].to_numpy()))
