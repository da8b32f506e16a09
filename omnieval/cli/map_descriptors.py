"""``omnieval map``: the mapper alone, on anyone's descriptors."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from omnieval.cli import options
from omnieval.cli.replay import print_run


def map_descriptors(
    descriptors: Annotated[
        Path,
        typer.Argument(
            help="Archive with arrays position (n, d) and orientation (n, cells, bins).", metavar="FILE.npz"
        ),
    ],
    set_: options.Set = None,
    config: options.ConfigFile = None,
    preset: options.Preset = None,
    out: options.Out = None,
    overwrite: options.Overwrite = False,
    rrd: Annotated[bool, typer.Option("--rrd", help="Also write a recording, without pictures.")] = False,
    json: options.Json = False,
) -> None:
    """Run the mapper alone on descriptors computed anywhere, and write the run folder.

    Optional arrays of the archive: file, xy (n, 2) metres, yaw (n,) radians, room, time_ns.

    Examples:

      omnieval describe synthetic --out synthetic.npz

      omnieval map synthetic.npz --set n_new=30
    """
    from omnieval.cli.console import progress
    from omnieval.loop import map_archive

    resolved = options.configuration(set_, config, preset, None)
    recording = options.recording(no_rrd=not rrd, no_images=True)
    with progress("mapping") as report:
        run = map_archive(
            descriptors, config=resolved, out=out, overwrite=overwrite, recording=recording, progress=report
        )
    print_run(run, json=json)
