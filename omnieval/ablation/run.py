"""Ablations from Python and the command line: options that are checked, and a plan that is run into a folder."""

from __future__ import annotations

import time
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import polars as pl

from omnieval.ablation.crew import crew_of
from omnieval.ablation.driver import Ablation, Progress, Work, conclude, dropping_descriptors, fingerprints, guard_of
from omnieval.ablation.grid import Span, make_axis, parse_span
from omnieval.ablation.jobs import Job
from omnieval.ablation.plan import Plan, make_plan
from omnieval.ablation.shards import Shard, shard_of
from omnieval.ablation.store import FINGERPRINTS, KIND, Part, Store
from omnieval.cluster import ClusterSpec
from omnieval.config import Setting
from omnieval.datasets import Sequence as ImageSequence
from omnieval.datasets.perturbation import Perturbation, Replicates
from omnieval.descriptors.cache import DescriptorCache
from omnieval.errors import ConfigError
from omnieval.imaging.soundness import examined
from omnieval.material.source import Cut, Source, with_poses
from omnieval.metrics.catalogue import BY_NAME
from omnieval.processes import job_count
from omnieval.results.folder import hold_folder
from omnieval.results.run_folder import free_folder
from omnieval.wording import did_you_mean

RUNS = Path("runs")


def ablate(
    sources: Source | Iterable[Source] = "synthetic",
    vary: Mapping[str, Any] | None = None,
    *,
    mapper: Any = None,
    descriptor: Any = None,
    settings: Mapping[str, Any] | None = None,
    exact: str | None = None,
    preset: str | None = None,
    poses: str | Path | None = None,
    poses_tolerance: float | None = None,
    poses_interpolate: float | None = None,
    start: int = 0,
    stride: int = 1,
    limit: int | None = None,
    skip_bad: bool = False,
    perturb: str | None = None,
    replicates: int | None = None,
    tune_on: Source | Iterable[Source] = (),
    tune_by: str = "silhouette",
    localize: Mapping[str, str] | None = None,
    shard: str | None = None,
    jobs: int | str = 1,
    cluster: str | None = None,
    out: str | Path | None = None,
    resume: bool = False,
    overwrite: bool = False,
    csv: bool = False,
    keep_steps: bool = False,
    record_best: bool = False,
    fail_fast: bool = False,
    progress: Progress | None = None,
) -> pl.DataFrame:
    """Replay sequences at every point of a grid and return one row per run (`schemas.ablation_schema`).

    Parameters
    ----------
    sources
        One or several sources as on the command line, or sequences.
    vary
        Values by parameter: a list, or text such as ``"1.7:2.3:0.15"``.
    mapper, descriptor
        One component or several: text such as ``"roman2020,leader"``, a class, an object, or a list of these.
    settings
        Parameters that are the same in all runs.
    exact
        An interval of a parameter, such as ``"merge_y=0.5:3"``: one row for every piece on which the map is the same.
    preset
        Named parameters of the mapper.
    poses, poses_tolerance, poses_interpolate
        Where the images were taken; see `datasets.registry.posed_source`.
    start, stride, limit
        Which frames of each source.
    skip_bad
        Leave out images that are not fit for use instead of refusing the sequence.
    perturb, replicates
        What to perturb, such as ``"start=0:30,stride=1:2,mirror=1,noise=2,reverse"``, and how many times: every source
        is run with each of as many perturbations (`datasets.perturbation`).
    tune_on, tune_by
        Choose parameters on these sources by this metric, and judge them on the others.
    localize
        By source: the source in whose map its images are also looked for.
    shard
        Run only one of so many shares of the jobs, such as ``"2/5"`` (`shards.shard_of`).
    jobs, cluster, out, resume, overwrite, csv, keep_steps, record_best, fail_fast, progress
        See `run_plan`.

    Examples
    --------
    >>> omnieval.ablate("synthetic", {"omega": [1.7, 2.3], "n_new": "20:40:10"}, jobs=2)  # doctest: +SKIP
    """
    several = [sources] if isinstance(sources, str | Path | ImageSequence) else list(sources)
    several = [with_poses(source, poses, poses_tolerance, poses_interpolate) for source in several]
    chosen = {"mapper": mapper, "descriptor": descriptor}
    axes = [make_axis(name, value, name) for name, value in chosen.items() if value is not None]
    axes += [make_axis(name, values, "vary") for name, values in (vary or {}).items()]
    fixed = [Setting(name, value, "settings") for name, value in (settings or {}).items()]
    plan = make_plan(
        several,
        axes,
        fixed,
        exact=parse_span(exact) if exact else None,
        preset=preset,
        cut=Cut(start, stride, limit),
        skip_bad=skip_bad,
        perturbations=drawn(perturb, replicates),
        localize=localize,
        tune_on=[tune_on] if isinstance(tune_on, str | Path | ImageSequence) else list(tune_on),
    )
    return run_plan(
        shard_of(plan, Shard.parse(shard), tune_by) if shard else plan,
        tune_by=tune_by,
        jobs=job_count(jobs),
        cluster=ClusterSpec.parse(cluster) if cluster else None,
        out=out,
        resume=resume,
        overwrite=overwrite,
        csv=csv,
        keep_steps=keep_steps,
        record_best=record_best,
        fail_fast=fail_fast,
        progress=progress,
    ).table


