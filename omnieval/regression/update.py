"""The update: what replays come to now becomes what is expected, and what that changes is said."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import polars as pl

from omnieval.config import resolve
from omnieval.errors import OmnievalError, ResultError
from omnieval.loop import run_name
from omnieval.material import ARCHIVE, reopened
from omnieval.metrics.catalogue import BY_NAME
from omnieval.regression.cases import (
    Job,
    Progress,
    Selection,
    left_out,
    portable,
    refuse_selection,
    replayed,
    selection_of,
    target_of,
)
from omnieval.regression.reference import Case, Guard, Made, NodeRange, read_reference, write_reference
from omnieval.regression.trace import DECISION, Parting, first_parting, read_trace, write_trace
from omnieval.results.compare import differing
from omnieval.results.manifest import expanded
from omnieval.results.run_folder import Run
from omnieval.wording import safe_name

NODES_EITHER_WAY = 1
DECIMALS = 6
"""Of the values written; far below any tolerance, and quiet about the last bits of a sum."""
TOLERANCES = {"silhouette": 0.02, "share": 0.05, "rooms": 0.05, "pair": 0.05, "reentry": 0.05}
"""Default tolerance by the first word of a metric."""
GUARDED = (
    *("silhouette", "silhouette_image", "silhouette_literal", "silhouette_sq"),
    *("share_assigned", "share_forced", "share_unassigned"),
    *("rooms_ari", "rooms_nmi"),
    *("pair_f1", "reentry_f1"),
)
"""What a new case guards; any other metric can be written into it. Of the other shares neither way is better; the
controls are no property of the map; homogeneity, completeness and purity rise or fall with the number of nodes."""


@dataclass(frozen=True)
class Change:
    """What an update did to one case.

    Attributes
    ----------
    name
        The case.
    added
        Whether it is new.
    values
        Expected values that changed: (before, after), None where there is none.
    parting
        The first step now decided otherwise than in the earlier trace.
    """

    name: str
    added: bool
    values: dict[str, tuple[float | None, float | None]] = dataclasses.field(default_factory=dict)
    parting: Parting | None = None


@dataclass(frozen=True)
class _Renewed:
    """A case with what it expects now; `old` is None if it is new."""

    old: Case | None
    new: Case
    steps: pl.DataFrame


def update(
    reference: Path,
    targets: Sequence[str] = (),
    *,
    selection: Selection | None = None,
    progress: Progress | None = None,
) -> tuple[Change, ...]:
    """Take what replays come to now as what is expected, and write the reference, or make it.

    Targets and selection are those of `check`; a source that has no case gets one, with `selection` or the defaults.
    Of a case that is there already, name, parameters, guarded metrics and tolerances stay. Nothing is written unless
    all replays succeed, and can be made again from what is written.

    Raises
    ------
    RegressionError
        If there is no reference and no target.
    ConfigError, DatasetError, ResultError
        If something cannot be replayed, or a run is not complete, or a file cannot be written.
    """
    reference = expanded(reference)
    there = reference.exists() or not targets
    cases = list(read_reference(reference, may_be_empty=bool(targets)) if there else ())
    renewals = []
    if not targets:
        refuse_selection(selection)
        renewals = [_replay(case, cases, reference, progress) for case in cases]
    for target in targets:
        for renewed in _of_target(target, cases, reference, selection, progress):
            renewals.append(renewed)
            cases = [case for case in cases if case.name != renewed.new.name] + [renewed.new]
    changes = tuple(_change(renewed, reference) for renewed in renewals)
    _write(renewals, reference)
    return changes


def change_lines(change: Change) -> Iterator[str]:
    """Yield lines that say what an update did to one case."""
    if change.added:
        yield f"{change.name}: added"
    elif change.values or change.parting:
        yield f"{change.name}: changed"
    else:
        yield f"{change.name}: unchanged"
    for name, (before, after) in change.values.items():
        if after is None:
            yield f"  {name} has no value any more and is no longer guarded (was {before:.6g})"
        elif before is None:
            yield f"  {name} {after:.6g}"
        else:
            yield f"  {name} {before:.6g} -> {after:.6g}"
    if change.parting:
        yield f"  decisions differ from step {change.parting.frame} on"


def _of_target(
    name: str, cases: Sequence[Case], reference: Path, selection: Selection | None, progress: Progress | None
) -> list[_Renewed]:
    target = target_of(name, selection, cases)
    if target.run is not None:
        _refuse_changed(target.run)
        found = target.cases or (None,)
        return [_renew(case, target.run, cases, reference) for case in found]
    if target.cases:
        return [_replay(case, cases, reference, progress) for case in target.cases]
    with replayed(target.job.source, selection or Selection(resolve()), progress) as run:
        return [_renew(None, run, cases, reference)]


def _replay(case: Case, cases: Sequence[Case], reference: Path, progress: Progress | None) -> _Renewed:
    with replayed(case.source, selection_of(case), progress) as run:
        return _renew(case, run, cases, reference)


def _refuse_changed(run: Run) -> None:
    """Refuse a run folder that is not complete, or whose images, descriptor or descriptions are not there any more."""
    if run.status != "complete":
        raise ResultError(f"{run.folder} is {run.status}: there is nothing to expect of it; replay it again")
    try:
        with reopened(run) as material:
            for _ in material.described:  # held against the run until the last
                pass
    except OmnievalError as error:
        raise type(error)(f"{run.folder} cannot be a case: {error}") from error


def _renew(old: Case | None, run: Run, cases: Sequence[Case], reference: Path) -> _Renewed:
    name = old.name if old else _free_name(run, {case.name for case in cases})
    job, config = Job.of_run(run), run.config
    try:
        for component in (config.mapper, config.descriptor):
            if component != ARCHIVE:
                component.again()
        new = old or Case(
            name=name,
            source=portable(job.source),
            cut=job.cut,
            mapper=None if config.mapper.is_default else portable(config.mapper.spec or ""),
            descriptor=None if config.descriptor.spec is None else portable(config.descriptor.spec),
            parameters=job.deviations,
            nodes=NodeRange(value=1, min=1, max=1),
            guards={},
        )
        made = Made(
            date=run.manifest["finished"],
            code=run.manifest["code"],
            mapper_code=config.mapper.code,
            descriptor_code=config.descriptor.code,
            dataset_fingerprint=run.manifest["dataset_fingerprint"],
            versions=run.manifest["versions"],
            parameters=job.recorded,
        )
        renewed = {
            "skipped": left_out(run),
            "trace": new.trace or f"{reference.stem}/{safe_name(name)}.parquet",
            "nodes": _node_range(old, run),
            "guards": _guards(old, run),
            "made": made,
        }
        new = new.model_copy(update=renewed)
        if faults := differing(job.parameters, Job.of_case(new).parameters):
            said = ", ".join(f"{parameter} {one}" for parameter, (one, _) in faults.items())
            raise ResultError(f"a reference has no words for {said}")
    except OmnievalError as error:
        raise type(error)(f"{name} cannot be a case: {error}") from error
    return _Renewed(old, new, run.steps.select("file", *DECISION))


def _free_name(run: Run, taken: set[str]) -> str:
    base = run_name(run.manifest["sequence"], run.config.descriptor, run.config.mapper)
    number, name = 1, base
    while name in taken:
        number += 1
        name = f"{base}-{number}"
    return name


def _node_range(old: Case | None, run: Run) -> NodeRange:
    nodes = run.metrics["nodes"]
    if nodes is None:
        raise ResultError(f"{run.folder} has no number of nodes; replay it again")
    below = old.nodes.value - old.nodes.min if old else NODES_EITHER_WAY
    above = old.nodes.max - old.nodes.value if old else NODES_EITHER_WAY
    value = int(nodes)
    return NodeRange(value=value, min=max(1, value - below), max=value + above)


def _guards(old: Case | None, run: Run) -> dict[str, Guard]:
    """Return the guards, new values in old tolerances; a metric that has no value cannot be guarded."""
    guards = old.guards if old else {name: _default_guard(name) for name in GUARDED}
    return {
        name: guard.model_copy(update={"value": round(float(value), DECIMALS)})
        for name, guard in guards.items()
        if (value := run.metrics.get(name)) is not None
    }


def _default_guard(name: str) -> Guard:
    return Guard.model_validate(
        {"value": 0.0, "tolerance": TOLERANCES[name.partition("_")[0]], "better": BY_NAME[name].better}
    )


def _change(renewed: _Renewed, reference: Path) -> Change:
    old, new = renewed.old, renewed.new
    after = {"nodes": float(new.nodes.value)} | {name: guard.value for name, guard in new.guards.items()}
    if old is None:
        return Change(new.name, True, {name: (None, value) for name, value in after.items()})
    before = {"nodes": float(old.nodes.value)} | {name: guard.value for name, guard in old.guards.items()}
    values: dict[str, tuple[float | None, float | None]] = {}
    values |= {name: (value, after.get(name)) for name, value in before.items() if value != after.get(name)}
    return Change(new.name, False, values, _parting(old, renewed.steps, reference))


def _parting(old: Case, steps: pl.DataFrame, reference: Path) -> Parting | None:
    if old.trace is None:
        return None
    try:
        trace = read_trace(reference.parent / old.trace)
    except ResultError:
        return None  # Lost or damaged: this update writes it anew.
    return first_parting(trace, steps)


def _write(renewals: Sequence[_Renewed], reference: Path) -> None:
    """Write traces and reference; cases keep their order, new ones come last."""
    for renewed in renewals:
        if renewed.new.trace:
            write_trace(renewed.steps, reference.parent / renewed.new.trace)
    write_reference([_undated(renewed) for renewed in renewals], reference)


def _undated(renewed: _Renewed) -> Case:
    """Return the new case; the old one where only the date would change."""
    old, new = renewed.old, renewed.new
    if old and old.made and new.made and new.made.model_copy(update={"date": old.made.date}) == old.made:
        return new.model_copy(update={"made": old.made})
    return new
