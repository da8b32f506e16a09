"""Groups of runs beside each other: estimates with intervals, paired differences, mean ranks."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from omnieval.comparison.records import Record
from omnieval.errors import ConfigError
from omnieval.localization.measures import METRICS as FINDING
from omnieval.metrics.catalogue import BY_NAME, UPKEEP
from omnieval.statistics.estimate import FEWEST, Estimate, mean_estimate
from omnieval.statistics.paired import Difference, holm, paired_difference
from omnieval.statistics.ranks import SIGNIFICANT, Ranking, cliques, mean_ranks
from omnieval.wording import did_you_mean, shown, value_text

BY = ("mapper", "descriptor")
METRICS = ("pair_f1", "reentry_f1", "false_merge_share", "silhouette")
"""The metrics that are compared by default."""
Over = Literal["cases", "images"]
_LOWER = (*UPKEEP, "seconds", "refused", "wrong", "wrongly_refused", "compared_mean", "milliseconds")
_NEITHER = ("queries", "posed", "coverage", "reachable_mean", "batch_silhouette", "smallest_margin")


@dataclass(frozen=True)
class Group:
    """Runs that are one method.

    Attributes
    ----------
    key
        The values of what runs are grouped by.
    records
        The runs.
    by
        What they are grouped by.
    """

    key: tuple[Any, ...]
    records: tuple[Record, ...]
    by: tuple[str, ...]

    @property
    def name(self) -> str:
        """Its name in tables: the values of what it is grouped by."""
        return " ".join(value_text(value) for value in self.key if value is not None) or "-"

    def values(self, metric: str) -> dict[tuple[Any, ...], float]:
        """Return the value of each case: the mean of its runs, of which all have finished and have one."""
        found: dict[tuple[Any, ...], list[float | None]] = {}
        for record in self.records:
            value = record.metrics.get(metric) if record.finished else None
            case = *record.case, *(record.labels[name] for name in record.varied if name not in self.by)
            found.setdefault(case, []).append(None if value is None else float(value))
        whole = {
            case: [one for one in values if one is not None] for case, values in found.items() if None not in values
        }
        return {case: math.fsum(values) / len(values) for case, values in whole.items()}


@dataclass(frozen=True)
class GroupEstimate:
    """A metric of a group.

    Attributes
    ----------
    group, metric
        Whose and what.
    estimate
        The mean over cases, or of one run the value over its images, with its interval.
    over
        What was resampled: cases, or blocks of images of the one run.
    finished, runs
        How many runs finished, and how many there are.
    """

    group: Group
    metric: str
    estimate: Estimate
    over: Over
    finished: int
    runs: int


@dataclass(frozen=True)
class GroupDifference:
    """A metric of one group minus that of another, over the cases that both have; `p_holm` within the metric."""

    one: Group
    other: Group
    metric: str
    difference: Difference
    p_holm: float | None


@dataclass(frozen=True)
class GroupRanks:
    """The groups ranked by a metric, over the cases that all have; in the order of `groups`.

    `alike` are the largest sets of neighbours of which no two differ significantly (Wilcoxon-Holm, 0.05).
    """

    metric: str
    groups: tuple[Group, ...]
    ranking: Ranking
    alike: tuple[tuple[int, ...], ...]


@dataclass(frozen=True)
class Comparison:
    """The estimates of groups of runs beside each other; `lacking` says why something is not there."""

    by: tuple[str, ...]
    estimates: tuple[GroupEstimate, ...]
    differences: tuple[GroupDifference, ...]
    ranks: tuple[GroupRanks, ...]
    lacking: tuple[str, ...]


def compare_methods(
    records: Sequence[Record], by: Sequence[str] = BY, metrics: Sequence[str] = METRICS, *, seed: int = 0
) -> Comparison:
    """Group runs and compare the groups.

    Parameters
    ----------
    records
        The runs.
    by
        Names of labels: runs in which they are equal are one group.
    metrics
        What to compare.
    seed
        Root seed of the intervals.

    Raises
    ------
    ConfigError
        If no run has a label or a metric of such a name.
    """
    _check(by, {name for record in records for name in record.labels}, "are not distinguished by")
    _check(metrics, {name for record in records for name in record.metrics} or set(METRICS), "have no metric")
    grouped: dict[tuple[Any, ...], list[Record]] = {}
    for record in records:
        grouped.setdefault(tuple(record.labels.get(name) for name in by), []).append(record)
    groups = tuple(Group(key, tuple(some), tuple(by)) for key, some in grouped.items())
    estimates, differences, ranks, lacking = [], [], [], []
    for metric in metrics:
        # A run that does not have the metric at all, such as one that localises nothing, is none of its runs.
        having = tuple(group for group in (_having(group, metric) for group in groups) if group is not None)
        values = [group.values(metric) for group in having]
        estimates += [_estimate(group, metric, own, seed) for group, own in zip(having, values, strict=True)]
        some = _differences(having, values, metric, seed)
        differences += some
        found = _ranks(having, values, metric, some)
        if isinstance(found, str):
            lacking.append(f"{metric}: no ranks, {found}")
        elif found is not None:
            ranks.append(found)
    lacking += _no_intervals(estimates)
    return Comparison(tuple(by), tuple(estimates), tuple(differences), tuple(ranks), tuple(dict.fromkeys(lacking)))


def better(metric: str) -> Literal["higher", "lower"] | None:
    """Return which way a metric is better; None where neither is."""
    if metric in BY_NAME:
        return BY_NAME[metric].better
    if metric in _NEITHER:
        return None
    if metric in FINDING or metric in _LOWER:
        return "lower" if metric in _LOWER or "error" in metric else "higher"
    return None


def _check(names: Sequence[str], known: set[str], what: str) -> None:
    for name in names:
        if name not in known:
            raise ConfigError(f"the runs {what} {shown(name)}; {did_you_mean(name, sorted(known))}")
    if twice := [name for name in names if list(names).count(name) > 1]:
        raise ConfigError(f"{twice[0]} is named twice; name it once")


def _having(group: Group, metric: str) -> Group | None:
    own = tuple(one for one in group.records if not one.finished or metric in one.metrics)
    return Group(group.key, own, group.by) if any(one.finished for one in own) or own == group.records else None


def _estimate(group: Group, metric: str, values: Mapping[tuple[Any, ...], float], seed: int) -> GroupEstimate:
    finished = [record for record in group.records if record.finished]
    estimate, over = mean_estimate(np.array(list(values.values())), seed=seed), "cases"
    if len(group.records) == 1 and (inside := group.records[0].within(metric)) is not None:
        estimate, over = inside, "images"
    return GroupEstimate(group, metric, estimate, over, len(finished), len(group.records))  # type: ignore[arg-type]


def _differences(
    groups: Sequence[Group], values: Sequence[Mapping[tuple[Any, ...], float]], metric: str, seed: int
) -> list[GroupDifference]:
    pairs = list(itertools.combinations(range(len(groups)), 2))
    found = []
    for one, other in pairs:
        shared = [case for case in values[one] if case in values[other]]
        sides = [np.array([values[side][case] for case in shared]) for side in (one, other)]
        found.append(paired_difference(*sides, seed=seed))
    adjusted = holm([difference.p for difference in found])
    return [
        GroupDifference(groups[one], groups[other], metric, difference, p)
        for (one, other), difference, p in zip(pairs, found, adjusted, strict=True)
    ]


def _ranks(
    groups: Sequence[Group],
    values: Sequence[Mapping[tuple[Any, ...], float]],
    metric: str,
    differences: Sequence[GroupDifference],
) -> GroupRanks | str | None:
    if len(groups) < 2:
        return None
    way = better(metric)
    if way is None:
        return "it has no better direction"
    shared = [case for case in values[0] if all(case in own for own in values[1:])]
    if not shared:
        return "no case was finished by all with a value"
    table = np.array([[own[case] for own in values] for case in shared])
    ranking = mean_ranks(table, higher_is_better=way == "higher")
    apart = np.zeros((len(groups), len(groups)), np.bool_)
    for (one, other), difference in zip(itertools.combinations(range(len(groups)), 2), differences, strict=True):
        p = difference.p_holm
        apart[one, other] = apart[other, one] = p is not None and p < SIGNIFICANT
    return GroupRanks(metric, tuple(groups), ranking, tuple(cliques(ranking.ranks, apart)))


def _no_intervals(estimates: Sequence[GroupEstimate]) -> list[str]:
    few = any(one.estimate.value is not None and one.estimate.low is None for one in estimates)
    what = f"an interval needs {FEWEST} cases or more, or one run of 50 s or more whose metric is over its images"
    return [what] if few else []
