"""The check: replays and run folders against the cases of a reference."""

from __future__ import annotations

import contextlib
import dataclasses
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import BrokenExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path

from omnieval.datasets import load
from omnieval.errors import ConfigError, DatasetError, OmnievalError, RegressionError, ResultError
from omnieval.material.source import archive_file
from omnieval.processes import workers
from omnieval.regression.case_report import CaseReport
from omnieval.regression.cases import (
    Job,
    Progress,
    Selection,
    canonical_source,
    job_of,
    left_out,
    refuse_missing,
    refuse_selection,
    replayed,
    selection_of,
    source_of,
    target_of,
)
from omnieval.regression.guarded import Case, LocalizationCase, Made
from omnieval.regression.judge import judge
from omnieval.regression.localizing import reports_of
from omnieval.regression.reference import read_localizations, read_reference
from omnieval.regression.trace import Parting, first_parting, read_trace
from omnieval.results.compare import differing
from omnieval.results.intervals import intervals_of_run
from omnieval.results.manifest import expanded
from omnieval.results.run_folder import Run


@dataclass(frozen=True)
class _Replay:
    """A case to replay, and the localisations in its map."""

    case: Case
    localizations: tuple[LocalizationCase, ...]
    reference: Path


def check(
    reference: str | Path,
    targets: Sequence[str] = (),
    *,
    selection: Selection | None = None,
    jobs: int = 1,
    progress: Progress | None = None,
) -> tuple[CaseReport, ...]:
    """Hold runs and replays against a reference. Nothing is raised for what fails: the reports say it.

    Localisations are checked with the case whose map they are in, when that is replayed.

    Parameters
    ----------
    reference
        The reference file.
    targets
        Run folders, compared as they are, and sources, replayed. None: every case of the reference is replayed.
    selection
        Of the cases of a source, only the one with this configuration and cut; None: all of them.
    jobs
        Processes that replay.
    progress
        Called with (frames done, frames in all) of each replay, or with several processes (cases done, cases in all).

    Raises
    ------
    RegressionError
        If there is no reference, or it is empty.
    ConfigError
        If the reference is faulty, or there is a selection and nothing to select from.
    ResultError
        If a process was ended from outside.
    """
    if jobs < 1:
        raise ConfigError(f"jobs is {jobs}, but must be at least 1")
    reference = expanded(reference)
    cases = read_reference(reference)
    localizations = read_localizations(reference, cases)
    if targets:
        planned = [one for target in targets for one in _of_target(target, cases, localizations, reference, selection)]
    else:
        refuse_selection(selection)
        planned = [_replay_of(case, localizations, reference) for case in cases]
    replays = [one for one in planned if isinstance(one, _Replay)]
    done = iter(_in_processes(replays, jobs, progress) if jobs > 1 else [_done(one, progress) for one in replays])
    reports: list[CaseReport] = []
    found: list[CaseReport] = []
    for one in planned:
        if isinstance(one, CaseReport):
            reports.append(one)
        else:
            report, *of_map = next(done)
            reports.append(report)
            found += of_map
    return (*reports, *found)


def _of_target(
    name: str,
    cases: Sequence[Case],
    localizations: Sequence[LocalizationCase],
    reference: Path,
    selection: Selection | None,
) -> list[CaseReport | _Replay]:
    """Return what is said of a run folder, or what is to be replayed of a source."""
    try:
        target = target_of(name, selection, cases)
        planned: list[CaseReport | _Replay] = [
            _replay_of(case, localizations, reference) if target.run is None else _compare(case, target.run, reference)
            for case in target.cases
        ]
        if not planned:
            if target.run is None:
                refuse_missing(target.job.source)
            raise RegressionError(_nothing_for(target.job, cases))
    except OmnievalError as error:
        # The other targets are still worth a look.
        return [CaseReport(name, error=error)]
    return planned


def _replay_of(case: Case, localizations: Sequence[LocalizationCase], reference: Path) -> _Replay:
    return _Replay(case, tuple(one for one in localizations if one.map == case.name), reference)


def _in_processes(replays: Sequence[_Replay], jobs: int, progress: Progress | None) -> list[list[CaseReport]]:
    """Replay in several processes; sequences that are made when they are first opened are made before."""
    cases = [replay.case.source for replay in replays]
    queries = [one.query for replay in replays for one in replay.localizations]
    try:
        with workers(min(jobs, max(1, len(replays)))) as pool:
            for made in [pool.submit(_make, source) for source in dict.fromkeys([*cases, *queries])]:
                made.result()
            futures = [pool.submit(_done, replay, None) for replay in replays]
            for count, _ in enumerate(as_completed(futures), 1):
                if progress:
                    progress(count, len(futures))
            return [future.result() for future in futures]
    except BrokenExecutor as error:
        raise ResultError(
            "a process of the check was killed from outside; run the check again with fewer --jobs"
        ) from error


