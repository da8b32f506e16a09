"""``omnieval compare``: runs in a table."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from omnieval.cli import options


def compare(
    runs: Annotated[list[Path], typer.Argument(help="Run folders.", metavar="RUN...")],
    json: options.Json = False,
) -> None:
    """Show runs in a table: the parameters in which they differ, and their metrics.

    Examples:

      omnieval compare runs/*-hog
    """
    from omnieval.cli.console import print_json, print_table
    from omnieval.results.compare import compare as table_of
    from omnieval.results.run_folder import open_run

    table = table_of([open_run(run) for run in runs])
    if json:
        print_json({"schema_version": 1, "runs": table.to_dicts()})
    else:
        print_table(table)
