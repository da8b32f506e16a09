"""The intervals of a run's metrics over its images, which are resampled in moving blocks."""

from __future__ import annotations

from functools import partial

import numpy as np
import polars as pl

from omnieval.metrics.ground import Clock
from omnieval.metrics.resampled import resampled_metrics
from omnieval.results.run_folder import Run
from omnieval.statistics.blocks import Blocks, Statistic
from omnieval.statistics.within import Within


def intervals_of_run(run: Run) -> Within:
    """Return what gives the interval of a metric of a run (`metrics.resampled`)."""
    return Within(partial(_statistics, run), run.metrics)


def _statistics(run: Run) -> tuple[Blocks, dict[str, Statistic]]:
    steps, nodes = run.steps, run.nodes
    times = steps["time"].cast(pl.Int64).to_list()
    clock = Clock.of(times, len(steps))
    positions = steps.select(pl.col("x", "y").fill_null(float("nan"))).to_numpy().astype(np.float64)
    statistics = resampled_metrics(
        steps["node_final"].fill_null(0).cast(pl.Int64).to_numpy(),
        steps["placement"].cast(pl.String).to_list(),
        positions,
        times,
        steps["room"].to_list(),
        nodes["representative_frame"].drop_nulls().to_list(),
    )
    return Blocks.of(clock.stamps, clock.second), statistics
