"""The check: replays and run folders against the cases of a reference."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

from omnieval.errors import ConfigError, OmnievalError, RegressionError
from omnieval.regression.cases import (
    Job,
    Progress,
    Selection,
    canonical_source,
    job_of_case,
    job_of_run,
    job_of_source,
    portable_spec,
    replayed,
    run_at,
)
from omnieval.regression.judge import judge
from omnieval.regression.reference import Case, Made, Value, read_reference
from omnieval.regression.report import CaseReport
from omnieval.regression.trace import Parting, first_parting, read_trace
from omnieval.results.compare import differing
from omnieval.results.run_folder import Run


def check(
    reference: Path,
    targets: Sequence[str] = (),
    *,
    selection: Selection | None = None,
    progress: Progress | None = None,
) -> tuple[CaseReport, ...]:
    """Hold runs and replays against a reference. Nothing is raised for what fails: the reports say it.

    Parameters
    ----------
    reference
        The reference file.
    targets
        Run folders, compared as they are, and sources, replayed. None: every case of the reference is replayed.
    selection
        Of the cases of a source, only the one with this configuration and cut; None: all of them.
    progress
        Called with (frames done, frames in all) of each replay.

    Raises
    ------
    RegressionError
        If there is no reference, or it is empty.
    ConfigError
        If the reference is faulty, or there is a selection and nothing to select from.
    DatasetError, ResultError
        If a target is neither a run folder nor a source.
    """
    cases = read_reference(reference)
    if not targets:
        refuse_selection(selection)
        return tuple(_replay(case, reference, progress) for case in cases)
    return tuple(report for target in targets for report in _reports(target, cases, reference, selection, progress))


def refuse_selection(selection: Selection | None) -> None:
    """Refuse parameters that no source was given for."""
    if selection is not None:
        raise ConfigError("parameters and cuts select among the cases of a SOURCE; name one, or leave them out")


def matching(job: Job, cases: Sequence[Case]) -> list[Case]:
    """Return the cases that replay the same; at most one unless a reference says something twice."""
    return [case for case in cases if _job(case) == job]


def of_source(source: str, cases: Sequence[Case]) -> list[Case]:
    """Return the cases of a source, whatever their parameters."""
    canonical = canonical_source(source)
    return [case for case in cases if _source(case) == canonical]


def _reports(
    target: str, cases: Sequence[Case], reference: Path, selection: Selection | None, progress: Progress | None
) -> Iterator[CaseReport]:
    run = run_at(target)
    if run is not None:
        refuse_selection(selection)
        job = job_of_run(run)
        chosen = matching(job, cases)
        yield from (_compare(case, run, reference) for case in chosen)
    else:
        job = job_of_source(target, selection)
        chosen = matching(job, cases) if selection else of_source(target, cases)
        yield from (_replay(case, reference, progress) for case in chosen)
    if not chosen:
        yield CaseReport(target, fault=_nothing_for(job, cases), code=RegressionError.exit_code)


def _replay(case: Case, reference: Path, progress: Progress | None) -> CaseReport:
    started = time.perf_counter()
    skip_bad = case.skipped is not None
    try:
        with replayed(case.source, case.cut, case.config(), skip_bad=skip_bad, progress=progress) as run:
            report = _compare(case, run, reference)
    except OmnievalError as error:
        # A case that cannot be replayed says nothing about the maps, and the others are still worth a look.
        report = CaseReport(case.name, fault=f"cannot be replayed: {error}", code=error.exit_code)
    return dataclasses.replace(report, seconds=time.perf_counter() - started)


def _compare(case: Case, run: Run, reference: Path) -> CaseReport:
    parting, notes = _parting(case, run, reference)
    outcomes = judge(case, run.metrics)
    if run.status != "complete":
        notes = (f"{run.folder} is {run.status}: it has no metrics; replay it again", *notes)
    settings = {}
    if case.made:
        settings = differing(case.made.parameters, _portable(job_of_run(run).parameters))
        notes = (*notes, *_changes(case, case.made, run, code=parting is not None or any(x.failed for x in outcomes)))
    return CaseReport(case.name, outcomes, parting=parting, settings=settings, notes=notes)


def _portable(parameters: dict[str, Value]) -> dict[str, Value]:
    return {
        name: portable_spec(str(value)) if name in ("mapper", "descriptor") else value
        for name, value in parameters.items()
    }


def _changes(case: Case, made: Made, run: Run, *, code: bool) -> Iterator[str]:
    """Yield what is not as it was when the reference was made; `code` only where there is something to explain."""
    fingerprint = run.manifest.get("dataset_fingerprint")
    # The fingerprint of a run that did not end is of the images it came to: fewer, not others.
    if run.status == "complete" and fingerprint not in {None, made.dataset_fingerprint}:
        yield "images, poses or labels are not those the reference was made with"
    if case.skipped is not None:
        left_out = tuple(bad["file"] for bad in run.manifest.get("skipped") or ())
        if left_out != case.skipped:
            yield f"left out {len(left_out)} images because they are bad, the reference {len(case.skipped)}"
    for kind, then, now in (
        ("mapper", made.mapper_code, run.config.mapper.code),
        ("descriptor", made.descriptor_code, run.config.descriptor.code),
    ):
        if code and then and then != now:
            yield f"the code of the {kind} is not that the reference was made with"


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
    same = [case for case in cases if _source(case) == job.source]
    if not same:
        sources = ", ".join(sorted({case.source for case in cases}))
        return f"the reference has no case of {job.source}, only of {sources}; add one with --update"
    nearest = min(same, key=lambda case: len(_differences(case, job)))
    found = ", ".join(f"{name} {one} there, {other} here" for name, (one, other) in _differences(nearest, job).items())
    return f"the reference has no case with these parameters; nearest is {nearest.name}: {found}; add one with --update"


def _differences(case: Case, job: Job) -> dict[str, tuple[object, object]]:
    other = _job(case)
    if other is None:
        return {"parameters": ("faulty", "valid")}
    cuts = differing(
        {**other.cut.model_dump(), "skip_bad": other.skip_bad}, {**job.cut.model_dump(), "skip_bad": job.skip_bad}
    )
    return {**differing(other.parameters, job.parameters), **cuts}


def _job(case: Case) -> Job | None:
    """Return the job of a case, None where its source is not on this machine or its parameters are faulty."""
    try:
        return job_of_case(case)
    except OmnievalError:
        return None


def _source(case: Case) -> str | None:
    try:
        return canonical_source(case.source)
    except OmnievalError:
        return None
