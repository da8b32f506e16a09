"""The localisations of a reference: images of other sequences looked for in the map that a case has just made."""

from __future__ import annotations

import dataclasses
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from typing import Any

from omnieval.errors import OmnievalError, RegressionError, ResultError
from omnieval.localization.intervals import intervals_of_answers
from omnieval.localization.run import Localization, localize
from omnieval.localization.strategies import LEVELS, NEAREST, has_levels
from omnieval.regression.case_report import CaseReport
from omnieval.regression.cases import Progress, canonical_source
from omnieval.regression.guarded import Guard, LocalizationCase, LocalizationMade, better_of_localization
from omnieval.regression.judge import judge_guards
from omnieval.results.run_folder import Run
from omnieval.statistics.estimate import Estimate

TOLERANCES = {"recall@1": 0.05, "error_mean": 0.1, "node_accuracy": 0.05}
"""What a localisation guards unless its reference says otherwise, and by how much each may be worse."""


@dataclass(frozen=True)
class Answers:
    """The results of one localisation: metrics by strategy, their intervals where asked for, and how it was made."""

    metrics: dict[str, dict[str, float | int | None]]
    within: dict[str, dict[str, Estimate]]
    made: LocalizationMade


def answers_of(
    cases: Sequence[LocalizationCase], run: Run, progress: Progress | None = None, *, intervals: bool = False
) -> dict[str, Answers | OmnievalError]:
    """Look for the queries of some localisations in the map of a run.

    Parameters
    ----------
    cases
        The localisations.
    run
        A run with a map.
    progress
        Called with (answers so far, answers in all).
    intervals
        Whether the intervals of all guarded metrics are needed, not of those alone that are guarded by theirs.

    Returns
    -------
    The results of each, by name, or why there are none.
    """
    alike = groupby(sorted(cases, key=_manner), key=_manner)
    return {
        name: found
        for _, group in alike
        for name, found in _together(list(group), run, progress, intervals=intervals).items()
    }


def reports_of(cases: Sequence[LocalizationCase], run: Run, progress: Progress | None = None) -> Iterator[CaseReport]:
    """Yield what a check says of localisations in the map of a run, in their order."""
    answered = answers_of([case for case in cases if any(case.expected.values())], run, progress)
    for case in cases:
        found = answered.get(case.name)
        if found is None:
            error = RegressionError(
                "nothing is expected of it yet, so it guards nothing; accept what is found with --update"
            )
            yield CaseReport(case.name, error=error)
        elif isinstance(found, OmnievalError):
            yield CaseReport(case.name, error=type(found)(f"cannot be localised: {found}"))
        else:
            yield _judged(case, found)


def renewed(case: LocalizationCase, found: Answers, *, intervals: bool = False) -> LocalizationCase:
    """Return a localisation that expects what was found; guarded metrics stay, and how they are, see `Guard.renewed`.

    Raises
    ------
    ResultError
        If none of its metrics has a value.
    """
    expected = {
        strategy: {
            name: guard.renewed(value, found.within[strategy].get, name, intervals=intervals)
            for name, guard in (case.expected.get(strategy) or _default_guards()).items()
            if (value := metrics.get(name)) is not None
        }
        for strategy, metrics in found.metrics.items()
    }
    if not any(expected.values()):
        raise ResultError(f"{case.name} guards nothing that has a value; are there true positions of {case.query}?")
    made = found.made
    if case.made and made.model_copy(update={"date": case.made.date}) == case.made:
        made = case.made
    return case.model_copy(update={"expected": expected, "made": made})


def _manner(case: LocalizationCase) -> tuple[Any, ...]:
    """Return what localisations have in common that are answered in one go, for which the mapper maps only once."""
    cut = case.cut
    return tuple(case.expected), case.within, cut.start, cut.stride, -1 if cut.limit is None else cut.limit


def _together(
    cases: Sequence[LocalizationCase], run: Run, progress: Progress | None, *, intervals: bool
) -> dict[str, Answers | OmnievalError]:
    first = cases[0]
    try:
        with tempfile.TemporaryDirectory(prefix="omnieval-check-") as temporary:
            answered = localize(
                run,
                *(canonical_source(case.query) for case in cases),
                strategies=tuple(first.expected) or _default_strategies(run),
                within=first.within,
                **dataclasses.asdict(first.cut),
                out=Path(temporary) / "found",
                progress=progress,
            )
            found = answered.manifest
            within = [
                _within(answered, query["sequence"], case, intervals=intervals)
                for case, query in zip(cases, found["queries"], strict=True)
            ]
    except OmnievalError as error:
        if len(cases) == 1:
            return {first.name: error}
        # One query that cannot be read hides no other.
        return {
            name: one for case in cases for name, one in _together([case], run, progress, intervals=intervals).items()
        }
    return {
        case.name: Answers(
            found["metrics"][query["sequence"]],
            of_case,
            LocalizationMade(
                date=found["finished"],
                code=found["code"],
                dataset_fingerprint=query["dataset_fingerprint"],
                map_digest=found["map"]["digest"],
            ),
        )
        for case, query, of_case in zip(cases, found["queries"], within, strict=True)
    }


def _within(
    answered: Localization, sequence: str, case: LocalizationCase, *, intervals: bool
) -> dict[str, dict[str, Estimate]]:
    """Return the intervals that a case needs, by strategy and metric."""
    found: dict[str, dict[str, Estimate]] = {}
    for strategy in answered.manifest["strategies"]:
        within = intervals_of_answers(answered, sequence, strategy)
        guards = case.expected.get(strategy) or _default_guards()
        needed = [name for name, guard in guards.items() if intervals or guard.interval is not None]
        found[strategy] = {name: estimate for name in needed if (estimate := within(name)) is not None}
    return found


def _default_strategies(run: Run) -> tuple[str, ...]:
    return (LEVELS, NEAREST) if has_levels(run.config.mapper) else (NEAREST,)


def _default_guards() -> dict[str, Guard]:
    return {
        name: Guard(value=0.0, tolerance=tolerance, better=better_of_localization(name))
        for name, tolerance in TOLERANCES.items()
    }


def _judged(case: LocalizationCase, found: Answers) -> CaseReport:
    outcomes = tuple(
        dataclasses.replace(outcome, metric=f"{strategy} {outcome.metric}")
        for strategy, guards in case.expected.items()
        for outcome in judge_guards(guards, found.metrics[strategy], found.within[strategy].get)
    )
    return CaseReport(case.name, outcomes, notes=tuple(_changes(case, found, explain=any(x.failed for x in outcomes))))


def _changes(case: LocalizationCase, found: Answers, *, explain: bool) -> Iterator[str]:
    """Yield what is not as it was when the reference was made; the map only where there is something to explain."""
    if case.made is None:
        return
    if found.made.dataset_fingerprint != case.made.dataset_fingerprint:
        yield "images, poses or labels are not those that the reference was made with"
    if explain and found.made.map_digest != case.made.map_digest:
        yield f"the map of {case.map} has changed since the reference was made"
