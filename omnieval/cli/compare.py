"""``omnieval compare``: runs in a table, for the terminal, a README, a spreadsheet or a paper."""

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


class TableFormat(StrEnum):
    """How a table is written."""

    TABLE = "table"
    MARKDOWN = "md"
    CSV = "csv"
    LATEX = "latex"
    JSON = "json"


def compare(
    runs: Annotated[list[Path], typer.Argument(help="Run folders.", metavar="RUN")],
    format_: Annotated[
        TableFormat,
        typer.Option("--format", help="table has a column a run; md, csv and latex (booktabs) have a row a run."),
    ] = TableFormat.TABLE,
    columns: Annotated[
        str | None,
        typer.Option(
            help="Metrics and parameters to show, by name; default: what differs, and all metrics.",
            metavar="NAMES",
        ),
    ] = None,
    json: options.Json = False,
) -> None:
    """Show runs in one table: the parameters in which they differ, and their metrics.

    Folders that hold something else, such as an ablation, are left out; a note on stderr names them.

    Examples:

      omnieval compare runs/*

      omnieval compare runs/a runs/b --format md --columns gamma,silhouette
    """
    from omnieval.cli.console import print_json, print_table
    from omnieval.results.compare import compare as table_of
    from omnieval.results.run_folder import open_run
    from omnieval.text_table import latex

    chosen = [name.strip() for name in columns.split(",") if name.strip()] if columns is not None else None
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
    """Return in a word what a folder holds instead of a replay, sound or not; None if there is no such folder."""
    from omnieval.results.manifest import MANIFEST, kind_of
    from omnieval.results.run_folder import KIND

    kind = kind_of(folder)
    if kind is not None:
        return None if kind == KIND else kind
    with suppress(OSError):  # such as a name that is too long
        return "no results" if folder.is_dir() and not (folder / MANIFEST).exists() else None
    return None


def _columns(table: pl.DataFrame) -> Iterator[str]:
    """Yield the lines of a table that has a column a run, so that it fits a terminal.

    Text that all runs share is said once and makes no column wider.
    """
    from omnieval.text_table import aligned, cell_text

    text = table["run"].dtype
    shared = {one.name: one[0] for one in table.drop("run") if one.dtype == text and one.n_unique() == 1}
    rows = [(name, *(() if name in shared else map(cell_text, table[name]))) for name in table.columns]
    width = max(map(len, table.columns))
    for name, line in zip(table.columns, aligned(rows, "l" + "r" * len(table)), strict=True):
        yield f"{line:<{width}}  {cell_text(shared[name])}" if name in shared else line
