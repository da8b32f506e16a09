"""A comparison of methods as tables, and as plain values."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import polars as pl

from omnieval.comparison.methods import Comparison, Group
from omnieval.statistics.ranks import SIGNIFICANT
from omnieval.wording import value_text


def estimate_table(found: Comparison) -> pl.DataFrame:
    """Return one row per metric and group: the estimate, its interval, and the numbers of cases and finished runs."""
    rows = [
        {
            "metric": one.metric,
            **_key(found, one.group),
            "estimate": one.estimate.value,
            "low": one.estimate.low,
            "high": one.estimate.high,
            "n": one.estimate.n,
            "over": one.over,
            "finished": f"{one.finished}/{one.runs}",
        }
        for one in found.estimates
    ]
    return _table(rows, ("estimate", "low", "high"))


def difference_table(found: Comparison) -> pl.DataFrame:
    """Return a row per metric and two groups: the mean difference over shared cases, its interval, and the test."""
    rows = [
        {
            "metric": one.metric,
            "one": one.one.name,
            "minus": one.other.name,
            "difference": one.difference.mean.value,
            "low": one.difference.mean.low,
            "high": one.difference.mean.high,
            "pairs": one.difference.mean.n,
            "effect": one.difference.effect,
            "p": one.difference.p,
            "p_holm": one.p_holm,
        }
        for one in found.differences
    ]
    return _table(rows, ("difference", "low", "high", "effect", "p", "p_holm"))


def rank_table(found: Comparison) -> pl.DataFrame:
    """Return one row per metric and group: its mean rank, best first, and the sets that cannot be distinguished."""
    rows = []
    for one in found.ranks:
        for place in sorted(range(len(one.groups)), key=one.ranking.ranks.__getitem__):
            sets = [letter(number) for number, some in enumerate(one.alike) if place in some]
            rows.append(
                {
                    "metric": one.metric,
                    **_key(found, one.groups[place]),
                    "mean_rank": one.ranking.ranks[place],
                    "alike": " ".join(sets) or None,
                    "cases": one.ranking.cases,
                    "p_friedman": one.ranking.p,
                }
            )
    return _table(rows, ("mean_rank", "p_friedman"))


def letter(number: int) -> str:
    """Return the letter of a set of methods that are alike.

    Examples
    --------
    >>> letter(0), letter(25), letter(26)
    ('a', 'z', 'aa')
    """
    return chr(97 + number) if number < 26 else letter(number // 26 - 1) + letter(number % 26)


def as_plain(found: Comparison) -> dict[str, Any]:
    """Return a comparison as plain values for JSON."""
    ranks = [
        {
            "metric": one.metric,
            "groups": [
                {**dict(zip(found.by, group.key, strict=True)), "mean_rank": rank}
                for group, rank in zip(one.groups, one.ranking.ranks, strict=True)
            ],
            "alike": [list(some) for some in one.alike],
            "cases": one.ranking.cases,
            "p_friedman": one.ranking.p,
        }
        for one in found.ranks
    ]
    return {
        "by": list(found.by),
        "estimates": [
            {
                "metric": one.metric,
                **dict(zip(found.by, one.group.key, strict=True)),
                **dataclasses.asdict(one.estimate),
                "over": one.over,
                "finished": one.finished,
                "runs": one.runs,
            }
            for one in found.estimates
        ],
        "differences": [
            {
                "metric": one.metric,
                "one": dict(zip(found.by, one.one.key, strict=True)),
                "other": dict(zip(found.by, one.other.key, strict=True)),
                **dataclasses.asdict(one.difference.mean),
                "effect": one.difference.effect,
                "p": one.difference.p,
                "p_holm": one.p_holm,
            }
            for one in found.differences
        ],
        "ranks": ranks,
        "significant": SIGNIFICANT,
        "lacking": list(found.lacking),
    }


def _key(found: Comparison, group: Group) -> dict[str, str]:
    return {name: value_text(value) for name, value in zip(found.by, group.key, strict=True)}


def _table(rows: Sequence[dict[str, Any]], numbers: Sequence[str]) -> pl.DataFrame:
    return pl.DataFrame(list(rows), schema_overrides=dict.fromkeys(numbers, pl.Float64), infer_schema_length=None)
