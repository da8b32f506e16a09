"""The results of a sweep: best and median of each sequence, mapper and descriptor, or the pieces of an interval."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import polars as pl

from omnieval.datasets.perturbation import OPTIONS
from omnieval.datasets.source import apart
from omnieval.metrics.catalogue import BY_NAME, METRICS
from omnieval.results.schemas import FOUND

_BY = ("dataset", "source", "mapper", "descriptor")
_MEANS = (*METRICS, *FOUND, "batch_silhouette", "smallest_margin", "seconds")


def over_replicates(table: pl.DataFrame) -> pl.DataFrame:
    """Return a row for every sequence and configuration: the mean over its replicates.

    Its `source` is that of the sequence as it is, its `job` that of the first replicate, `runs` how many there are. A
    result is null if a replicate has none: what is chosen must work every time. A table without replicates stays as it
    is, but for the column `runs`.

    Parameters
    ----------
    table
        Rows of `schemas.ablation_schema`.
    """
    if table["replicate"].null_count() == len(table):
        return table.with_columns(runs=pl.lit(1))
    bare = [apart(source, OPTIONS)[0] for source in table["source"]]
    means = [name for name in _MEANS if name in table.columns]
    fixed = [name for name in table.columns if name not in {*means, "job", "perturbation", "replicate", "error"}]
    fixed = [name for name in fixed if name not in ("smallest_margin_frame", "smallest_margin_gate")]
    errors = pl.col("error").count()
    first = pl.col("error").drop_nulls().first()
    failed = pl.when(errors > 0).then(pl.format("{} of {} replicates failed: {}", errors, pl.len(), first))
    found = (
        table.with_columns(source=pl.Series(bare))
        .group_by(fixed, maintain_order=True)
        .agg(
            pl.col("job").min(),
            *(pl.when(pl.col(name).null_count() == 0).then(pl.col(name).mean()).alias(name) for name in means),
            failed.alias("error"),
            pl.len().alias("runs"),
            pl.lit(None, pl.String).alias("perturbation"),
            pl.lit(None, pl.Int32).alias("replicate"),
        )
        .sort("job", maintain_order=True)
    )
    return found.select(*(name for name in table.columns if name in found.columns), "runs")


def tuned(table: pl.DataFrame, varied: Sequence[str], tuned_on: Sequence[str], metric: str) -> pl.DataFrame:
    """Choose the parameters of each mapper and descriptor on some sequences, and judge them on the others.

    Parameters
    ----------
    table
        Rows of `schemas.ablation_schema`.
    varied
        The parameters that are varied.
    tuned_on
        Sources, without perturbations, of the sequences to choose on.
    metric
        What is to be best there on average, over sequences and replicates.

    Returns
    -------
    One row per mapper, descriptor and sequence: the parameters chosen, whether the sequence was chosen on (`tuned`) or
    judged on (`judged`), the metric (mean over replicates), the best of the grid on that sequence (`best_there`, picked
    with hindsight), and the runs and failures of the chosen ones.
    """
    named = [name for name in varied if name not in _BY]
    means = over_replicates(table)
    lower = BY_NAME[metric].better == "lower"
    score = pl.col(metric).cast(pl.Float64)
    rows: list[dict[str, Any]] = []
    for (mapper, descriptor), own in means.group_by("mapper", "descriptor", maintain_order=True):
        there = own.filter(pl.col("source").is_in(list(tuned_on)))
        ranked = (
            there.group_by(named, maintain_order=True)
            .agg(pl.when(score.null_count() == 0).then(score.mean()).alias("chosen_by"))
            .sort("chosen_by", descending=not lower, nulls_last=True, maintain_order=True)
            if named
            else there.select(score.mean().alias("chosen_by"))
        )
        if ranked.is_empty() or ranked["chosen_by"][0] is None:
            continue
        chosen = {name: ranked[name][0] for name in named}
        for (dataset, source), some in own.group_by("dataset", "source", maintain_order=True):
            fits = (pl.col(name).eq_missing(pl.lit(value)) for name, value in chosen.items())
            row = some.filter(*fits).row(0, named=True)
            best = some[metric].drop_nulls()
            rows.append(
                {
                    "mapper": mapper,
                    "descriptor": descriptor,
                    **chosen,
                    "dataset": dataset,
                    "role": "tuned" if source in tuned_on else "judged",
                    metric: row[metric],
                    "best_there": None if best.is_empty() else best.min() if lower else best.max(),
                    "runs": row["runs"],
                    "error": row["error"],
                }
            )
    return pl.DataFrame(rows, infer_schema_length=None)


def best_and_median(table: pl.DataFrame, varied: Sequence[str]) -> pl.DataFrame:
    """Return one row per sequence, mapper and descriptor: the run with the highest silhouette, and the median of all.

    Where there are replicates, a run is the mean over them.

    The paper's Table 2 (doi 10.3390/app10186480, section 6.4) and Table 3 give the best only, picked with the ground
    truth; the median says what to expect without it.

    Parameters
    ----------
    table
        Rows of `schemas.ablation_schema`.
    varied
        The parameters to name of the best run.

    Returns
    -------
    dataset, mapper, descriptor, runs, failed, silhouette and nodes of the best, its varied parameters, batch_silhouette
    at its number of nodes, and median_silhouette and median_nodes of all.
    """
    named = [name for name in varied if name not in _BY]
    # A run without silhouette is best only where none has one.
    ordered = over_replicates(table).sort("silhouette", descending=True, nulls_last=True, maintain_order=True)
    return (
        ordered.group_by(_BY, maintain_order=True)
        .agg(
            pl.len().alias("runs"),
            pl.col("error").count().alias("failed"),
            pl.col("silhouette", "nodes", *named, "batch_silhouette").first(),
            pl.col("silhouette").median().alias("median_silhouette"),
            pl.col("nodes").median().alias("median_nodes"),
            pl.col("job").min().alias("first_job"),
        )
        .sort("first_job")
        .drop("source", "first_job")
    )


def pieces(table: pl.DataFrame, varied: Sequence[str]) -> pl.DataFrame:
    """Return the pieces of the intervals of an exact sweep: from, up to, and what the map is there.

    Parameters
    ----------
    table
        Rows of `schemas.ablation_schema` with `exact`.
    varied
        The other parameters that are varied.
    """
    named = [name for name in varied if name not in _BY]
    shown = ("exact", "exact_from", "exact_to", "nodes", "silhouette", "share_assigned", "share_forced")
    return table.select("dataset", "mapper", "descriptor", *named, *shown, "batch_silhouette")
