"""What a robot can do with the map of a run: every metric at every distance, in one table."""

from __future__ import annotations

import polars as pl

from omnieval.metrics.catalogue import CATALOGUE, THETA
from omnieval.metrics.metric import Metric
from omnieval.report.figure import Skipped, Table
from omnieval.results.run_folder import Run
from omnieval.text_table import Cell
from omnieval.wording import decimals

_TITLE = "What a robot can do with the map"
_NOTES = (
    "Two images are at one place within the distance above; pairs, and visits, are of images more than 10 s apart. "
    "Pairs: do images that share a node lie at one place? Re-entries: is a place known when the robot comes back, as "
    "decided at the time, and in the final map? Stretch: way over the map / true way; far below 1 through a wall, "
    "above 1 around a loop left open.",
    "TopoSIGMA 2026 (their own numbers; one event per new node, odometry and learned descriptors, COLD and CID-SIMS, "
    "2 m): precision 0.958, recall 0.479, F1 0.639. They define events differently: not comparable with re-entries.",
)


def quality_table(run: Run) -> Table | Skipped | None:
    """Return the table of a run; None where no metric has a value, and why where it has no table."""
    if run.status != "complete":
        return None
    if not (run.folder / "quality.parquet").exists():
        return Skipped(_TITLE, "the run was made before there was such a table; replay it again")
    found = run.quality
    at = found.drop_nulls("value")["theta"].drop_nulls().unique().sort().to_list()
    metrics = {metric.of: metric for metric in CATALOGUE if metric.of}
    rows = [
        _row(str(name), measures, at, metrics.get(str(name)))
        for (name,), measures in found.group_by("metric", maintain_order=True)
        if measures["value"].count()
    ]
    heads = ("metric", *(f"{theta:g} m" for theta in at), "at no distance", f"of, at {THETA:g} m", "95 %", "better")
    return Table("quality", _TITLE, heads, (("", tuple(rows)),), _NOTES) if rows else None


def _row(name: str, measures: pl.DataFrame, at: list[float], metric: Metric | None) -> tuple[Cell, ...]:
    values = {row["theta"]: row for row in measures.iter_rows(named=True)}
    told = values.get(THETA) or values.get(None) or {}
    low, high = told.get("low"), told.get("high")
    interval = None if low is None or high is None else f"{decimals(low)} to {decimals(high)}"
    cells = [values[theta]["value"] if theta in values else None for theta in (*at, None)]
    if metric and metric.whole:
        cells = [None if cell is None else int(cell) for cell in cells]
    return (name.replace("_", " "), *cells, told.get("count"), interval, metric.better if metric else None)
