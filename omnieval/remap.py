"""What a run decided, decided again: for the similarity curves, which no table holds."""

from __future__ import annotations

from collections.abc import Iterator

import polars as pl

from omnieval.components.component import Component
from omnieval.loop import hold_decision, made_mapper
from omnieval.mapping.memory import AHEAD, blocks
from omnieval.mapping.step import Step
from omnieval.material.material import Material
from omnieval.results.run_folder import Run
from omnieval.results.tables import read_steps


def remapped(run: Run, material: Material) -> Iterator[Step]:
    """Yield the steps of a run again, with their curves; see `decided_again`."""
    return decided_again(run.config.mapper, run.steps, material, str(run.folder))


def decided_again(mapper: Component, steps: pl.DataFrame, material: Material, where: str) -> Iterator[Step]:
    """Yield steps again, with their curves.

    Parameters
    ----------
    mapper
        What decided.
    steps
        What it decided (`schemas.steps_schema`).
    material
        What was replayed (`material.reopened`).
    where
        What to call the run.

    Raises
    ------
    ConfigError, ResultError
        If the mapper cannot be made again, or decides otherwise than the table says.
    """
    again = made_mapper(mapper.again())
    expect = getattr(again, "expect", None)
    before = read_steps(steps, ())
    for block in blocks(zip(before, material.described, strict=False), AHEAD):
        if expect:
            expect([described.description for _, described in block])
        for (recorded, _), described in block:
            step = again.step(described.description)
            hold_decision(step, recorded, where)
            yield step
