"""The true path of a run in the format of the TUM RGB-D benchmark, which evo reads.

A line per frame: ``timestamp x y z qx qy qz qw``, seconds and metres, ``z`` 0, the heading as a rotation about z. Lines
that begin with ``#`` say what the numbers alone do not.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import polars as pl

from omnieval.errors import ResultError

_NANOSECONDS = 1_000_000_000


def trajectory(steps: pl.DataFrame, name: str) -> tuple[str, tuple[str, ...]]:
    """Return the text, and what a reader must know of it, in sentences (which also stand at its head).

    Parameters
    ----------
    steps
        One row per frame (`schemas.STEPS`).
    name
        What to call the run.

    Raises
    ------
    ResultError
        If no frame has a true position.
    """
    posed = steps.drop_nulls(["x", "y"])
    if posed.is_empty():
        raise ResultError(f"a trajectory needs true positions, {name} has none; export graphml, json or csv")
    timed = posed["time"].null_count() == 0
    notes = tuple(_notes(len(steps), posed, timed=timed))
    head = [f"# {note}" for note in notes] + ["# timestamp x y z qx qy qz qw"]
    return "\n".join([*head, *_lines(posed, timed=timed)]) + "\n", notes


def _notes(frames: int, posed: pl.DataFrame, *, timed: bool) -> Iterator[str]:
    if len(posed) < frames:
        yield f"{frames - len(posed)} of {frames} images have no true position and are left out"
    if not timed:
        yield "not every image has a time: timestamps are frame numbers"
    if (unknown := posed["yaw"].null_count()) > 0:
        yield f"{unknown} of {len(posed)} headings are not known and stand as 0"


def _lines(posed: pl.DataFrame, *, timed: bool) -> Iterator[str]:
    columns = posed.select("frame", pl.col("time").cast(pl.Int64), "x", "y", pl.col("yaw").fill_null(0.0))
    for frame, time, x, y, yaw in columns.iter_rows():
        # As whole numbers: a float has no room for nanoseconds since 1970.
        stamp = f"{time // _NANOSECONDS}.{time % _NANOSECONDS:09d}" if timed else str(frame)
        yield f"{stamp} {x!r} {y!r} 0 0 0 {math.sin(yaw / 2)!r} {math.cos(yaw / 2)!r}"
