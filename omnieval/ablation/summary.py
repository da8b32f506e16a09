"""What a sweep comes to: best and median of each sequence, mapper and descriptor, or the pieces of an interval."""

from __future__ import annotations

from collections.abc import Sequence

import polars as pl

_BY = ("dataset", "source", "mapper", "descriptor")


def best_and_median(table: pl.DataFrame, varied: Sequence[str]) -> pl.DataFrame:
    """Return one row a sequence, mapper and descriptor: the run with the highest silhouette, and the median of all.

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
    ordered = table.sort("silhouette", descending=True, nulls_last=True, maintain_order=True)
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
        The parameters that are varied besides.
    """
    named = [name for name in varied if name not in _BY]
    shown = ("exact", "exact_from", "exact_to", "nodes", "silhouette", "share_assigned", "share_forced")
    return table.select("dataset", "mapper", "descriptor", *named, *shown, "batch_silhouette")
