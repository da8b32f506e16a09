"""``omnieval map``: the mapper alone, on anyone's descriptors."""

from __future__ import annotations

from typing import Annotated

import typer

from omnieval.cli import options
from omnieval.cli.replay import print_run


def map_descriptors(
    descriptors: Annotated[
        str,
        typer.Argument(
            help="Archive with arrays position (n, d) and orientation (n, cells, bins).", metavar="FILE.npz"
        ),
    ],
    set_: options.Set = None,
    config: options.ConfigFile = None,
    preset: options.Preset = None,
    mapper: options.MapperName = None,
    start: options.Start = 0,
    stride: options.Stride = 1,
    limit: options.Limit = None,
    out: options.Out = None,
    overwrite: options.Overwrite = False,
    rrd: Annotated[bool, typer.Option("--rrd", help="Also write a recording, without pictures.")] = False,
    no_evidence: Annotated[
        bool,
        typer.Option(
            "--no-evidence",
            help="Keep the decisions and not what was compared for them: the same, and sooner, of long sequences.",
        ),
    ] = False,
    json: options.Json = False,
) -> None:
    """Run only the mapper, on descriptors that any program computed, and write the run folder.

    Optional arrays of the archive: file, xy (n, 2) metres, yaw (n,) radians, room, time_ns.

    Examples:

      omnieval describe synthetic --out synthetic.npz

      omnieval map synthetic.npz --set n_new=30
    """
    from omnieval.cli.console import progress
    from omnieval.loop import replay
    from omnieval.material.source import ARCHIVE_SCHEME, archive_file

    resolved = options.configuration(set_, config, preset, mapper, None)
    recording = options.recording(no_rrd=not rrd, no_images=True)
    with progress("mapping") as report:
        run = replay(
            f"{ARCHIVE_SCHEME}{archive_file(descriptors) or descriptors}",
            config=resolved,
            start=start,
            stride=stride,
            limit=limit,
            out=out,
            overwrite=overwrite,
            recording=recording,
            evidence=not no_evidence,
            progress=report,
        )
    print_run(run, json=json)
