"""The intervals of what a localisation came to over its images, which are resampled in moving blocks."""

from __future__ import annotations

from functools import partial

import polars as pl

from omnieval.localization.run import Localization
from omnieval.mapping.step import Role
from omnieval.metrics.ground import Clock
from omnieval.statistics.blocks import Blocks, Statistic, mean_of
from omnieval.statistics.within import Within


def intervals_of_answers(found: Localization, sequence: str, strategy: str) -> Within:
    """Return what gives the interval of a metric of one sequence and strategy."""
    metrics = found.manifest["metrics"].get(sequence, {}).get(strategy) or {}
    return Within(partial(_statistics, found, sequence, strategy), metrics)


def _statistics(found: Localization, sequence: str, strategy: str) -> tuple[Blocks, dict[str, Statistic]]:
    answers = found.table.filter(sequence=sequence, strategy=strategy)
    within = found.manifest["within"]
    located = pl.col("role") != Role.REFUSED.value
    posed = pl.col("reachable").is_not_null()
    both_rooms = pl.col("room").is_not_null() & pl.col("best_room").is_not_null()
    in_node = pl.col("node").is_not_null()
    near = (pl.col("error") <= within).fill_null(value=False)
    values = {
        "error_mean": pl.col("error"),
        "reachable_mean": pl.when(pl.col("error").is_not_null()).then(pl.col("reachable")),
        "recall@1": pl.when(posed).then(located & near),
        "recall@5": pl.when(posed).then(located & (pl.col("rank") <= 5).fill_null(value=False)),
        "recall_nearest@1": pl.when(posed).then(located & (pl.col("nearest_rank") <= 1).fill_null(value=False)),
        "room_accuracy": pl.when(located & both_rooms).then(pl.col("room") == pl.col("best_room")),
        "node_accuracy": pl.when(posed & located & in_node).then(pl.col("node_right").fill_null(value=False)),
    }
    table = answers.select(**{name: one.cast(pl.Float64).fill_null(float("nan")) for name, one in values.items()})
    clock = Clock.of(answers["time"].cast(pl.Int64).to_list(), len(answers))
    statistics = {name: mean_of(table[name].to_numpy()) for name in table.columns}
    return Blocks.of(clock.stamps, clock.second), statistics
