"""The driver of an ablation: describe once, run the jobs, keep each row as it comes, and put the table together."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import BrokenExecutor, Future
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

import polars as pl

from omnieval.ablation.crew import Crew
from omnieval.ablation.jobs import Described, Job, dataset_key, describe, failed_row
from omnieval.ablation.plan import Plan
from omnieval.ablation.store import BEST, FINGERPRINTS, KIND, Part, Store, rows_table
from omnieval.ablation.summary import over_replicates, tuned
from omnieval.ablation.tree import plant
from omnieval.ablation.worker import Grown, OtherWorkerError
from omnieval.errors import OmnievalError, ResultError
from omnieval.loop import run as replay
from omnieval.material.opening import opened
from omnieval.recording import RecordingOptions
from omnieval.results.atomic import replacing
from omnieval.results.content import content_hash
from omnieval.results.folder import ResultFolder, reason_of
from omnieval.results.provenance import code_digest, versions

Progress = Callable[[int, int], None]
UNTIL_MERGED = "computed when the shards are merged"
"""Why the table of a shard has no batch clustering."""


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


def guard_of(plan: Plan, *, keep_steps: bool) -> dict[str, Any]:
    """Return what determines an ablation, besides the images; all but the grid is the same when it is resumed."""
    about = {"grid": plan.grid, "keep_steps": keep_steps, "code": code_digest(), "versions": versions()}
    if plan.shard:
        about["shard"] = plan.shard
    plain: dict[str, Any] = json.loads(json.dumps(about))
    return plain


def fingerprints(described: Mapping[str, Described]) -> dict[str, dict[str, str]]:
    """Return, as the entry of ``run.json``, the fingerprint of each sequence by its source."""
    return {FINGERPRINTS: {json.loads(key)["source"]: one.fingerprint for key, one in described.items()}}


@dataclass(frozen=True)
class Work:
    """A plan while it runs: its jobs, those that are done, and the folder for their rows."""

    plan: Plan
    store: Store
    tune_by: str
    keep_steps: bool
    fail_fast: bool
    progress: Progress | None

    @property
    def guard(self) -> dict[str, Any]:
        """What an ablation that is resumed must have in common."""
        return guard_of(self.plan, keep_steps=self.keep_steps)

    @property
    def waiting(self) -> list[Job]:
        """The jobs that are not done; those that failed are run again."""
        done = {key for key, part in self.store.parts().items() if part.error is None}
        return [job for job in self.plan.jobs if job.key not in done]

    def describe(self, crew: Crew) -> dict[str, Described]:
        """Describe every sequence once for each way to describe it that the grid has."""
        needed = {dataset_key(job): (job.input, job.config) for job in self.plan.jobs}
        for job in self.plan.jobs:
            if job.input.in_map:  # a shard may have no job of its own on the images of the map
                needed.setdefault(dataset_key(job, of_map=True), (job.input.in_map, job.config))
        frames = sum(one.images for one, _ in needed.values())
        described: dict[str, Described] = {}
        done = 0
        for number, (key, (one, config)) in enumerate(needed.items()):
            folder = self.store.descriptors(number)
            with opened(one.given, config, one.rest, elsewhere=crew.elsewhere) as material:
                described[key] = describe(material, folder)
            done += one.images
            if self.progress:
                self.progress(done, frames)
        return described

    def run(self, crew: Crew, described: Mapping[str, Described]) -> None:
        """Run what is not done yet and keep each row as it comes."""
        waiting = self.waiting

        def in_map(job: Job) -> Described | None:
            return described[dataset_key(job, of_map=True)] if job.input.in_map else None

        def grown(tree: Sequence[Job]) -> Future[Grown]:
            jobs, images = list(map(_sent, tree)), described[dataset_key(tree[0])]
            return crew.grow(jobs, images, in_map(tree[0]), self._steps_files(tree))

        ended = len(self.plan.jobs) - len(waiting)

        def keep(tree: Sequence[Job], future: Future[Grown]) -> None:
            nonlocal ended
            for job, rows in self._by_job(tree, future):
                part = Part(job.number, job.key, job.about, rows)
                self.store.add(part)
                if part.error and self.fail_fast:
                    message = f"job {job.number} of {job.input.name} failed: {part.error}; run it again with --resume"
                    raise JobFailedError(message)
                ended += 1
                if self.progress:
                    self.progress(ended, len(self.plan.jobs))

        trees = plant(waiting, [dataset_key(job) for job in waiting], crew.count)
        futures = {grown(tree): tree for tree in trees}
        suspects: list[Sequence[Job]] = []
        for future in crew.completed(futures):
            if crew.killed(future):
                suspects.append(futures[future])
            else:
                keep(futures[future], future)
        # Whoever killed a worker, all that it had been given is blamed; what kills one when it is alone is to blame.
        for tree in suspects:
            for future in crew.completed([grown(tree)]):
                keep(tree, future)

    def with_batch(
        self, crew: Crew, described: Mapping[str, Described], rows: Sequence[dict[str, Any]]
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
            (dataset, seed): crew.batch(described[dataset], sorted(ks), seed) for (dataset, seed), ks in shared.items()
        }
        for _ in crew.completed(futures.values()):
            pass
        errors = {key: error for key, future in futures.items() if (error := future.exception())}
        batch = {key: future.result() for key, future in futures.items() if key not in errors}
        beside = [
            {**row, "batch_silhouette": batch.get(of_job[row["job"]], {}).get(row.get("nodes") or 0)} for row in rows
        ]
        table = rows_table(beside, self.plan.grid["types"])
        return table, "; ".join(dict.fromkeys(_why(error) for error in errors.values())) or None

    def _by_job(self, tree: Sequence[Job], future: Future[Grown]) -> list[tuple[Job, list[dict[str, Any]]]]:
        """Return the rows of each job of a tree that has ended; traces that came with them are written."""
        if future.cancelled():
            raise OmnievalError("the cluster dropped its jobs; what is done is kept, go on with --resume")
        error = future.exception()
        if isinstance(error, BrokenExecutor):
            raise OmnievalError(f"{_why(error)}; --resume with fewer --jobs")
        if isinstance(error, OtherWorkerError):
            raise error
        grown = Grown([failed_row(job, error) for job in tree], {}) if error else future.result()
        return [(job, self._rows_of(job, grown)) for job in tree]

    def _rows_of(self, job: Job, grown: Grown) -> list[dict[str, Any]]:
        if job.number in grown.traces:
            try:
                with replacing(self._steps_files([job])[job.number]) as temporary:
                    temporary.write_bytes(grown.traces[job.number])
            except ResultError as error:
                return [failed_row(job, error)]
        return [row for row in grown.rows if row["job"] == job.number]

    def _steps_files(self, tree: Sequence[Job]) -> dict[int, Path]:
        return {job.number: self.store.steps_file(f"{job.number:05d}-{job.key}") for job in tree if self.keep_steps}


def _sent(job: Job) -> Job:
    """Return a job as a process gets it: no object goes along, which may hold what cannot.

    Its images are described already, and its mapper is made again of its class and settings.
    """
    mapper, descriptor = job.config.mapper, replace(job.config.descriptor, given=None)
    if mapper.spec is not None:
        mapper = replace(mapper, given=None)
    alone = replace(job.input, given=Path(), in_map=job.input.in_map and replace(job.input.in_map, given=Path()))
    return replace(job, input=alone, config=replace(job.config, mapper=mapper, descriptor=descriptor))


def _why(error: BaseException) -> str:
    if isinstance(error, BrokenExecutor):
        return "a worker process was killed, perhaps for lack of memory"
    return reason_of(error)


def conclude(
    work: Work,
    described: Mapping[str, Described],
    folder: ResultFolder,
    crew: Crew,
    *,
    started: float,
    csv: bool,
    record_best: bool,
    lacking: str | None = None,
) -> Ablation:
    """Put the table together of rows that are there, write it and what else was asked for, and close the folder.

    Parameters
    ----------
    work, described, folder
        What was run, on what, and where it is.
    crew
        Who does batch clustering.
    started
        When it was begun, by `time.perf_counter`.
    csv, record_best
        See `run.run_plan`.
    lacking
        Why there can be no batch clustering; None if it is to be done.
    """
    plan = work.plan
    rows = work.store.rows()
    table = rows_table(rows, plan.grid["types"])
    work.store.write(table, csv=csv)  # what else befalls us, the sweep has its table
    if plan.shard is None and lacking is None:
        table, lacking = work.with_batch(crew, described, rows)
        work.store.write(table, csv=csv)
    is_tuned = bool(plan.tuned_on) and not plan.shard
    chosen = tuned(table, plan.varied, plan.tuned_on, work.tune_by) if is_tuned else None
    ablation = Ablation(work.store.folder, table, lacking, chosen)
    if record_best and (best := best_run(table)) is not None:
        job = plan.jobs[best]
        with opened(job.input.given, job.config, job.input.rest) as material:
            whole = replace(material, skipped=job.input.skipped)
            replay(whole, job.config, ablation.folder / BEST, overwrite=True, recording=RecordingOptions())
    missing = UNTIL_MERGED if plan.shard else lacking
    folder.complete(
        {
            "jobs": len(table),
            "failed_jobs": ablation.failed,
            **({} if chosen is None else {"tuned_by": work.tune_by, "tuned": chosen.to_dicts()}),
            "null_reasons": {"batch_silhouette": missing} if missing else {},
            "content_hashes": {KIND: content_hash(table)},
            "timings": {"seconds": time.perf_counter() - started, "processes": crew.count},
        }
    )
    return ablation


@contextmanager
def dropping_descriptors(store: Store) -> Iterator[None]:
    """Remove the descriptors from the folder of an ablation when the block ends, however it ends."""
    try:
        yield
    finally:
        store.drop_descriptors()


def best_run(table: pl.DataFrame) -> int | None:
    """Return the job with the highest silhouette, the first of equals; None if no run has one.

    Where there are replicates, it is the first of those whose mean is the highest.
    """
    scored = over_replicates(table).drop_nulls("silhouette")
    return None if scored.is_empty() else int(scored["job"][int(scored["silhouette"].arg_max() or 0)])