def drawn(perturb: str | None, replicates: int | None) -> list[Perturbation]:
    """Return the perturbations that are asked for; none if nothing is.

    Raises
    ------
    ConfigError
        If one of the two is asked for without the other, or they make no sense.
    """
    if perturb is None and replicates is None:
        return []
    if perturb is None or replicates is None:
        raise ConfigError("--replicates and --perturb go together, e.g. --replicates 20 --perturb mirror=1,noise=2")
    if replicates < 1:
        raise ConfigError(f"--replicates must be 1 or more, got {replicates}")
    return Replicates.parse(perturb).draw(replicates)


def run_plan(
    plan: Plan,
    *,
    tune_by: str = "silhouette",
    jobs: int = 1,
    cluster: ClusterSpec | None = None,
    out: str | Path | None = None,
    resume: bool = False,
    overwrite: bool = False,
    csv: bool = False,
    keep_steps: bool = False,
    record_best: bool = False,
    fail_fast: bool = False,
    progress: Progress | None = None,
) -> Ablation:
    """Run the jobs of a plan.

    Parameters
    ----------
    plan
        See `plan.make_plan`.
    tune_by
        The metric that parameters are chosen by, if they are (`Plan.tuned_on`).
    jobs
        Processes; the rows do not depend on it, except the seconds.
    cluster
        Workers elsewhere that run the jobs instead (`omnieval.cluster`); neither do the rows depend on them.
    out
        Folder to write; default ``runs/ablation[-<n>]``.
    resume
        Continue the ablation in `out`, with all its values and sources, and more if there are more: rows that are
        there are kept, failed jobs are run again. If none was started there, it is started.
    overwrite
        Replace an earlier ablation in `out`.
    csv
        Write ``ablation.csv`` too.
    keep_steps
        Keep the decision trace of every run.
    record_best
        Replay the run with the highest silhouette once more into ``best/``, with a recording.
    fail_fast
        Stop at the first job that fails.
    progress
        Called with (done, in all): frames described first, then jobs.

    Raises
    ------
    ConfigError
        If an option is wrong.
    DatasetError
        If an image is not fit for use; nothing is written then.
    ResultError
        If the folder cannot be written, or what is to be resumed differs.
    JobFailedError
        With `fail_fast`, when a job fails.
    """
    check_options(plan.exact, out=out, resume=resume, overwrite=overwrite, keep=keep_steps or record_best)
    if plan.shard and record_best:
        raise ConfigError("a shard does not know the best run of all; record it when the shards are merged")
    check_tuning(plan, tune_by)
    jobs = job_count(jobs)
    if jobs > 1 and cluster:
        raise ConfigError("--jobs is for processes of this command, --cluster for workers elsewhere; give one of them")
    if jobs > 1 or cluster:
        _refuse_mappers_of_this_process(plan.jobs)
    with DescriptorCache() as cache:
        for given in {job.input.source: job.input.given for job in plan.jobs}.values():
            if isinstance(given, ImageSequence):
                examined(given, cache)
    store = Store(out or free_folder(RUNS, "ablation"))
    work = Work(plan, store, tune_by, keep_steps=keep_steps, fail_fast=fail_fast, progress=progress)
    resume = resume and store.exists()
    held = store.open(None if resume else work.guard, overwrite=overwrite, resume=resume)
    with crew_of(plan.jobs, jobs, cluster) as crew, held as folder, dropping_descriptors(store):
        if resume:
            _check(store, plan, work.guard)
        described = work.describe(crew)
        prints = fingerprints(described)
        if resume:
            # Before ``run.json`` is written: if the images are others, it stays as it is.
            store.check_fingerprints(prints[FINGERPRINTS])
            folder.begin(work.guard | prints, store.best_files() if work.waiting else ())
            store.renumber({job.key: job.number for job in plan.jobs})
        else:
            folder.update(prints)
        started = time.perf_counter()
        crew.take(described)
        work.run(crew, described)
        return conclude(work, described, folder, crew, started=started, csv=csv, record_best=record_best)


