"""What a metric is: its declaration, and the map and the truth that it may look at."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Better = Literal["higher", "lower"]


@dataclass(frozen=True)
class Judged:
    """A map as a metric sees it: the node of each of n images, and what is true of them.

    Attributes
    ----------
    labels
        Node of every image, 0 where it has none, shape (n,).
    positions
        Where each was truly taken, shape (n, 2), metres, NaN where that is not known.
    rooms
        Room of each image, None where it has no label, length n.
    times
        Nanoseconds at which each was taken, None where that is not known, length n.
    """

    labels: NDArray[np.int64]
    positions: NDArray[np.float64]
    rooms: Sequence[str | None]
    times: Sequence[int | None]


@dataclass(frozen=True)
class Metric:
    """A metric.

    Attributes
    ----------
    name
        In ``run.json`` and as a column.
    group
        What it judges.
    meaning
        In a few words.
    formula
        How it is computed.
    source
        Who proposed it.
    better
        Which way is better; None where neither is.
    unit
        Empty for plain numbers.
    whole
        Whether it is a whole number.
    of
        Its name in ``quality.parquet``; None where it is not there.
    at
        The distance that it is taken at, metres; None where it has none.
    compute
        Returns its value, or the sentence that says why there is none. None for metrics that are computed together with
        others (`evaluation`, `quality`).
    """

    name: str
    group: str
    meaning: str
    formula: str
    source: str = "omnieval"
    better: Better | None = "higher"
    unit: str = ""
    whole: bool = False
    of: str | None = None
    at: float | None = None
    compute: Callable[[Judged], float | int | str] | None = None
