"""What a run decided, decided again: for the similarity curves, which no table holds."""

from __future__ import annotations

from collections.abc import Iterator

from omnieval.errors import ResultError
from omnieval.loop import made_mapper
from omnieval.mapping.memory import AHEAD, blocks
from omnieval.mapping.step import Step
from omnieval.material import Material
from omnieval.results.run_folder import Run
from omnieval.results.tables import read_steps


def remapped(run: Run, material: Material) -> Iterator[Step]:
    """Yield the steps of a run again, with their curves.

    Parameters
    ----------
    run
        A run.
    material
        What it replayed (`material.reopened`).

    Raises
    ------
    ConfigError, ResultError
        If the mapper cannot be made again, or decides otherwise than the tables say.
    """
    mapper = made_mapper(run.config.mapper.again())
    before = read_steps(run.steps, run.method.columns)
    for block in blocks(zip(before, material.described, strict=False), AHEAD):
        mapper.expect([described.description for _, described in block])
        for (recorded, _), described in block:
            step = mapper.step(described.description)
            if (step.verdict, step.node, step.match) != (recorded.verdict, recorded.node, recorded.match):
                raise ResultError(
                    f"step {step.frame} of {run.folder} comes out otherwise now: {recorded.verdict} became "
                    f"{step.verdict}; the machine or a library may have changed it, so replay the sequence again"
                )
            yield step