def check_options(exact: Span | None, *, out: str | Path | None, resume: bool, overwrite: bool, keep: bool) -> None:
    """Refuse options that contradict each other; `keep` is whether anything of single runs is to be kept.

    Raises
    ------
    ConfigError
        One line, if they do.
    """
    if exact and keep:
        raise ConfigError("--exact makes no single runs, so there is nothing to record and no decision trace to keep")
    if resume and (out is None or overwrite):
        raise ConfigError("--resume continues the ablation in --out; name it, and leave --overwrite out")


def _check(store: Store, plan: Plan, guard: Mapping[str, Any]) -> None:
    """See that a plan goes on with what a folder holds, as far as can be told without the images."""
    store.check({name: value for name, value in guard.items() if name not in ("grid", "shard")})
    store.check_growth(guard["grid"], guard.get("shard"), [job.key for job in plan.jobs])


def check_tuning(plan: Plan, tune_by: str) -> None:
    """Refuse a metric that parameters cannot be chosen by.

    Raises
    ------
    ConfigError
        If there is no such metric, neither way of it is better, or the ablation makes no single runs.
    """
    if not plan.tuned_on:
        return
    if plan.exact:
        raise ConfigError("--exact makes no single runs, so none can be chosen; leave --tune-on out")
    if tune_by not in BY_NAME:
        raise ConfigError(f"--tune-by: there is no metric {tune_by}; {did_you_mean(tune_by, BY_NAME)}")
    if BY_NAME[tune_by].better is None:
        raise ConfigError(f"--tune-by: {tune_by} has no better direction; choose another metric, for example pair_f1")


def _refuse_mappers_of_this_process(jobs: Iterable[Job]) -> None:
    for mapper in {id(job.config.mapper): job.config.mapper for job in jobs}.values():
        if mapper.spec is None:  # nothing names its class to another process
            raise ConfigError(
                f"--jobs: the mapper {mapper.name} is known in this process only; put its class into a file, or take "
                "one job"
            )


def job_states(plan: Plan, out: str | Path | None, *, keep_steps: bool) -> Sequence[tuple[Job, str]]:
    """Return every job with ``done``, or why it is not; nothing is written and no image is read."""
    store = Store(out) if out else None
    if store is None or not store.exists():
        return [(job, "not started") for job in plan.jobs]
    with hold_folder(store.folder, KIND):
        _check(store, plan, guard_of(plan, keep_steps=keep_steps))
        parts = store.parts()
    return [(job, _state(parts.get(job.key))) for job in plan.jobs]


def _state(part: Part | None) -> str:
    if part is None:
        return "not started"
    return f"failed, will run again: {part.error}" if part.error else "done"
