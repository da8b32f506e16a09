"""``omnieval localize``: images of other sequences found in the map of a run."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from omnieval.cli import options

if TYPE_CHECKING:
    import polars as pl

_SHOWN = (
    *("queries", "refused", "error_mean", "error_median", "error_p95", "reachable_mean", "recall@1", "recall@5"),
    *("node_accuracy", "room_accuracy", "heading_error_median", "compared_mean", "milliseconds"),
)
_OPEN_SET = ("right", "wrong", "rightly_refused", "wrongly_refused", "refusal_auc")


def localize(
    run: options.RunArgument,
    sources: Annotated[list[str], typer.Argument(help="Sequences to find in the map.", metavar="SOURCE...")],
    strategy: Annotated[
        str | None,
        typer.Option(
            help="Ways to search: levels (the mapper's own), nearest, coarse; default: all that the mapper has.",
            metavar="NAMES",
        ),
    ] = None,
    within: Annotated[
        float, typer.Option(help="Two images at most this far apart show the same place.", metavar="METRES")
    ] = 0.5,
    map_limit: Annotated[
        int | None,
        typer.Option("--map-limit", min=1, help="Use a map of only the first N images of the run.", metavar="N"),
    ] = None,
    without_room: Annotated[
        list[str] | None,
        typer.Option("--without-room", help="Leave a room out of the map; repeatable.", metavar="ROOM"),
    ] = None,
    camera: options.CameraFile = None,
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
    skip_bad: options.SkipBad = False,
    out: Annotated[
        str | None, typer.Option(help="Folder to write; default runs/<query>-in-<map>[-<n>].", metavar="DIR")
    ] = None,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Replace an earlier localisation in the same folder.")
    ] = False,
    json: options.Json = False,
) -> None:
    """Find every image of other sequences in the map of a run, and judge the answers.

    The images are described in the same way as those of the map. Writes localization.parquet, one row per query and
    strategy, and prints the metrics. `omnieval explain DIR QUERY` explains one answer.

    Examples:

      omnieval localize runs/house synthetic:night synthetic:sunny

      omnieval localize runs/house cold:/data/seq2_night2 --strategy nearest

      omnieval localize runs/house synthetic:night --without-room 2PO2
    """
    from omnieval.cli.console import print_json, print_table, progress
    from omnieval.localization.run import localize as find

    chosen = None if strategy is None else [name.strip() for name in strategy.split(",")]
    about = poses, poses_tolerance, poses_interpolate, topic, pose_topic, pose_frame, decode_every
    with progress("localising") as report:
        found = find(
            run,
            *(options.source_with(source, *about) for source in sources),
            camera=camera,
            strategies=chosen,
            within=within,
            map_limit=map_limit,
            without_rooms=without_room or (),
            start=start,
            stride=stride,
            limit=limit,
            skip_bad=skip_bad,
            out=out,
            overwrite=overwrite,
            progress=report,
        )
    if json:
        print_json({"localization": str(found.folder), **found.manifest})
        return
    print(found.folder)
    print_table(_table(found.measures, open_set=map_limit is not None or bool(without_room)))


def _table(measures: pl.DataFrame, *, open_set: bool) -> pl.DataFrame:
    return measures.select("sequence", "strategy", *_SHOWN, *(_OPEN_SET if open_set else ()))
