"""``omnieval report``: figures and one page."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from omnieval.cli import options

if TYPE_CHECKING:
    from omnieval.report.build import Order
    from omnieval.report.figure import Table


class ReportFormat(StrEnum):
    """In which form the report is made."""

    PAGE = "html"
    MARKDOWN = "md"
    LATEX = "latex"


def report(
    paths: Annotated[
        list[Path],
        typer.Argument(help="Run folders, ablations, baselines and localisations, in any mixture.", metavar="PATH"),
    ],
    out: Annotated[
        Path | None, typer.Option(help="Folder to write; default report/ inside the first path.", metavar="DIR")
    ] = None,
    step: Annotated[
        int | None,
        typer.Option(
            min=0,
            help="Step whose similarity curves to draw; default the loop closure with the most candidate images.",
            metavar="N",
        ),
    ] = None,
    format_: Annotated[
        ReportFormat, typer.Option("--format", help="html: the page; md or latex: the tables alone, on stdout.")
    ] = ReportFormat.PAGE,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Replace an earlier report in the same folder.")
    ] = False,
    json: options.Json = False,
) -> None:
    """Draw the figures and tables of runs, sweeps, baselines and localisations: one page without network.

    Writes index.html, complete in itself, and figures/ with each figure as SVG, PNG and CSV, and prints the page's
    path. A figure whose input is missing is left out with a sentence that says why.

    Examples:

      omnieval report runs/synthetic-cloudy-hog

      omnieval report runs/ablation runs/mine --out both

      omnieval report runs/synthetic-cloudy-hog --step 412 --overwrite

      omnieval report runs/ablation --format latex > tables.tex
    """
    from omnieval.errors import ConfigError
    from omnieval.report.build import Order

    if format_ is ReportFormat.PAGE:
        _write(paths, Order(step=step), out, overwrite=overwrite, json=json)
        return
    given = {"--out": out, "--step": step, "--overwrite": overwrite or None, "--json": json or None}
    if unused := [name for name, value in given.items() if value is not None]:
        raise ConfigError(f"--format {format_} prints tables and writes nothing; leave {', '.join(unused)} out")
    _print_tables(paths, format_)


def _write(paths: list[Path], order: Order, out: Path | None, *, overwrite: bool, json: bool) -> None:
    import dataclasses

    from omnieval.cli.console import note, print_json, progress
    from omnieval.report.write import write_report

    with progress("reporting") as shown:
        made = write_report(paths, dataclasses.replace(order, progress=shown), out=out, overwrite=overwrite)
    skipped = [{"figure": one.title, "reason": one.reason} for one in made.skipped]
    if json:
        print_json({"schema_version": 1, "report": str(made.page), "files": list(made.files), "skipped": skipped})
        return
    print(made.page)
    for one in skipped:
        note(f"not drawn: {one['figure']}: {one['reason']}")


def _print_tables(paths: list[Path], format_: ReportFormat) -> None:
    from omnieval.report.build import Order, build, tables
    from omnieval.report.markup import latex, markdown
    from omnieval.report.sources import open_sources

    found: list[Table] = tables(build(open_sources(paths), Order(figures=False)))
    print("\n".join(map(markdown if format_ is ReportFormat.MARKDOWN else latex, found)), end="")
