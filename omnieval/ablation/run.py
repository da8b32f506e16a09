"""Runs an ablation: describes the images once, runs the jobs, saves each row when it is done, and writes the table."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import BrokenExecutor, Executor, Future, as_completed
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

import polars as pl

from omnieval.ablation.grid import Span, make_axis, parse_span
from omnieval.ablation.jobs import Described, Job, batch_silhouettes, describe, failed_row
from omnieval.ablation.plan import Plan, make_plan
from omnieval.ablation.store import BEST, KIND, Store, rows_table
from omnieval.ablation.summary import over_replicates, tuned
from omnieval.ablation.tree import grow, plant
from omnieval.config import Setting
from omnieval.datasets import Sequence as ImageSequence
from omnieval.datasets.perturbation import Perturbation, Replicates
from omnieval.descriptors.cache import DescriptorCache
from omnieval.errors import ConfigError, OmnievalError
from omnieval.imaging.soundness import examined
from omnieval.loop import run as replay
from omnieval.material import Cut, Source, opened, with_poses
from omnieval.metrics.catalogue import BY_NAME
from omnieval.processes import workers
from omnieval.recording import RecordingOptions
from omnieval.results.content import content_hash
from omnieval.results.folder import ResultFolder, hold_folder, reason_of
from omnieval.results.provenance import code_digest, versions
from omnieval.results.run_folder import free_folder
from omnieval.wording import did_you_mean

Progress = Callable[[int, int], None]
RUNS = Path("runs")


class JobFailedError(OmnievalError):
    """A job failed and the ablation was to stop there.

    Example: ``job 12 of synthetic-night failed: LinAlgError: ...; run it again with --resume``.
    """

    exit_code: ClassVar[int] = 5


@dataclass(frozen=True)
class Ablation:
    """An ablation folder and its table (`schemas.ablation_schema`).

    `lacking` says why rows have no ``batch_silhouette`` that could have one. `tuned` is what parameters that were
    chosen on some sequences come to on the others (`summary.tuned`), None if none were.
    """

    folder: Path
    table: pl.DataFrame
    lacking: str | None = None
    tuned: pl.DataFrame | None = None

    @property
    def failed(self) -> int:
        """How many jobs failed."""
        return self.table["error"].count()


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
    jobs: int = 1,
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
    jobs, out, resume, overwrite, csv, keep_steps, record_best, fail_fast, progress
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
        plan,
        tune_by=tune_by,
        jobs=jobs,
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
    out
        Folder to write; default ``runs/ablation[-<n>]``.
    resume
        Continue the ablation in `out`: rows that are there are kept, failed jobs are run again. If none was started
        there, it is started.
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
    check_options(plan.exact, jobs=jobs, out=out, resume=resume, overwrite=overwrite, keep=keep_steps or record_best)
    check_tuning(plan, tune_by)
    if jobs > 1:
        _refuse_mappers_of_this_process(plan.jobs)
    with DescriptorCache() as cache:
        for given in {job.input.source: job.input.given for job in plan.jobs}.values():
            if isinstance(given, ImageSequence):
                examined(given, cache)
    store = Store(out or free_folder(RUNS, "ablation"))
    work = _Work(plan, store, jobs, tune_by, keep_steps=keep_steps, fail_fast=fail_fast, progress=progress)
    resume = resume and store.exists()
    held = store.open(None if resume else work.guard, overwrite=overwrite, resume=resume)
    with held as folder, _dropping_descriptors(store):
        if resume:
            store.check(work.guard)
        described = work.describe()
        prints = fingerprints(described)
        if resume:
            store.check(prints)  # before ``run.json`` is written: if the images are others, it stays as it is
            folder.begin(work.guard | prints)
        else:
            folder.update(prints)
        return _finish(work, described, folder, csv=csv, record_best=record_best)


@contextmanager
def _dropping_descriptors(store: Store) -> Iterator[None]:
    try:
        yield
    finally:
        store.drop_descriptors()


def check_options(
    exact: Span | None, *, jobs: int, out: str | Path | None, resume: bool, overwrite: bool, keep: bool
) -> None:
    """Refuse options that contradict each other; `keep` is whether anything of single runs is to be kept.

    Raises
    ------
    ConfigError
        One line, if they do.
    """
    if jobs < 1:
        raise ConfigError(f"--jobs must be 1 or more, got {jobs}")
    if exact and keep:
        raise ConfigError("--exact makes no single runs, so there is nothing to record and no decision trace to keep")
    if resume and (out is None or overwrite):
        raise ConfigError("--resume continues the ablation in --out; name it, and leave --overwrite out")


def guard_of(plan: Plan, *, keep_steps: bool) -> dict[str, Any]:
    """Return what an ablation that is resumed must have in common, besides the datasets."""
    about = {"grid": plan.grid, "keep_steps": keep_steps, "code": code_digest(), "versions": versions()}
    plain: dict[str, Any] = json.loads(json.dumps(about))
    return plain


def fingerprints(described: Mapping[str, Described]) -> dict[str, dict[str, str]]:
    """Return, as the entry of ``run.json``, the fingerprint of each sequence by its source."""
    return {"dataset_fingerprints": {json.loads(key)["source"]: one.fingerprint for key, one in described.items()}}


def dataset_key(job: Job, *, of_map: bool = False) -> str:
    """Return what the descriptions of a job's images depend on, as text; equal keys share them.

    With `of_map`, those of the images in whose map they are looked for.
    """
    assert not of_map or job.input.in_map is not None
    about = {
        "source": (job.input.in_map if of_map and job.input.in_map else job.input).source,
        "descriptor": job.config.descriptor.identity,
        "imaging": job.config.imaging.model_dump(mode="json"),
    }
    return json.dumps(about, sort_keys=True)


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


@dataclass(frozen=True)
class _Work:
    """A plan while it runs: its jobs, those that are done, and the folder for their rows."""

    plan: Plan
    store: Store
    processes: int
    tune_by: str
    keep_steps: bool
    fail_fast: bool
    progress: Progress | None

    @property
    def guard(self) -> dict[str, Any]:
        """What an ablation that is resumed must have in common."""
        return guard_of(self.plan, keep_steps=self.keep_steps)

    def describe(self) -> dict[str, Described]:
        """Describe every sequence once for each way to describe it that the grid has."""
        needed = {dataset_key(job): job for job in self.plan.jobs}
        frames = sum(job.input.images for job in needed.values())
        described: dict[str, Described] = {}
        done = 0
        for number, (key, job) in enumerate(needed.items()):
            folder = self.store.descriptors(number)
            with opened(job.input.given, job.config, job.input.rest) as material:
                described[key] = describe(material, folder)
            done += job.input.images
            if self.progress:
                self.progress(done, frames)
        return described

    def run(self, pool: Executor, described: Mapping[str, Described]) -> None:
        """Run what is not done yet and keep each row as it comes."""
        done = _done(self.store.parts())
        waiting = [job for job in self.plan.jobs if job.number not in done]

        def in_map(job: Job) -> Described | None:
            return described[dataset_key(job, of_map=True)] if job.input.in_map else None

        trees = plant(waiting, [dataset_key(job) for job in waiting], self.processes)
        futures = {
            pool.submit(
                grow, list(map(_sent, tree)), described[dataset_key(tree[0])], self._steps_files(tree), in_map(tree[0])
            ): tree
            for tree in trees
        }
        ended = len(self.plan.jobs) - len(waiting)
        for future in as_completed(futures):
            for job, rows in _by_job(futures[future], future):
                self.store.add(job.number, rows, job.about)
                error = rows[0].get("error")
                if error and self.fail_fast:
                    message = f"job {job.number} of {job.input.name} failed: {error}; run it again with --resume"
                    raise JobFailedError(message)
                ended += 1
                if self.progress:
                    self.progress(ended, len(self.plan.jobs))

    def with_batch(
        self, pool: Executor, described: Mapping[str, Described], rows: Sequence[dict[str, Any]]
    ) -> tuple[pl.DataFrame, str | None]:
        """Return the rows beside batch clustering with as many clusters as each map has nodes, and why some lack it.

        It compares all images with each other, which may need more memory than there is.
        """
        of_job = {job.number: (dataset_key(job), job.config.seed) for job in self.plan.jobs}
        shared: dict[tuple[str, int], set[int]] = {}
        for row in rows:
            if row.get("nodes"):
                shared.setdefault(of_job[row["job"]], set()).add(row["nodes"])
        futures = {
            (dataset, seed): _batch(pool, described[dataset], sorted(ks), seed)
            for (dataset, seed), ks in shared.items()
        }
        errors = {key: error for key, future in futures.items() if (error := future.exception())}
        batch = {key: future.result() for key, future in futures.items() if key not in errors}
        beside = [
            {**row, "batch_silhouette": batch.get(of_job[row["job"]], {}).get(row.get("nodes") or 0)} for row in rows
        ]
        table = rows_table(beside, self.plan.grid["types"])
        return table, "; ".join(dict.fromkeys(_why(error) for error in errors.values())) or None

    def _steps_files(self, tree: Sequence[Job]) -> dict[int, Path]:
        return {job.number: self.store.steps_file(job.number) for job in tree if self.keep_steps}


def _sent(job: Job) -> Job:
    """Return a job as a process gets it: no object goes along, which may hold what cannot.

    Its images are described already, and its mapper is made again of its class and settings.
    """
    mapper, descriptor = job.config.mapper, replace(job.config.descriptor, given=None)
    if mapper.spec is not None:
        mapper = replace(mapper, given=None)
    alone = replace(job.input, given=Path(), in_map=job.input.in_map and replace(job.input.in_map, given=Path()))
    return replace(job, input=alone, config=replace(job.config, mapper=mapper, descriptor=descriptor))


def _refuse_mappers_of_this_process(jobs: Iterable[Job]) -> None:
    for mapper in {id(job.config.mapper): job.config.mapper for job in jobs}.values():
        if mapper.spec is None:  # nothing names its class to another process
            raise ConfigError(
                f"--jobs: the mapper {mapper.name} is known in this process only; put its class into a file, or take "
                "one job"
            )


def _batch(pool: Executor, described: Described, ks: list[int], seed: int) -> Future[dict[int, float | None]]:
    """Have batch clustering done; a pool whose processes have been killed already gives its error in the future too."""
    try:
        return pool.submit(batch_silhouettes, described, ks, seed)
    except BrokenExecutor as error:
        future: Future[dict[int, float | None]] = Future()
        future.set_exception(error)
        return future


def _why(error: BaseException) -> str:
    if isinstance(error, BrokenExecutor):
        return "a worker process was killed, perhaps for lack of memory"
    return reason_of(error)


def _by_job(tree: Sequence[Job], future: Future[list[dict[str, Any]]]) -> list[tuple[Job, list[dict[str, Any]]]]:
    """Return the rows of each job of a tree that has ended."""
    error = future.exception()
    if isinstance(error, BrokenExecutor):
        raise OmnievalError(f"{_why(error)}; --resume with fewer --jobs")
    rows = [failed_row(job, error) for job in tree] if error else future.result()
    return [(job, [row for row in rows if row["job"] == job.number]) for job in tree]


def _done(parts: Mapping[int, Sequence[Mapping[str, Any]]]) -> set[int]:
    """Return the jobs that need not be run again."""
    return {number for number, rows in parts.items() if all(row.get("error") is None for row in rows)}


def _finish(
    work: _Work, described: Mapping[str, Described], folder: ResultFolder, *, csv: bool, record_best: bool
) -> Ablation:
    """Run the jobs, write the table and what else was asked for."""
    started = time.perf_counter()
    with workers(work.processes) as pool:
        work.run(pool, described)
        rows = work.store.rows()
        work.store.write(
            rows_table(rows, work.plan.grid["types"]), csv=csv
        )  # what else befalls us, the sweep has its table
        table, lacking = work.with_batch(pool, described, rows)
    work.store.write(table, csv=csv)
    chosen = tuned(table, work.plan.varied, work.plan.tuned_on, work.tune_by) if work.plan.tuned_on else None
    ablation = Ablation(work.store.folder, table, lacking, chosen)
    if record_best and (best := best_run(table)) is not None:
        job = work.plan.jobs[best]
        with opened(job.input.given, job.config, job.input.rest) as material:
            whole = replace(material, skipped=job.input.skipped)
            replay(whole, job.config, ablation.folder / BEST, overwrite=True, recording=RecordingOptions())
    folder.complete(
        {
            "jobs": len(table),
            "failed_jobs": ablation.failed,
            **({} if chosen is None else {"tuned_by": work.tune_by, "tuned": chosen.to_dicts()}),
            "null_reasons": {"batch_silhouette": lacking} if lacking else {},
            "content_hashes": {KIND: content_hash(table)},
            "timings": {"seconds": time.perf_counter() - started, "processes": work.processes},
        }
    )
    return ablation


def best_run(table: pl.DataFrame) -> int | None:
    """Return the job with the highest silhouette, the first of equals; None if no run has one.

    Where there are replicates, it is the first of those whose mean is the highest.
    """
    scored = over_replicates(table).drop_nulls("silhouette")
    return None if scored.is_empty() else int(scored["job"][int(scored["silhouette"].arg_max() or 0)])


def job_states(plan: Plan, out: str | Path | None, *, keep_steps: bool) -> Sequence[tuple[Job, str]]:
    """Return every job with ``done``, or why it is not; nothing is written and no image is read."""
    store = Store(out) if out else None
    if store is None or not store.exists():
        return [(job, "not started") for job in plan.jobs]
    with hold_folder(store.folder, KIND):
        store.check(guard_of(plan, keep_steps=keep_steps))
        parts = store.parts()
    return [(job, _state(parts.get(job.number))) for job in plan.jobs]


def _state(rows: Sequence[Mapping[str, Any]] | None) -> str:
    if rows is None:
        return "not started"
    error = next((row["error"] for row in rows if row.get("error")), None)
    return f"failed, will run again: {error}" if error else "done"
