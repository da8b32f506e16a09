"""``omnieval diff``: the first step at which two runs part, and why."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Annotated, Any

import typer

from omnieval.cli import options


def diff(
    one: Annotated[Path, typer.Argument(help="A run folder.", metavar="A")],
    other: Annotated[Path, typer.Argument(help="Another one.", metavar="B")],
    json: options.Json = False,
) -> None:
    """Show the first step at which two runs part: what was decided, and the numbers that differ.

    Examples:

      omnieval diff runs/synthetic-cloudy-hog runs/synthetic-cloudy-hog-2
    """
    from omnieval.cli.console import print_fields, print_json
    from omnieval.results.compare import first_difference
    from omnieval.results.run_folder import open_run

    runs = open_run(one), open_run(other)
    found = first_difference(*runs)
    if json:
        content: dict[str, Any] = {"schema_version": 1, "equal": found is None}
        print_json(content | ({"difference": _plain(dataclasses.asdict(found))} if found else {}))
    elif found is None:
        print(f"equal: all {len(runs[0].steps)} steps")
    else:
        print(f"step {found.frame} ({found.file}) is the first that differs: {one} | {other}")
        if not found.columns:
            print("  one of the runs has ended")
        else:
            print_fields((name, f"{left} | {right}") for name, (left, right) in found.columns.items())
        if found.settings:
            print("parameters")
            print_fields((name, f"{left} | {right}") for name, (left, right) in found.settings.items())


def _plain(content: Any) -> Any:
    """Return content with everything that JSON does not know as text."""
    if isinstance(content, dict):
        return {name: _plain(value) for name, value in content.items()}
    if isinstance(content, list | tuple):
        return [_plain(value) for value in content]
    return content if isinstance(content, str | int | float | bool | None) else str(content)
