"""``omnieval export``: a run as files for other programs."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from omnieval.cli import options


class Format(StrEnum):
    """What is written, by the names of `exports.write.ExportFormat`."""

    GRAPHML = "graphml"
    GEOJSON = "geojson"
    JSON = "json"
    TUM = "tum"
    CSV = "csv"


def export(
    run: options.RunArgument,
    format_: Annotated[
        Format | None,
        typer.Option(
            "--format",
            help="graphml and json: the map; geojson: the map for Nav2's Route Server; tum: the true path, for evo; "
            "csv: all tables.",
        ),
    ] = None,
    out: Annotated[
        str | None,
        typer.Option(help="File to write (csv: folder); default named after the run, in this folder.", metavar="PATH"),
    ] = None,
    images: Annotated[Path | None, typer.Option(help="Folder for a picture of every node.", metavar="DIR")] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace files that exist.")] = False,
    json: options.Json = False,
) -> None:
    """Write a run for other programs: its map as a graph, its path, its tables, pictures of its nodes.

    Prints the paths of what it wrote. Of ablations, baselines and localisations, the table as CSV.

    Examples:

      omnieval export runs/synthetic-cloudy-hog --format graphml

      omnieval export runs/mine --format geojson --out graph.geojson

      omnieval export runs/synthetic-cloudy-hog --format csv --images nodes
    """
    from omnieval.cli.console import note, print_json
    from omnieval.exports.write import export as write

    made = write(run, format_, out=out, images=images, overwrite=overwrite)
    if json:
        print_json({"schema_version": 1, "files": [str(file) for file in made.files], "notes": list(made.notes)})
        return
    for file in made.files:
        print(file)
    for sentence in made.notes:
        note(sentence)
