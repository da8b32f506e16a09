"""``omnieval render``: make the recording of a run again, from its tables and images."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from omnieval.cli import options


def render(
    run: options.RunArgument,
    no_images: options.NoImages = False,
    every: options.Every = 1,
    out: Annotated[
        Path | None,
        typer.Option(help="File to write; default the recording in RUN, which is replaced.", metavar="FILE.rrd"),
    ] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace FILE.rrd.")] = False,
) -> None:
    """Rebuild the recording of a run from its tables and images.

    Of a localisation: each query beside what was found in the map, and where both were taken.

    Recordings are readable by neighbouring versions of the viewer only; the tables are the record.

    Examples:

      omnieval render runs/synthetic-cloudy-hog

      omnieval render runs/synthetic-cloudy-hog --every 10

      omnieval render runs/synthetic-cloudy-hog --no-images --out small.rrd
    """
    from omnieval.cli.console import note, progress
    from omnieval.localization.recorded import record_localization
    from omnieval.localization.run import KIND as LOCALIZATION
    from omnieval.localization.run import open_localization
    from omnieval.recording import RecordingOptions
    from omnieval.render import render as rebuild
    from omnieval.results.atomic import claim_file
    from omnieval.results.manifest import kind_of
    from omnieval.results.run_folder import open_run

    recorded = RecordingOptions(images=not no_images, every=every)
    if out is not None:
        claim_file(out, overwrite=overwrite)
    with progress("rendering") as report:
        if kind_of(run) == LOCALIZATION:
            path = record_localization(open_localization(run), recorded, out=out, progress=report, note=note)
        else:
            path = rebuild(open_run(run), recorded, out=out, progress=report, note=note)
    print(path)
