"""``omnieval baseline``: batch and control methods, judged like a map."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from omnieval.cli import options

_SHOWN = (
    *("k", "nodes", "silhouette", "silhouette_time_slices", "silhouette_positions"),
    *("pair_f1", "reentry_f1_final", "false_merge_share", "rooms_ari", "rooms_nmi"),
)
_SHOWN_LAST = ("rooms_purity", "share_unassigned", "seconds")


def baseline(
    source: Annotated[
        str, typer.Argument(help="Sequence or archive of descriptors, as for replay.", metavar="SOURCE")
    ] = "synthetic",
    method: Annotated[
        str,
        typer.Option(
            help="spectral, kmeans, agglomerative, dbstream, time-slices, positions or rooms.", metavar="NAME"
        ),
    ] = "spectral",
    similarity: Annotated[
        str | None,
        typer.Option(
            help="For spectral: gaussian-median, local-scaling or knn; default the first, above 10,000 images knn.",
            metavar="NAME",
        ),
    ] = None,
    k: Annotated[
        str | None, typer.Option("--k", help="Numbers of clusters, e.g. 2:40 (default), 5,9,20 or 7.", metavar="KS")
    ] = None,
    at_k_of: Annotated[
        Path | None, typer.Option("--at-k-of", help="Use as many clusters as this run has nodes.", metavar="RUN")
    ] = None,
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
    skip_bad: options.SkipBad = False,
    out: Annotated[
        Path | None,
        typer.Option(help="Folder to write; default runs/<sequence>-<descriptor>-<method>[-<n>].", metavar="DIR"),
    ] = None,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Replace an earlier baseline in the same folder.")
    ] = False,
    json: options.Json = False,
) -> None:
    """Divide a sequence by a batch or control method, and judge the result by the metrics of a replay.

    Writes baseline.parquet, one row per number of clusters, and prints it.

    Examples:

      omnieval baseline synthetic:night

      omnieval baseline cold:/data/seq2_cloudy3 --similarity knn --k 2:60

      omnieval baseline --method kmeans --at-k-of runs/synthetic-cloudy-hog

      omnieval baseline mine.npz --method positions --k 5,10,20 --json
    """
    from omnieval.benchmark import check_options, run_baseline
    from omnieval.cli.console import print_json, progress
    from omnieval.text_table import aligned, cell_text

    resolved = options.configuration(set_, config, descriptor=descriptor, camera=camera)
    ks = None if k is None else parse_ks(k)
    check_options(method=method, similarity=similarity, ks=ks, at_k_of=at_k_of)
    taken = options.source_with(
        source, poses, poses_tolerance, poses_interpolate, topic, pose_topic, pose_frame, decode_every
    )
    with progress(method) as report:
        run = run_baseline(
            taken,
            method=method,
            similarity=similarity,
            ks=ks,
            at_k_of=at_k_of,
            config=resolved,
            cut=options.cut(start, stride, limit),
            skip_bad=skip_bad,
            out=out,
            overwrite=overwrite,
            progress=report,
        )
    if json:
        print_json({"run": str(run.folder), **run.manifest, "rows": run.table.to_dicts()})
        return
    print(run.folder)
    shown = run.table.select(*_SHOWN, *_SHOWN_LAST)
    rows = [shown.columns, *(list(map(cell_text, row)) for row in shown.iter_rows())]
    print("\n".join(aligned(rows, "r" * len(shown.columns))))
    for name, reason in run.manifest["null_reasons"].items():
        if name in _SHOWN:
            print(f"{name}: {reason}")


def parse_ks(text: str) -> list[int]:
    """Read numbers of clusters: ``2:40`` (both included), ``5,9,20`` or ``7``.

    Raises
    ------
    ConfigError
        If it is neither, or the range is empty.
    """
    from omnieval.errors import ConfigError

    first, colon, last = text.partition(":")
    try:
        ks = list(range(int(first), int(last) + 1)) if colon else [int(part) for part in text.split(",")]
    except ValueError:
        ks = []
    if not ks:
        raise ConfigError(f"--k {text!r}: expected numbers of clusters such as 2:40, 5,9,20 or 7")
    return ks
