"""The intervals of the metrics of one run, over its own images."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from omnieval.statistics.blocks import Blocks, Statistic, block_estimate
from omnieval.statistics.estimate import Estimate

IntervalOf = Callable[[str], Estimate | None]
"""Gives the interval of a metric by its name; None where it has none."""
_SAME = 1e-9
"""Largest difference between a metric and the same metric computed again."""


class Within:
    """The intervals of the metrics of one run, computed when they are asked for.

    Parameters
    ----------
    statistics
        Gives how the images are resampled, and what can be computed of them, by metric.
    metrics
        The metrics of the run.
    """

    def __init__(
        self,
        statistics: Callable[[], tuple[Blocks, Mapping[str, Statistic]]],
        metrics: Mapping[str, float | int | None],
    ) -> None:
        self._load = statistics
        self._metrics = metrics
        self._loaded: tuple[Blocks, Mapping[str, Statistic]] | None = None

    def __call__(self, metric: str) -> Estimate | None:
        """Return a metric with its interval; None if images cannot be resampled for it, or it has no value."""
        value = self._metrics.get(metric)
        if value is None:
            return None
        if self._loaded is None:
            self._loaded = self._load()
        blocks, statistics = self._loaded
        if metric not in statistics:
            return None
        found = block_estimate(blocks, statistics[metric])
        # What is computed again must be what the run says, or the interval is of something else.
        return found if found.value is not None and abs(found.value - value) <= _SAME else None