def _make(source: str) -> None:
    """Open a sequence once; what is wrong with it is said when it is replayed."""
    with contextlib.suppress(OmnievalError):
        if archive_file(source) is None:
            load(canonical_source(source))


def _done(replay: _Replay, progress: Progress | None) -> list[CaseReport]:
    """Replay a case: what is said of it, and of the localisations in its map."""
    case, started = replay.case, time.perf_counter()
    try:
        with replayed(case.source, selection_of(case), progress, save_map=bool(replay.localizations)) as run:
            if left_out(run) != case.skipped:
                was, now = (", ".join(files or ()) or "none" for files in (case.skipped, left_out(run)))
                raise DatasetError(f"the bad images of {case.source} are {now}, not {was}; correct the images")
            report = _compare(case, run, replay.reference)
            seconds = time.perf_counter() - started
            found = list(reports_of(replay.localizations, run, progress))
    except OmnievalError as error:
        # It says nothing about the maps, and the other cases are still worth a look.
        report = CaseReport(case.name, error=type(error)(f"cannot be replayed: {error}"))
        none = f"there is no map to localise in: {case.name} cannot be replayed"
        found = [CaseReport(one.name, error=type(error)(none)) for one in replay.localizations]
        seconds = time.perf_counter() - started
    return [dataclasses.replace(report, seconds=seconds), *found]


def _compare(case: Case, run: Run, reference: Path) -> CaseReport:
    parting, notes = _parting(case, run, reference)
    outcomes = judge(case, run.metrics, intervals_of_run(run))
    if run.status != "complete":
        notes = (f"{run.folder} is {run.status}: it has no metrics; replay it again", *notes)
    settings = {}
    if case.made:
        settings = differing(case.made.parameters, Job.of_run(run).recorded)
        notes = (*notes, *_changes(case.made, run, code=parting is not None or any(x.failed for x in outcomes)))
    return CaseReport(case.name, outcomes, parting=parting, settings=settings, notes=notes)


def _changes(made: Made, run: Run, *, code: bool) -> Iterator[str]:
    """Yield what is not as it was when the reference was made; `code` only where there is something to explain."""
    fingerprint = run.manifest.get("dataset_fingerprint")
    # The fingerprint of a run that did not end is of the images it came to: fewer, not others.
    if run.status == "complete" and fingerprint not in {None, made.dataset_fingerprint}:
        yield "images, poses or labels are not those that the reference was made with"
    for kind, then, now in (
        ("mapper", made.mapper_code, run.config.mapper.code),
        ("descriptor", made.descriptor_code, run.config.descriptor.code),
    ):
        if code and then and then != now:
            yield f"the code of the {kind} has changed since the reference was made"


def _parting(case: Case, run: Run, reference: Path) -> tuple[Parting | None, tuple[str, ...]]:
    if case.trace is None:
        return None, ()
    try:
        trace = read_trace(reference.parent / case.trace)
    except OmnievalError as error:
        return None, (str(error),)
    return first_parting(trace, run.steps), ()


def _nothing_for(job: Job, cases: Sequence[Case]) -> str:
    """Say that the reference has no case for a job, and how the nearest one differs."""
    same = [case for case in cases if source_of(case) == job.source]
    if not same:
        sources = ", ".join(sorted({case.source for case in cases}))
        return f"the reference has no case of {job.source}, only of {sources}; add one with --update"
    nearest = min(same, key=lambda case: len(_differences(case, job)))
    found = ", ".join(f"{name} {one} there, {other} here" for name, (one, other) in _differences(nearest, job).items())
    return f"the reference has no case with these parameters; nearest is {nearest.name}: {found}; add one with --update"


def _differences(case: Case, job: Job) -> dict[str, tuple[object, object]]:
    other = job_of(case)
    if other is None:
        return {"parameters": ("faulty", "valid")}
    one, two = (
        {**each.parameters, **dataclasses.asdict(each.cut), "left out": ", ".join(each.skipped or ()) or "none"}
        for each in (other, job)
    )
    both = {name: values for name, values in differing(one, two).items() if name in one and name in two}
    return both or differing(one, two)
