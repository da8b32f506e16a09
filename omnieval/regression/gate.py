"""The check: replays and run folders against the cases of a reference."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

from omnieval.errors import DatasetError, OmnievalError, RegressionError
from omnieval.regression.case_report import CaseReport
from omnieval.regression.cases import (
    Job,
    Progress,
    Selection,
    job_of,
    left_out,
    refuse_missing,
    refuse_selection,
    replayed,
    selection_of,
    source_of,
    target_of,
)
from omnieval.regression.judge import judge
from omnieval.regression.reference import Case, Made, read_reference
from omnieval.regression.trace import Parting, first_parting, read_trace
from omnieval.results.compare import differing
from omnieval.results.manifest import expanded
from omnieval.results.run_folder import Run


def check(
    reference: str | Path,
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
    """
    reference = expanded(reference)
    cases = read_reference(reference)
    if not targets:
        refuse_selection(selection)
        return tuple(_replay(case, reference, progress) for case in cases)
    return tuple(report for target in targets for report in _reports(target, cases, reference, selection, progress))


def _reports(
    name: str, cases: Sequence[Case], reference: Path, selection: Selection | None, progress: Progress | None
) -> list[CaseReport]:
    try:
        target = target_of(name, selection, cases)
        if target.run is not None:
            reports = [_compare(case, target.run, reference) for case in target.cases]
        else:
            reports = [_replay(case, reference, progress) for case in target.cases]
        if not reports:
            if target.run is None:
                refuse_missing(target.job.source)
            raise RegressionError(_nothing_for(target.job, cases))
    except OmnievalError as error:
        # The other targets are still worth a look.
        return [CaseReport(name, error=error)]
    return reports


def _replay(case: Case, reference: Path, progress: Progress | None) -> CaseReport:
    started = time.perf_counter()
    try:
        with replayed(case.source, selection_of(case), progress) as run:
            if left_out(run) != case.skipped:
                was, now = (", ".join(files or ()) or "none" for files in (case.skipped, left_out(run)))
                raise DatasetError(f"the bad images of {case.source} are {now}, not {was}; put the images right")
            report = _compare(case, run, reference)
    except OmnievalError as error:
        # It says nothing about the maps, and the other cases are still worth a look.
        report = CaseReport(case.name, error=type(error)(f"cannot be replayed: {error}"))
    return dataclasses.replace(report, seconds=time.perf_counter() - started)


def _compare(case: Case, run: Run, reference: Path) -> CaseReport:
    parting, notes = _parting(case, run, reference)
    outcomes = judge(case, run.metrics)
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
        yield "images, poses or labels are not those the reference was made with"
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
