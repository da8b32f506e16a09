"""``omnieval ablate``: sweeps of parameters."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from omnieval.cli import options

if TYPE_CHECKING:
    from omnieval.ablation.driver import Ablation
    from omnieval.ablation.grid import Axis, Span
    from omnieval.ablation.plan import Plan
    from omnieval.config import Setting
    from omnieval.datasets.perturbation import Perturbation
    from omnieval.material.source import Cut

SOME_FAILED = 5


def ablate(
    context: typer.Context,
    sources: Annotated[
        list[str] | None,
        typer.Argument(
            help="Sequences as for replay; default synthetic. With --merge, the folders of the shards.",
            metavar="SOURCE",
        ),
    ] = None,
    vary: Annotated[
        list[str] | None,
        typer.Option(
            "--vary",
            help="A parameter and its values, e.g. omega=1.7:2.3:0.15 or covariance=diagonal,pinv; repeatable.",
            metavar="NAME=VALUES",
        ),
    ] = None,
    axes: Annotated[
        list[Path] | None,
        typer.Option(
            "--axes",
            help="TOML file of parameters and their values, NAME = [..] or 'a:b:step'; repeatable.",
            metavar="FILE.toml",
        ),
    ] = None,
    exact: Annotated[
        str | None,
        typer.Option(
            "--exact",
            help="Find every value of a threshold in an interval at which the map changes, e.g. merge_y=0.5:3: one row "
            "for each piece of the interval, which has the same map throughout.",
            metavar="NAME=FIRST:LAST",
        ),
    ] = None,
    mapper: Annotated[
        str | None, typer.Option("--mapper", help="Mapper, or several: roman2020,leader.", metavar="NAMES")
    ] = None,
    descriptor: Annotated[
        str | None, typer.Option("--descriptor", help="Descriptor, or several: hog,mine.py:Mine.", metavar="NAMES")
    ] = None,
    set_: options.Set = None,
    config: options.ConfigFile = None,
    camera: options.CameraFile = None,
    preset: Annotated[
        list[str] | None,
        typer.Option(
            help="Axes of an experiment of the paper (figures-9-10, table-2, table-3), named parameters of the mapper "
            "(recommended, paper-literal), or one of each; or benchmark: all mappers and descriptors on the synthetic "
            "buildings 2 to 6, and those of --mapper and --descriptor as well.",
            metavar="NAME",
        ),
    ] = None,
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
    perturb: Annotated[
        str | None,
        typer.Option(
            help="Perturb every sequence at random: start=0:30,stride=1:2,mirror=1,noise=2,gain=0.1,reverse,seed=0.",
            metavar="WHAT",
        ),
    ] = None,
    replicates: Annotated[
        int | None, typer.Option(min=1, help="How many random variants of every sequence.", metavar="N")
    ] = None,
    tune_on: Annotated[
        list[str] | None,
        typer.Option(
            "--tune-on",
            help="Choose the best parameters on these sequences, and judge them on the others; repeatable, or "
            "separated by commas.",
            metavar="SOURCES",
        ),
    ] = None,
    tune_by: Annotated[
        str, typer.Option("--tune-by", help="Metric by which --tune-on chooses.", metavar="METRIC")
    ] = "silhouette",
    jobs: options.Jobs = "1",
    cluster: Annotated[
        str | None,
        typer.Option(
            help="Workers by Dask that run the jobs instead: local:N, tcp://HOST:8786, or a file of jobs to submit; "
            "the table does not depend on them.",
            metavar="WHERE",
        ),
    ] = None,
    cluster_template: Annotated[
        str | None,
        typer.Option("--cluster-template", help="Print a file for --cluster, with comments: slurm.", metavar="slurm"),
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="Folder to write; default runs/ablation[-<n>].", metavar="DIR")
    ] = None,
    resume: Annotated[
        bool,
        typer.Option(
            "--resume", help="Continue the ablation in --out; with more values or sources than it had, it grows."
        ),
    ] = False,
    shard: Annotated[
        str | None,
        typer.Option(
            help="Run the jobs of one of so many shares, each into a folder of its own, e.g. 2/5.",
            metavar="NUMBER/OF",
        ),
    ] = None,
    merge: Annotated[
        bool, typer.Option("--merge", help="Put the folders of all shards together into --out; nothing is run.")
    ] = False,
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Replace an earlier ablation in the same folder.")
    ] = False,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="List the jobs and whether each is done, and run none.")
    ] = False,
    keep_steps: Annotated[bool, typer.Option("--keep-steps", help="Keep the decision trace of every run.")] = False,
    fail_fast: Annotated[bool, typer.Option("--fail-fast", help="Stop at the first job that fails.")] = False,
    csv: Annotated[bool, typer.Option("--csv", help="Write ablation.csv too.")] = False,
    rrd: Annotated[
        str | None, typer.Option("--rrd", help="best: record the run with the highest silhouette.", metavar="best")
    ] = None,
    json: options.Json = False,
) -> None:
    """Replay sequences at every point of a grid of parameters: one row per run.

    Writes ablation.parquet and prints the best and the median of each sequence, mapper and descriptor. Exits with 5 if
    a job failed; its row says why.

    Examples:

      omnieval ablate --vary omega=1.7,2,2.3 --vary merge_y=0.75:2.25:0.25

      omnieval ablate synthetic synthetic:night --vary n_new=10:50:10 --jobs 2

      omnieval ablate synthetic --exact merge_y=0.5:3

      omnieval ablate --mapper roman2020,leader --descriptor hog,gist

      omnieval ablate --preset figures-9-10 --out runs/figures --resume

      omnieval ablate --preset benchmark --jobs 2 --out runs/benchmark

      omnieval ablate --replicates 20 --perturb start=0:30,mirror=1,noise=2

      omnieval ablate synthetic:night --vary n_new=10:50:10 --tune-on synthetic

      omnieval ablate --vary n_new=10:50:10 --shard 1/2 --out runs/half-1

      omnieval ablate --vary n_new=10:50:10 --shard 2/2 --out runs/half-2

      omnieval ablate --merge runs/half-1 runs/half-2 --out runs/halves
    """
    from omnieval.ablation.grid import parse_span
    from omnieval.ablation.run import check_options, check_tuning, drawn, run_plan
    from omnieval.ablation.shards import Shard, shard_of
    from omnieval.cli.console import progress
    from omnieval.cluster import ClusterSpec
    from omnieval.errors import ConfigError
    from omnieval.processes import job_count

    if cluster_template is not None:
        _print_template(cluster_template)
        return
    if rrd not in {None, "best"}:
        raise ConfigError(f"--rrd {rrd!r}: the only choice is best")
    benchmark, presets = _benchmark(preset)
    if merge:
        _refuse_besides_folders(context)
        _merge(sources or (), out, overwrite=overwrite, csv=csv, best=rrd == "best", benchmark=benchmark, json=json)
        return
    span = parse_span(exact) if exact else None
    part = Shard.parse(shard) if shard else None
    count = job_count(jobs)
    where = ClusterSpec.parse(cluster) if cluster else None
    check_options(span, out=out, resume=resume, overwrite=overwrite, keep=keep_steps or rrd == "best")
    chosen = {"mapper": mapper, "descriptor": descriptor}
    cut = options.cut(start, stride, limit)
    about = poses, poses_tolerance, poses_interpolate, topic, pose_topic, pose_frame, decode_every
    given = [options.source_with(source, *about) for source in sources or _default_sources(benchmark=benchmark)]
    tuning = [source for text in tune_on or () for source in ([text] if "#" in text else text.split(","))]
    settings = options.settings(set_, config, camera)
    plan = _plan(
        given,
        vary,
        axes,
        span,
        chosen,
        settings,
        presets,
        cut,
        skip_bad,
        drawn(perturb, replicates),
        benchmark=benchmark,
        tune_on=[options.source_with(source, *about) for source in tuning],
    )
    check_tuning(plan, tune_by)
    if part:
        plan = shard_of(plan, part, tune_by)
    if dry_run:
        _print_jobs(plan, out, keep_steps=keep_steps, json=json)
        return
    with progress("ablating") as report:
        ablation = run_plan(
            plan,
            tune_by=tune_by,
            jobs=count,
            cluster=where,
            out=out,
            resume=resume,
            overwrite=overwrite,
            csv=csv,
            keep_steps=keep_steps,
            record_best=rrd == "best",
            fail_fast=fail_fast,
            progress=report,
        )
    _end(ablation, plan, benchmark=benchmark and part is None, json=json)


def _print_template(kind: str) -> None:
    from omnieval.cluster import SLURM
    from omnieval.errors import ConfigError

    if kind != "slurm":
        raise ConfigError(f"--cluster-template {kind!r}: there is one, slurm")
    print(SLURM, end="")


_BESIDES_FOLDERS = frozenset({"sources", "merge", "out", "overwrite", "csv", "rrd", "json", "preset"})
"""What --merge takes; all else is in the folders."""


def _refuse_besides_folders(context: typer.Context) -> None:
    """Refuse options that say anew what the shards say."""
    from omnieval.errors import ConfigError

    defaults = {one.name: one.default for one in context.command.params}
    asked = [
        f"--{name.rstrip('_').replace('_', '-')}"
        for name, value in context.params.items()
        if name not in _BESIDES_FOLDERS and value not in (None, [], (), defaults[name])
    ]
    if asked:
        raise ConfigError(f"--merge takes what the shards are of from their folders; leave {', '.join(asked)} out")


def _merge(
    folders: Sequence[str], out: Path | None, *, overwrite: bool, csv: bool, best: bool, benchmark: bool, json: bool
) -> None:
    from omnieval.ablation.merge import merge
    from omnieval.cli.console import progress
    from omnieval.errors import ConfigError

    if not folders or out is None:
        raise ConfigError("--merge needs the folders of all shards, and --out for the whole")
    with progress("merging") as report:
        ablation, plan = merge(folders, out, overwrite=overwrite, csv=csv, record_best=best, progress=report)
    _end(ablation, plan, benchmark=benchmark, json=json)


def _end(ablation: Ablation, plan: Plan, *, benchmark: bool, json: bool) -> None:
    """Print what an ablation came to, and write its page if it is a benchmark."""
    _print(ablation, plan, json=json)
    if benchmark:
        _write_page(ablation)
    if ablation.failed:
        raise typer.Exit(SOME_FAILED)


def _plan(
    sources: Sequence[str] | None,
    vary: Sequence[str] | None,
    files: Sequence[Path] | None,
    exact: Span | None,
    chosen: dict[str, str | None],
    settings: Sequence[Setting],
    presets: Sequence[str] | None,
    cut: Cut,
    skip_bad: bool,
    perturbations: Sequence[Perturbation],
    *,
    benchmark: bool,
    tune_on: Sequence[str],
) -> Plan:
    """Return the plan the options ask for."""
    from omnieval.ablation.grid import EXPERIMENTS, make_axis, parse_axis, preset_axes, read_axes
    from omnieval.ablation.plan import make_plan
    from omnieval.ablation.suite import benchmark_axes, benchmark_pairs

    axes = [make_axis(kind, names, f"--{kind} {names}") for kind, names in chosen.items() if names is not None]
    axes += [axis for file in files or () for axis in read_axes(file)]
    axes += [parse_axis(text) for text in vary or ()]
    if benchmark:
        axes = benchmark_axes(axes)
    experiment, named = _presets(presets or (), axes)
    if experiment is not None:
        axes = preset_axes(axes, EXPERIMENTS[experiment], experiment)
    return make_plan(
        sources or (),
        axes,
        settings,
        exact=exact,
        preset=named,
        cut=cut,
        skip_bad=skip_bad,
        perturbations=perturbations,
        tune_on=tune_on,
        localize=benchmark_pairs(sources or ()) if benchmark else None,
    )


def _benchmark(presets: Sequence[str] | None) -> tuple[bool, list[str]]:
    """Return whether the benchmark is among the presets, and the others."""
    from omnieval.ablation.suite import BENCHMARK

    return BENCHMARK in (presets or ()), [name for name in presets or () if name != BENCHMARK]


def _default_sources(*, benchmark: bool) -> list[str]:
    from omnieval.ablation.suite import benchmark_sources

    return benchmark_sources() if benchmark else ["synthetic"]


def _presets(names: Sequence[str], axes: Sequence[Axis]) -> tuple[str | None, str | None]:
    """Return the experiment and the named parameters among the presets."""
    from omnieval.ablation.grid import EXPERIMENTS
    from omnieval.ablation.suite import BENCHMARK
    from omnieval.config import presets
    from omnieval.errors import ConfigError
    from omnieval.wording import did_you_mean

    mappers = next((axis.values for axis in axes if axis.name == "mapper"), (None,))
    known = {name for mapper in mappers for name in presets(mapper)}
    for name in names:
        if name not in EXPERIMENTS and name not in known:
            raise ConfigError(
                f"unknown preset {name!r}; {did_you_mean(name, [*EXPERIMENTS, BENCHMARK, *sorted(known)])}"
            )
    experiments = [name for name in names if name in EXPERIMENTS]
    parameters = [name for name in names if name in known]
    if len(experiments) > 1 or len(parameters) > 1:
        raise ConfigError(f"--preset {', '.join(names)}: take at most one experiment and one set of parameters")
    return next(iter(experiments), None), next(iter(parameters), None)


def _write_page(ablation: Ablation) -> None:
    """Write the page of a benchmark beside its table, and say where."""
    import shlex
    import sys

    from omnieval.ablation.store import KIND, PAGE
    from omnieval.cli.console import note
    from omnieval.comparison.page import benchmark_page
    from omnieval.results.atomic import replacing
    from omnieval.results.manifest import read_manifest

    command = shlex.join(["omnieval", *sys.argv[1:]])
    page = benchmark_page(ablation.table, command, read_manifest(ablation.folder, KIND))
    with replacing(ablation.folder / PAGE) as temporary:
        temporary.write_text(page, "utf-8")
    note(f"the page is {ablation.folder / PAGE}")


def _print_jobs(plan: Plan, out: Path | None, *, keep_steps: bool, json: bool) -> None:
    from omnieval.ablation.grid import value_of
    from omnieval.ablation.run import job_states
    from omnieval.cli.console import print_json

    states = job_states(plan, out, keep_steps=keep_steps)
    rows = [
        {
            "job": job.number,
            "source": job.input.source,
            **{name: value_of(job.config, name) for name in plan.varied},
            "state": state,
        }
        for job, state in states
    ]
    if json:
        print_json({"jobs": rows})
        return
    for row in rows:
        varied = " ".join(f"{name}={row[name]}" for name in plan.varied)
        print("  ".join(filter(None, (str(row["job"]), row["source"], varied, row["state"]))))
    print(f"{len(rows)} jobs, {sum(state == 'done' for _, state in states)} done")


def _print(ablation: Ablation, plan: Plan, *, json: bool) -> None:
    """Print the results of an ablation."""
    from omnieval.ablation.summary import best_and_median, pieces
    from omnieval.cli.console import note, print_json, print_table

    summary = pieces(ablation.table, plan.varied) if plan.exact else best_and_median(ablation.table, plan.varied)
    if json:
        chosen = {} if ablation.tuned is None else {"tuned": ablation.tuned.to_dicts()}
        about = {"ablation": str(ablation.folder), "summary": summary.to_dicts(), **chosen}
        print_json({**about, "rows": ablation.table.to_dicts()})
    else:
        print(ablation.folder)
        print_table(summary)
        if ablation.tuned is not None and not ablation.tuned.is_empty():
            print()
            print_table(ablation.tuned)
    if ablation.tuned is not None and ablation.tuned.is_empty():
        note("no parameters were chosen: no setting has a value of --tune-by in all of its runs on --tune-on")
    if ablation.lacking:
        note(f"batch_silhouette is missing where it could not be computed: {ablation.lacking}; --resume tries it again")
    if ablation.failed:
        note(f"{ablation.failed} of {len(ablation.table)} jobs failed; their rows say why, --resume runs them again")
