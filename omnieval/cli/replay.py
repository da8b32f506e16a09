"""``omnieval replay``: the main job."""

from __future__ import annotations

import shlex
from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated

import typer

from omnieval.cli import options

if TYPE_CHECKING:
    from omnieval.results.run_folder import Run


def replay(
    source: options.Source = "synthetic",
    set_: options.Set = None,
    config: options.ConfigFile = None,
    camera: options.CameraFile = None,
    preset: options.Preset = None,
    mapper: options.MapperName = None,
    descriptor: options.DescriptorName = None,
    poses: options.Poses = None,
    poses_tolerance: options.PosesTolerance = None,
    poses_interpolate: options.PosesInterpolate = None,
    topic: options.Topic = None,
    pose_topic: options.PoseTopic = None,
    pose_frame: options.PoseFrame = None,
    decode_every: options.DecodeEvery = None,
    start: options.Start = 0,
    stride: options.Stride = 1,
    limit: options.Limit = None,
    out: options.Out = None,
    overwrite: options.Overwrite = False,
    skip_bad: options.SkipBad = False,
    no_rrd: Annotated[bool, typer.Option("--no-rrd", help="Write no recording for the Rerun viewer.")] = False,
    no_images: options.NoImages = False,
    every: options.Every = 1,
    spawn: Annotated[bool, typer.Option("--spawn", help="Show the replay live in a new Rerun viewer.")] = False,
    connect: Annotated[
        str | None, typer.Option(help="Show the replay live in a running Rerun viewer.", metavar="URL")
    ] = None,
    map_: options.ContinuedMap = None,
    no_map: options.NoMap = False,
    json: options.Json = False,
) -> None:
    """Replay a mapper over a sequence and keep the evidence of every decision.

    Writes a run folder (tables and a recording for the Rerun viewer) and prints its summary.

    Examples:

      omnieval replay

      omnieval replay synthetic:night --set omega=1.85 --set merge_y=0.75

      omnieval replay cold:/data/seq2_cloudy3 --preset paper-literal

      omnieval replay synthetic:night --mapper leader --descriptor mine.py:Mine

      omnieval replay folder:/data/panoramas --limit 500 --no-rrd --json

      omnieval replay synthetic:night --map runs/house

      omnieval replay video:/data/tour.mp4 --decode-every 5

      omnieval replay bag:/data/tour.bag --topic /image --pose-topic /odom
    """
    from omnieval.cli.console import progress
    from omnieval.loop import replay as run_replay

    resolved = None
    if map_ is None or any((set_, config, preset, mapper, descriptor, camera)):
        resolved = options.configuration(set_, config, preset, mapper, descriptor, camera=camera)
    recording = options.recording(no_rrd=no_rrd, no_images=no_images, every=every, spawn=spawn, connect=connect)
    taken = options.source_with(
        source, poses, poses_tolerance, poses_interpolate, topic, pose_topic, pose_frame, decode_every
    )
    with progress("replaying") as report:
        run = run_replay(
            taken,
            config=resolved,
            start=start,
            stride=stride,
            limit=limit,
            out=out,
            overwrite=overwrite,
            skip_bad=skip_bad,
            recording=recording,
            save_map=not no_map,
            continuing=map_,
            progress=report,
        )
    print_run(run, json=json)


def _next(run: Run) -> Iterator[tuple[str, str]]:
    """Yield what one may want to do with a run."""
    folder = shlex.quote(str(run.folder))
    if run.recording.exists():
        yield "next", f"omnieval view {folder}"
    yield "next", f"omnieval explain {folder} --refused"
    yield "next", f"omnieval report {folder}"


def print_run(run: Run, *, json: bool) -> None:
    """Print the summary of a run."""
    from omnieval.cli.console import note, print_fields, print_json
    from omnieval.results.summary import skipped_images, summary_fields

    if json:
        print_json({"run": str(run.folder), **run.manifest})
    else:
        print(run.folder)
        print_fields([*summary_fields(run.manifest), *_next(run)])
    if skipped := skipped_images(run.manifest):
        note(skipped)
    if (cache := run.manifest["cache"]) and cache["note"]:
        note(cache["note"])
    if failure := run.manifest.get("recording_failure"):
        note(f"the recording may be incomplete (the tables are complete): {failure}")
