"""``omnieval describe``: descriptors as arrays."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Annotated

import typer

from omnieval.cli import options


def describe(
    out: Annotated[Path, typer.Option(help="Archive to write.", metavar="FILE.npz")],
    source: options.Source = "synthetic",
    set_: options.Set = None,
    config: options.ConfigFile = None,
    camera: options.CameraFile = None,
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
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace FILE.npz.")] = False,
    skip_bad: options.SkipBad = False,
    json: options.Json = False,
) -> None:
    """Describe every image of a sequence and write the descriptors as a NumPy archive.

    Arrays: position (n, d), orientation (n, cells, bins), file, xy (metres), yaw (radians), room, time_ns.

    Examples:

      omnieval describe cold:/data/seq2_cloudy3 --out seq2_cloudy3.npz

      omnieval describe synthetic:sunny --descriptor gist --out sunny.npz
    """
    from omnieval.archiving import describe_archive
    from omnieval.cli.console import note, print_fields, print_json, progress
    from omnieval.imaging.soundness import in_words

    resolved = options.configuration(set_, config, descriptor=descriptor, camera=camera)
    taken = options.source_with(
        source, poses, poses_tolerance, poses_interpolate, topic, pose_topic, pose_frame, decode_every
    )
    with progress("describing") as report:
        archive, material = describe_archive(
            taken,
            out,
            config=resolved,
            start=start,
            stride=stride,
            limit=limit,
            overwrite=overwrite,
            skip_bad=skip_bad,
            progress=report,
        )
    left_out = material.skipped or ()
    shapes = {"position": list(archive.position.shape), "orientation": list(archive.orientation.shape)}
    if json:
        skipped = [dataclasses.asdict(bad) for bad in left_out]
        print_json({"schema_version": 1, "file": str(out), "source": material.source, **shapes, "skipped": skipped})
    else:
        print(out)
        print_fields((name, " x ".join(map(str, shape))) for name, shape in shapes.items())
    if left_out:
        note(in_words(left_out, len(material.frames) + len(left_out)))
