"""``omnieval compare``: runs in a table, or methods over many runs, for the terminal, a README, or a paper."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from omnieval.cli import options

if TYPE_CHECKING:
    import polars as pl

    from omnieval.comparison.methods import Comparison


class TableFormat(StrEnum):
    """How a table is written."""

    TABLE = "table"
    MARKDOWN = "md"
    CSV = "csv"
    LATEX = "latex"
    JSON = "json"


def compare(
    runs: Annotated[
        list[Path],
        typer.Argument(help="Run folders; with --by or --metric ablations and localisations too.", metavar="RUN"),
    ],
    format_: Annotated[
        TableFormat,
        typer.Option(
            "--format", help="table has one column per run; md, csv and latex (booktabs) have one row per run."
        ),
    ] = TableFormat.TABLE,
    columns: Annotated[
        str | None,
        typer.Option(
            help="Metrics and parameters to show, by name; default: what differs, and all metrics.",
            metavar="NAMES",
        ),
    ] = None,
    by: Annotated[
        str | None,
        typer.Option(
            help="Compare groups of runs, equal in these: mapper, descriptor, dataset, strategy, parameters; default "
            "mapper,descriptor.",
            metavar="NAMES",
        ),
    ] = None,
    metric: Annotated[
        str | None,
        typer.Option(
            help="Compare groups of runs by these metrics; default pair_f1,reentry_f1,false_merge_share,silhouette.",
            metavar="NAMES",
        ),
    ] = None,
    json: options.Json = False,
) -> None:
    """Show runs in one table: the parameters in which they differ, and their metrics.

    Folders that hold something else, such as an ablation, are left out; a note on stderr names them.

    With --by or --metric: groups of runs, those of ablations and localisations too, with 95 % intervals, how many
    finished, the differences over the same images (Wilcoxon's test, corrected by Holm), and mean ranks. csv and latex
    give the estimates alone.

    Examples:

      omnieval compare runs/*

      omnieval compare runs/a runs/b --format md --columns gamma,silhouette

      omnieval compare runs/ablation --by gamma --metric pair_f1,silhouette
    """
    if by is not None or metric is not None:
        _compare_methods(runs, by, metric, columns, TableFormat.JSON if json else format_)
        return
    from omnieval.cli.console import print_json, print_table
    from omnieval.results.compare import compare as table_of
    from omnieval.results.run_folder import open_run
    from omnieval.text_table import latex

    chosen = _names(columns) if columns is not None else None
    table = table_of([open_run(run) for run in _replays(runs)], chosen)
    if json or format_ is TableFormat.JSON:
        print_json({"schema_version": 1, "runs": table.to_dicts()})
    elif format_ is TableFormat.MARKDOWN:
        print_table(table)
    elif format_ is TableFormat.CSV:
        print(table.write_csv(), end="")
    else:
        lines = latex(table.columns, table.rows()) if format_ is TableFormat.LATEX else _columns(table)
        print("\n".join(lines))


def _compare_methods(
    folders: list[Path], by: str | None, metric: str | None, columns: str | None, form: TableFormat
) -> None:
    """Print groups of runs beside each other."""
    from omnieval.cli.console import note, print_json
    from omnieval.comparison import methods
    from omnieval.comparison.records import read_records
    from omnieval.comparison.tables import as_plain, difference_table, estimate_table, rank_table
    from omnieval.errors import ConfigError
    from omnieval.text_table import latex, markdown

    if columns is not None:
        raise ConfigError("--columns is for single runs; choose metrics with --metric")
    found: Comparison = methods.compare_methods(
        read_records(folders),
        methods.BY if by is None else _names(by),
        methods.METRICS if metric is None else _names(metric),
    )
    if form is TableFormat.JSON:
        print_json({"schema_version": 1, **as_plain(found)})
        return
    estimates = estimate_table(found)
    if form is TableFormat.CSV:
        print(estimates.write_csv(), end="")
    elif form is TableFormat.LATEX:
        print("\n".join(latex(estimates.columns, estimates.rows())))
    else:
        tables = (estimates, difference_table(found), rank_table(found))
        print("\n\n".join(markdown(table.columns, table.rows()) for table in tables if not table.is_empty()))
    for line in found.lacking:
        note(line)


def _names(text: str) -> list[str]:
    return [name.strip() for name in text.split(",") if name.strip()]


def _replays(folders: list[Path]) -> list[Path]:
    """Return the folders without those that hold something else, which are named; all if there is nothing else."""
    from omnieval.cli.console import note
    from omnieval.wording import shown

    others = {folder: what for folder in folders if (what := _something_else(folder))}
    if len(others) == len(set(folders)):
        return folders
    if others:
        named = ", ".join(f"{shown(str(folder))} ({what})" for folder, what in others.items())
        note(f"only replays are compared; left out: {named}")
    return [folder for folder in folders if folder not in others]


def _something_else(folder: Path) -> str | None:
    """Return what a folder holds instead of a replay (one word), sound or damaged; None if there is no such folder."""
    from omnieval.results.manifest import MANIFEST, kind_of
    from omnieval.results.run_folder import KIND

    kind = kind_of(folder)
    if kind is not None:
        return None if kind == KIND else kind
    with suppress(OSError):  # such as a name that is too long
        return "no results" if folder.is_dir() and not (folder / MANIFEST).exists() else None
    return None


def _columns(table: pl.DataFrame) -> Iterator[str]:
    """Yield the lines of a table that has a column per run, so that it fits a terminal.

    Text that all runs share is said once and makes no column wider.
    """
    from omnieval.text_table import aligned, cell_text

    text = table["run"].dtype
    shared = {one.name: one[0] for one in table.drop("run") if one.dtype == text and one.n_unique() == 1}
    rows = [(name, *(() if name in shared else map(cell_text, table[name]))) for name in table.columns]
    width = max(map(len, table.columns))
    for name, line in zip(table.columns, aligned(rows, "l" + "r" * len(table)), strict=True):
        yield f"{line:<{width}}  {cell_text(shared[name])}" if name in shared else line
