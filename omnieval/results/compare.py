"""Runs beside each other: their figures in a table, and the first step at which two of them part."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import polars as pl

from omnieval.results.run_folder import Run
from omnieval.results.schemas import STEPS

_NOT_OF_THE_STEP = frozenset({"node_final", "placement", "forced", "milliseconds"})
"""What only the end tells, and what the clock says."""

AT_THE_STEP = tuple(name for name in STEPS if name not in _NOT_OF_THE_STEP)
"""The columns of a step that are settled when it is taken."""


@dataclass(frozen=True)
class Difference:
    """The first step at which two runs part.

    Attributes
    ----------
    frame
        Number of the step; of the first missing one where a run is a prefix of the other.
    file
        Its image.
    columns
        Both values of every column that differs there; empty where a run has ended.
    settings
        Both values of every parameter that differs between the runs.
    """

    frame: int
    file: str
    columns: dict[str, tuple[Any, Any]]
    settings: dict[str, tuple[Any, Any]]


def first_difference(one: Run, other: Run) -> Difference | None:
    """Return where two runs part, None if all their steps are equal to the bit."""
    left, right = one.steps.select(AT_THE_STEP), other.steps.select(AT_THE_STEP)
    shared = min(len(left), len(right))
    frame = _first_unequal(left.head(shared), right.head(shared))
    if frame is None and len(left) == len(right):
        return None
    settings = differing(_settings(one), _settings(other))
    if frame is None:
        longer = left if len(left) > shared else right
        return Difference(shared, longer["file"][shared], {}, settings)
    here, there = left.row(frame, named=True), right.row(frame, named=True)
    return Difference(frame, here["file"], differing(here, there), settings)


def compare(runs: Sequence[Run]) -> pl.DataFrame:
    """Return one row a run: its folder, the parameters in which the runs differ, and all metrics."""
    settings = [_settings(run) for run in runs]
    varied = [name for name in settings[0] if any(one.get(name) != settings[0][name] for one in settings)]
    rows = [
        {
            "run": str(run.folder),
            "source": run.manifest["source"],
            "status": run.status,
            **{name: str(one.get(name)) for name in varied},
            **run.metrics,
        }
        for run, one in zip(runs, settings, strict=True)
    ]
    return pl.DataFrame(rows, infer_schema_length=None)


def differing(one: Mapping[str, Any], other: Mapping[str, Any]) -> dict[str, tuple[Any, Any]]:
    """Return both values of every key whose values differ."""
    keys = [*one, *(key for key in other if key not in one)]
    return {key: (one.get(key), other.get(key)) for key in keys if one.get(key) != other.get(key)}


def _first_unequal(left: pl.DataFrame, right: pl.DataFrame) -> int | None:
    """Return the first row at which two tables of equal shape differ, by bisection over prefixes."""
    if left.equals(right):
        return None
    equal, unequal = 0, len(left)
    while unequal - equal > 1:
        middle = (equal + unequal) // 2
        if left.slice(equal, middle - equal).equals(right.slice(equal, middle - equal)):
            equal = middle
        else:
            unequal = middle
    return equal


def _settings(run: Run) -> dict[str, Any]:
    return dict(_flattened(run.manifest["configuration"], ""))


def _flattened(content: Mapping[str, Any], prefix: str) -> Iterator[tuple[str, Any]]:
    for name, value in content.items():
        if isinstance(value, dict):
            yield from _flattened(value, "" if name == "mapper" else f"{prefix}{name}.")
        else:
            yield prefix + name, value
