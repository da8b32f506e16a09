"""The plan of an ablation: every job, and what a table that is resumed must have in common with it."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from omnieval.ablation.grid import Axis, Span, configurations, flattened, value_of
from omnieval.ablation.jobs import Job
from omnieval.config import Config, Setting
from omnieval.datasets import Sequence as ImageSequence
from omnieval.datasets import load
from omnieval.errors import ConfigError, DatasetError
from omnieval.imaging.soundness import without_bad


@dataclass(frozen=True)
class Plan:
    """A validated ablation.

    Attributes
    ----------
    jobs
        In the order of the grid: source by source, the last axis varying fastest.
    varied
        Names of the parameters that are varied.
    grid
        What determines the jobs, as plain JSON values: sources, cut, axes with their values, and the other parameters.
    exact
        The parameter that takes all values of an interval in every job; None for a grid of points.
    """

    jobs: tuple[Job, ...]
    varied: tuple[str, ...]
    grid: dict[str, Any]
    exact: Span | None = None


def make_plan(
    sources: Sequence[str | Path | ImageSequence],
    axes: Sequence[Axis],
    settings: Sequence[Setting] = (),
    *,
    exact: Span | None = None,
    preset: str | None = None,
    start: int = 0,
    stride: int = 1,
    limit: int | None = None,
    skip_bad: bool = False,
) -> Plan:
    """Validate grid and sources whole, and lay out the jobs.

    No image is read, unless those that are not fit for use are to be left out (`skip_bad`).

    Raises
    ------
    ConfigError
        One line with every fault of the grid, or if a sequence is named twice or too short.
    DatasetError
        One line with every fault of the sources.
    """
    configs = configurations(axes, settings, preset, exact=exact)  # first: a source may have to be rendered
    faults: list[DatasetError] = []
    sequences: list[ImageSequence] = []
    skipped: dict[str, list[str]] = {}
    for source in sources or ("synthetic",):
        try:
            sequence = source if isinstance(source, ImageSequence) else load(source)
            sequence = sequence.cut(start=start, stride=stride, limit=limit)
            if skip_bad:
                sequence, left_out = without_bad(sequence)
                skipped[sequence.source] = [bad.file for bad in left_out]
            sequences.append(sequence)
        except DatasetError as error:
            faults.append(error)
    if misfits := [*_twice(sequences), *_too_short(sequences, configs)]:
        raise ConfigError("; ".join([*misfits, *map(str, faults)]))
    if faults:
        raise DatasetError("; ".join(map(str, faults)))
    numbered = enumerate((sequence, config) for sequence in sequences for config in configs)
    varied = tuple(axis.name for axis in axes)
    return Plan(
        tuple(Job(number, sequence, config, exact) for number, (sequence, config) in numbered),
        varied,
        _grid(sequences, configs, varied, exact) | ({"skipped": skipped} if skip_bad else {}),
        exact,
    )


def _grid(
    sequences: Sequence[ImageSequence], configs: Sequence[Config], varied: Sequence[str], exact: Span | None
) -> dict[str, Any]:
    fixed = {name: value for name, value in flattened(configs[0]).items() if name not in varied}
    grid = {
        "sources": [sequence.source for sequence in sequences],
        "cuts": [list(sequence.cut_from) for sequence in sequences],
        "axes": {name: list(dict.fromkeys(value_of(config, name) for config in configs)) for name in varied},
        "parameters": fixed,
        "exact": [exact.name, exact.first, exact.last] if exact else None,
    }
    plain: dict[str, Any] = json.loads(json.dumps(grid))
    return plain


def _twice(sequences: Sequence[ImageSequence]) -> list[str]:
    sources = [sequence.source for sequence in sequences]
    return [f"{source} is named twice; name it once" for source in dict.fromkeys(sources) if sources.count(source) > 1]


def _too_short(sequences: Sequence[ImageSequence], configs: Sequence[Config]) -> list[str]:
    largest = max((config.mapper.n_init for config in configs), default=0)
    return [
        f"{sequence.source}: the first node needs n_init = {largest} images but there are only {len(sequence)}; "
        "lower n_init or give a longer sequence"
        for sequence in sequences
        if len(sequence) < largest
    ]
