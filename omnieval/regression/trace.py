"""The decision trace of a case: what was decided about every image, in a few kilobytes.

It explains and never judges: on another machine, or with other versions of the libraries, a decision whose margin is
tiny may differ while the map is as good as before. The metrics decide.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import polars as pl

from omnieval.errors import ResultError
from omnieval.results.atomic import write_table
from omnieval.results.schemas import STEPS

DECISION = ("frame", "verdict", "node", "best_frame")
"""The columns of a trace, as in ``steps.parquet``."""
_SCHEMA = pl.Schema({name: STEPS[name] for name in DECISION})


@dataclass(frozen=True)
class Parting:
    """The first step at which a replay decides otherwise than the reference.

    Attributes
    ----------
    frame
        Number of the step.
    file
        Its image; None where the replay has ended.
    expected, got
        The decision (`DECISION` without the frame); None on the side that has ended.
    """

    frame: int
    file: str | None
    expected: dict[str, Any] | None
    got: dict[str, Any] | None


def write_trace(steps: pl.DataFrame, path: Path) -> None:
    """Write the trace of a steps table.

    Raises
    ------
    ResultError
        If it cannot be written.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ResultError(f"cannot write {path.parent}: {error.strerror}; choose another --reference") from error
    write_table(steps.select(DECISION), path)


def read_trace(path: Path) -> pl.DataFrame:
    """Read a trace, one row per step.

    Raises
    ------
    ResultError
        If it cannot be read or is not a trace.
    """
    try:
        trace = pl.read_parquet(path)
    except (OSError, pl.exceptions.PolarsError) as error:
        raise ResultError(f"cannot read the decision trace {path}: {error}; make it again with --update") from error
    if trace.schema != _SCHEMA:
        raise ResultError(f"{path} is not a decision trace: its columns are {', '.join(trace.columns)}")
    return trace


def first_parting(trace: pl.DataFrame, steps: pl.DataFrame) -> Parting | None:
    """Return the first step at which `steps` decides otherwise than `trace`, None if there is none."""
    shared = min(len(trace), len(steps))
    expected, got = trace.head(shared), steps.select(DECISION).head(shared)
    unequal = pl.Series([False] * shared, dtype=pl.Boolean)
    for name in DECISION:
        unequal |= expected[name].ne_missing(got[name])
    if unequal.any():
        frame = unequal.arg_max()
    elif len(trace) != len(steps):
        frame = shared
    else:
        return None
    assert frame is not None
    return Parting(
        frame=frame,
        file=steps["file"][frame] if frame < len(steps) else None,
        expected=_decision(trace, frame),
        got=_decision(steps, frame),
    )


def _decision(table: pl.DataFrame, frame: int) -> dict[str, Any] | None:
    return table.select(DECISION[1:]).row(frame, named=True) if frame < len(table) else None
