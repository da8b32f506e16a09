"""``omnieval check``: replays compared with a committed reference."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from omnieval.cli import options

if TYPE_CHECKING:
    from omnieval.regression.cases import Selection


def check(
    reference: Annotated[Path, typer.Option(help="Reference file, e.g. runs/reference/mine.toml.", metavar="FILE")],
    targets: Annotated[
        list[str] | None,
        typer.Argument(
            help="Run folders, compared as they are, and sources, replayed. None: every case of the reference.",
            metavar="RUN|SOURCE",
        ),
    ] = None,
    update: Annotated[
        bool, typer.Option("--update", help="Accept the present results: update the reference, or create it.")
    ] = False,
    intervals: Annotated[
        bool,
        typer.Option(
            "--intervals", help="With --update: guard 95 % intervals, not tolerances, of metrics that have some."
        ),
    ] = False,
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
    skip_bad: options.SkipBad = False,
    jobs: options.Jobs = "1",
    junit: Annotated[Path | None, typer.Option(help="Also write JUnit XML.", metavar="FILE.xml")] = None,
    json: options.Json = False,
) -> None:
    """Check that maps are no worse than a reference says: silhouettes, shares, agreement with rooms, number of nodes.

    Images of other sequences that a reference looks for in its maps ([[localization]]) must be found as well as before.

    Exits with 4 and a table of expected, got and difference if a guarded value is worse by more than its tolerance,
    outside its range, or missing; if the whole 95 % interval of a replay is worse than a guarded one; and if there is
    no reference or no case to compare with. A better value passes. A case that cannot be replayed is not a regression:
    3 if its images cannot be read, 2 if its components or parameters are not there. Components, parameters and cuts
    select among the cases of a SOURCE, or with --update add one.

    Examples:

      omnieval check --reference runs/reference/synthetic.toml --jobs 2

      omnieval check runs/mine --reference mine.toml

      omnieval check cold:data/seq2_cloudy3 --reference mine.toml --update

      omnieval check --reference mine.toml --junit check.xml
    """
    from omnieval.processes import job_count

    count = job_count(jobs)
    selection = _selection(set_, config, camera, preset, mapper, descriptor, start, stride, limit, skip_bad=skip_bad)
    from omnieval.errors import ConfigError

    about = poses, poses_tolerance, poses_interpolate, topic, pose_topic, pose_frame, decode_every
    if any(value is not None for value in about):
        _check_are_sources(targets or [])
    targets = [options.source_with(target, *about) for target in targets or ()]
    if intervals and not update:
        raise ConfigError("--intervals says what --update writes; a reference says itself what it guards")
    if junit:
        _check_junit(junit, update=update)
    if update:
        _update(reference, targets, selection, intervals=intervals, json=json)
    else:
        _check(reference, targets, selection, count, junit, json=json)


def _check(
    reference: Path, targets: list[str], selection: Selection | None, jobs: int, junit: Path | None, *, json: bool
) -> None:
    import polars as pl

    from omnieval.cli.console import print_json, print_table, progress
    from omnieval.regression.case_report import as_object, explanations, failure, table_rows
    from omnieval.regression.gate import check as check_cases
    from omnieval.regression.junit import write_junit

    with progress("checking") as report_progress:
        reports = check_cases(reference, targets, selection=selection, jobs=jobs, progress=report_progress)
    if junit:
        write_junit(reports, junit)
    if json:
        print_json(as_object(reports, reference))
    else:
        print_table(pl.DataFrame(table_rows(reports)))
        for report in reports:
            if lines := list(explanations(report)):
                print(f"\n{report.name}")
                print("\n".join(f"  {line}" for line in lines))
    if (error := failure(reports, reference)) is not None:
        raise error


def _check_are_sources(targets: list[str]) -> None:
    """Refuse options about sources where there is none: cases say what theirs are, and runs have been judged."""
    from omnieval.errors import ConfigError
    from omnieval.results.manifest import MANIFEST

    if not targets or any((Path(target) / MANIFEST).is_file() for target in targets):
        raise ConfigError("options of poses, videos and bags are for a SOURCE that is replayed; name one")


def _check_junit(junit: Path, *, update: bool) -> None:
    """Refuse a file that could not be written, before the replays that it is to tell of."""
    from omnieval.errors import ConfigError

    if update:
        raise ConfigError("--update gives no results that --junit could write; use only one of them")
    if junit.is_dir() or not junit.parent.is_dir():
        reason = "it is a folder" if junit.is_dir() else f"there is no folder {junit.parent}"
        raise ConfigError(f"cannot write --junit {junit}: {reason}; choose another file")


def _update(reference: Path, targets: list[str], selection: Selection | None, *, intervals: bool, json: bool) -> None:
    from omnieval.cli.console import print_json, progress
    from omnieval.regression.update import change_lines
    from omnieval.regression.update import update as update_cases

    with progress("replaying") as report_progress:
        changes = update_cases(reference, targets, selection=selection, intervals=intervals, progress=report_progress)
    if json:
        content = [dataclasses.asdict(change) for change in changes]
        print_json({"schema_version": 1, "reference": str(reference), "changes": content})
        return
    print(reference)
    for change in changes:
        for line in change_lines(change):
            print(f"  {line}")


def _selection(
    settings: list[str] | None,
    files: list[Path] | None,
    camera: Path | None,
    preset: str | None,
    mapper: str | None,
    descriptor: str | None,
    start: int,
    stride: int,
    limit: int | None,
    *,
    skip_bad: bool,
) -> Selection | None:
    """Return what the options select; None when none is given."""
    from omnieval.regression.cases import Selection

    cut = options.cut(start, stride, limit)
    if cut.whole and not any((settings, files, camera, preset, mapper, descriptor, skip_bad)):
        return None
    chosen = options.configuration(settings, files, preset, mapper, descriptor, camera=camera)
    return Selection(chosen, cut, skip_bad)
