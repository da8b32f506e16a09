"""The results of a check: one report per case, and the words and objects that say it."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from omnieval.errors import OmnievalError, RegressionError
from omnieval.regression.judge import Outcome
from omnieval.regression.trace import Parting

SCHEMA_VERSION = 1
_NAMED_FAILURES = 3


@dataclass(frozen=True)
class CaseReport:
    """One case and its replay.

    Attributes
    ----------
    name
        Of the case; of what was to be checked where the reference has no case for it.
    outcomes
        One a guarded value; empty where there is nothing to compare.
    error
        Why there is nothing to compare; None if there is.
    parting
        The first step decided otherwise than in the decision trace; None if there is none, or no trace.
    settings
        Parameters whose value was another when the reference was made: (then, now).
    notes
        What else explains a difference, one line each.
    seconds
        What the replay took; None where none was made.
    """

    name: str
    outcomes: tuple[Outcome, ...] = ()
    error: OmnievalError | None = None
    parting: Parting | None = None
    settings: dict[str, tuple[Any, Any]] = dataclasses.field(default_factory=dict)
    notes: tuple[str, ...] = ()
    seconds: float | None = None

    @property
    def fault(self) -> str | None:
        """Why there is nothing to compare, in words."""
        return None if self.error is None else str(self.error)

    @property
    def worse(self) -> bool:
        """Whether the maps are worse than the reference says, or there is no reference for them."""
        return isinstance(self.error, RegressionError) or any(outcome.failed for outcome in self.outcomes)

    @property
    def failed(self) -> bool:
        """Whether the check fails for this report."""
        return self.error is not None or self.worse


def table_rows(reports: Sequence[CaseReport]) -> list[dict[str, str]]:
    """Return the table of expected, got, difference: one row per guarded value, as text."""
    return [row for report in reports for row in _rows(report)]


def explanations(report: CaseReport) -> Iterator[str]:
    """Yield lines that say what a report's numbers do not: faults, the first step that differs, and why."""
    if report.fault is not None:
        yield report.fault
    if parting := report.parting:
        image = f" ({parting.file})" if parting.file else ""
        yield f"step {parting.frame}{image} is the first that differs from the reference:"
        yield f"  expected {decision(parting.expected)}"
        yield f"  got      {decision(parting.got)}"
    for name, (then, now) in report.settings.items():
        yield f"{name} was {_or_none(then)} when the reference was made, is {_or_none(now)}"
    yield from report.notes


def decision(columns: dict[str, Any] | None) -> str:
    """Return a decision in words."""
    if columns is None:
        return "no such step: it has ended"
    node = "no node" if columns["node"] is None else f"node {columns['node']}"
    best = "" if columns["best_frame"] is None else f", best match frame {columns['best_frame']}"
    return f"{columns['verdict']}, {node}{best}"


def failure(reports: Sequence[CaseReport], reference: Path) -> OmnievalError | None:
    """Return the error that a check ends in; None if it passes.

    Maps that are worse come before cases that could not be replayed, which are no regression.
    """
    if not any(report.failed for report in reports):
        return None
    lines = [line for report in reports for line in _failures(report)]
    named = "; ".join(lines[:_NAMED_FAILURES])
    more = f"; and {len(lines) - _NAMED_FAILURES} more" if len(lines) > _NAMED_FAILURES else ""
    if any(report.worse for report in reports):
        return RegressionError(f"{reference} is not met: {named}{more}; if this is intended, accept it with --update")
    worst = max((report.error for report in reports if report.error), key=lambda error: error.exit_code)
    return type(worst)(f"{reference} could not be checked: {named}{more}")


def as_object(reports: Sequence[CaseReport], reference: Path) -> dict[str, Any]:
    """Return the whole check as plain values for JSON."""
    return {
        "schema_version": SCHEMA_VERSION,
        "reference": str(reference),
        "ok": not any(report.failed for report in reports),
        "cases": [
            {
                "case": report.name,
                "ok": not report.failed,
                "fault": report.fault,
                "seconds": report.seconds,
                "values": [
                    {**dataclasses.asdict(outcome), "difference": outcome.difference} for outcome in report.outcomes
                ],
                "first_difference": dataclasses.asdict(report.parting) if report.parting else None,
                "parameters": {name: {"then": then, "now": now} for name, (then, now) in report.settings.items()},
                "notes": list(report.notes),
            }
            for report in reports
        ],
    }


def number(metric: str, value: float | None, *, sign: str = "") -> str:
    """Return the value of a metric as text: whole for nodes, else with four decimals."""
    if value is None:
        return "null"
    if metric == "nodes":
        return f"{int(value):{sign}d}"
    return f"{round(value, 4) + 0.0:{sign}.4f}"  # Adding zero makes -0.0 plain 0.0.


def got(outcome: Outcome) -> str:
    """Return what a replay came to as text, with its interval where that is guarded."""
    value = number(outcome.metric, outcome.got)
    return value if outcome.interval is None else "{} [{:.4g}, {:.4g}]".format(value, *outcome.interval)


def failure_line(name: str, outcome: Outcome) -> str:
    """Return what failed in a few words."""
    expected = number(outcome.metric, outcome.expected)
    return f"{outcome.metric} of {name} is {got(outcome)}, expected {expected} (allowed {outcome.allowed})"


def _failures(report: CaseReport) -> Iterator[str]:
    if report.fault is not None:
        yield f"{report.name}: {report.fault}"
    yield from (failure_line(report.name, outcome) for outcome in report.outcomes if outcome.failed)


def _or_none(value: Any) -> str:
    return "not set" if value is None else str(value)


def _rows(report: CaseReport) -> Iterator[dict[str, str]]:
    for outcome in report.outcomes:
        metric = outcome.metric
        yield {
            "case": report.name,
            "metric": metric,
            "expected": number(metric, outcome.expected),
            "allowed": outcome.allowed,
            "got": got(outcome),
            "difference": number(metric, outcome.difference, sign="+"),
            "judgement": outcome.judgement,
        }
    if report.fault is not None:
        blank = dict.fromkeys(("metric", "expected", "allowed", "got", "difference"), "-")
        yield {"case": report.name, **blank, "judgement": "missing"}
