"""``omnieval compare``: runs in a table, for the terminal, a README, a spreadsheet or a paper."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from omnieval.cli import options
from omnieval.wording import latex_text

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

    chosen = [name.strip() for name in columns.split(",") if name.strip()] if columns is not None else None
    table = table_of([open_run(run) for run in _replays(runs)], chosen)
    if json or format_ is TableFormat.JSON:
        print_json({"schema_version": 1, "runs": table.to_dicts()})
    elif format_ is TableFormat.MARKDOWN:
        print_table(table)
    elif format_ is TableFormat.CSV:
        print(table.write_csv(), end="")
    else:
        lines = _latex(table) if format_ is TableFormat.LATEX else _columns(table)
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
    rows = {name: [_cell(value) for value in table[name]] for name in table.columns}
    shared = {
        name for name in rows if name != "run" and table[name].dtype == table["run"].dtype and len(set(rows[name])) == 1
    }
    apart = [cells for name, cells in rows.items() if name not in shared]
    widths = [max(len(cells[number]) for cells in apart) for number in range(len(table))]
    name_width = max(map(len, rows))
    for name, cells in rows.items():
        aligned = (f"{cell:>{width}}" for cell, width in zip(cells, widths, strict=True))
        yield f"{name:<{name_width}}  {cells[0] if name in shared else '  '.join(aligned)}"


def _latex(table: pl.DataFrame) -> Iterator[str]:
    """Yield the lines of a LaTeX table (booktabs) that has a row a run."""
    signs = "".join("r" if dtype.is_numeric() else "l" for dtype in table.dtypes)
    yield rf"\begin{{tabular}}{{{signs}}}"
    yield r"\toprule"
    yield _latex_row(table.columns)
    yield r"\midrule"
    for row in table.iter_rows():
        yield _latex_row([_cell(value) for value in row])
    yield r"\bottomrule"
    yield r"\end{tabular}"


def _latex_row(cells: list[str]) -> str:
    # A minus sign is longer than a hyphen; folders and names keep theirs.
    minus = [f"${cell}$" if cell[:1] == "-" and cell[1:2].isdigit() else latex_text(cell) for cell in cells]
    return " & ".join(minus) + r" \\"


def _cell(value: str | float | int | None) -> str:
    """Write a value: fractions with four decimals, nothing as a dash."""
    return "-" if value is None else f"{value:.4f}" if isinstance(value, float) else str(value)
