"""The update: the present results of replays become the expected ones, and the changes are reported."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import polars as pl

from omnieval.config import resolve
from omnieval.errors import OmnievalError, ResultError
from omnieval.loop import run_name
from omnieval.material.reopened import reopened
from omnieval.material.source import ARCHIVE
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
from omnieval.regression.guarded import Case, Guard, LocalizationCase, Made, NodeRange
from omnieval.regression.localizing import answers_of, renewed
from omnieval.regression.reference import read_localizations, read_reference, write_reference
from omnieval.regression.trace import DECISION, Parting, first_parting, read_trace, write_trace
from omnieval.results.compare import differing
from omnieval.results.intervals import intervals_of_run
from omnieval.results.manifest import expanded
from omnieval.results.run_folder import Run
from omnieval.wording import safe_name

NODES_EITHER_WAY = 1
TOLERANCES = {"silhouette": 0.02, "share": 0.05, "rooms": 0.05, "pair": 0.05, "reentry": 0.05}
"""Default tolerance by the first word of a metric."""
GUARDED = (
    *("silhouette", "silhouette_image", "silhouette_literal", "silhouette_sq"),
    *("share_assigned", "share_forced", "share_unassigned"),
    *("rooms_ari", "rooms_nmi"),
    *("pair_f1", "reentry_f1"),
)
"""What a new case guards; any other metric can be written into it. Of the other shares neither direction is better; the
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
    """A case with what it expects now; `old` is None if it is new. Localisations in its map: (old, new)."""

    old: Case | None
    new: Case
    steps: pl.DataFrame
    localizations: tuple[tuple[LocalizationCase, LocalizationCase], ...] = ()


@dataclass(frozen=True)
class _How:
    """Where a reference is, whether new intervals are to be guarded, and what is called with frames done and in all."""

    reference: Path
    intervals: bool
    progress: Progress | None


def update(
    reference: Path,
    targets: Sequence[str] = (),
    *,
    selection: Selection | None = None,
    intervals: bool = False,
    progress: Progress | None = None,
) -> tuple[Change, ...]:
    """Take the present results of replays as the expected ones, and update the reference, or create it.

    Targets and selection are those of `check`; a source that has no case gets one, with `selection` or the defaults.
    Of a case that is there already, name, parameters, guarded metrics and tolerances stay. Localisations are renewed
    with the case whose map they are in, where that is replayed. Nothing is written unless all replays succeed, and can
    be made again from what is written.

    Parameters
    ----------
    reference, targets, selection, progress
        See `check`.
    intervals
        Guard metrics by their 95 % intervals in place of tolerances, where images can be resampled for them.

    Raises
    ------
    RegressionError
        If there is no reference and no target.
    ConfigError, DatasetError, ResultError
        If something cannot be replayed, or a run is not complete, or a file cannot be written.
    """
    reference = expanded(reference)
    how = _How(reference, intervals, progress)
    there = reference.exists() or not targets
    cases = list(read_reference(reference, may_be_empty=bool(targets)) if there else ())
    localizations = read_localizations(reference, cases) if there else ()
    renewals = []
    if not targets:
        refuse_selection(selection)
        renewals = [_replay(case, cases, localizations, how) for case in cases]
    for target in targets:
        for renewal in _of_target(target, cases, localizations, selection, how):
            renewals.append(renewal)
            cases = [case for case in cases if case.name != renewal.new.name] + [renewal.new]
    changes = [_change(renewal, reference) for renewal in renewals]
    changes += [_localization_change(*pair) for renewal in renewals for pair in renewal.localizations]
    _write(renewals, reference)
    return tuple(changes)


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
    name: str,
    cases: Sequence[Case],
    localizations: Sequence[LocalizationCase],
    selection: Selection | None,
    how: _How,
) -> list[_Renewed]:
    target = target_of(name, selection, cases)
    if target.run is not None:
        _refuse_changed(target.run)
        found = target.cases or (None,)
        return [_renew(case, target.run, cases, how) for case in found]
    if target.cases:
        return [_replay(case, cases, localizations, how) for case in target.cases]
    with replayed(target.job.source, selection or Selection(resolve()), how.progress) as run:
        return [_renew(None, run, cases, how)]


def _replay(case: Case, cases: Sequence[Case], localizations: Sequence[LocalizationCase], how: _How) -> _Renewed:
    located = [one for one in localizations if one.map == case.name]
    with replayed(case.source, selection_of(case), how.progress, save_map=bool(located)) as run:
        renewal = _renew(case, run, cases, how)
        return dataclasses.replace(renewal, localizations=tuple(_renewed_in(located, run, how)))


def _renewed_in(
    cases: Sequence[LocalizationCase], run: Run, how: _How
) -> Iterator[tuple[LocalizationCase, LocalizationCase]]:
    answered = answers_of(cases, run, how.progress, intervals=how.intervals)
    for case in cases:
        found = answered[case.name]
        if isinstance(found, OmnievalError):
            raise type(found)(f"{case.name} cannot be localised: {found}")
        yield case, renewed(case, found, intervals=how.intervals)


def _refuse_changed(run: Run) -> None:
    """Refuse a run folder that is not complete, or whose images, descriptor or descriptions are not there any more."""
    if run.status != "complete":
        raise ResultError(f"{run.folder} is {run.status}: it cannot say what to expect; replay it again")
    try:
        with reopened(run) as material:
            for _ in material.described:  # compared with the run until the last
                pass
    except OmnievalError as error:
        raise type(error)(f"{run.folder} cannot be a case: {error}") from error


def _renew(old: Case | None, run: Run, cases: Sequence[Case], how: _How) -> _Renewed:
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
        changed = {
            "skipped": left_out(run),
            "trace": new.trace or f"{how.reference.stem}/{safe_name(name)}.parquet",
            "nodes": _node_range(old, run),
            "guards": _guards(old, run, intervals=how.intervals),
            "made": made,
        }
        new = new.model_copy(update=changed)
        if faults := differing(job.parameters, Job.of_case(new).parameters):
            said = ", ".join(f"{parameter} {one}" for parameter, (one, _) in faults.items())
            raise ResultError(f"a reference cannot hold {said}")
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


def _guards(old: Case | None, run: Run, *, intervals: bool) -> dict[str, Guard]:
    """Return the guards, new values in old tolerances; a metric that has no value cannot be guarded."""
    guards = old.guards if old else {name: _default_guard(name) for name in GUARDED}
    within = intervals_of_run(run)
    return {
        name: guard.renewed(value, within, name, intervals=intervals)
        for name, guard in guards.items()
        if (value := run.metrics.get(name)) is not None
    }


def _default_guard(name: str) -> Guard:
    return Guard.model_validate(
        {"value": 0.0, "tolerance": TOLERANCES[name.partition("_")[0]], "better": BY_NAME[name].better}
    )


def _change(renewal: _Renewed, reference: Path) -> Change:
    old, new = renewal.old, renewal.new
    after = {"nodes": float(new.nodes.value)} | {name: guard.value for name, guard in new.guards.items()}
    if old is None:
        return Change(new.name, True, {name: (None, value) for name, value in after.items()})
    before = {"nodes": float(old.nodes.value)} | {name: guard.value for name, guard in old.guards.items()}
    values: dict[str, tuple[float | None, float | None]] = {}
    values |= {name: (value, after.get(name)) for name, value in before.items() if value != after.get(name)}
    return Change(new.name, False, values, _parting(old, renewal.steps, reference))


def _localization_change(old: LocalizationCase, new: LocalizationCase) -> Change:
    before, after = (
        {
            f"{strategy} {name}": guard.value
            for strategy, guards in one.expected.items()
            for name, guard in guards.items()
        }
        for one in (old, new)
    )
    names = dict.fromkeys([*before, *after])
    values = {name: (before.get(name), after.get(name)) for name in names if before.get(name) != after.get(name)}
    return Change(new.name, False, values)


def _parting(old: Case, steps: pl.DataFrame, reference: Path) -> Parting | None:
    if old.trace is None:
        return None
    try:
        trace = read_trace(reference.parent / old.trace)
    except ResultError:
        return None  # Lost or damaged: this update writes it again.
    return first_parting(trace, steps)


def _write(renewals: Sequence[_Renewed], reference: Path) -> None:
    """Write traces and reference; cases keep their order, new ones come last."""
    for renewal in renewals:
        if renewal.new.trace:
            write_trace(renewal.steps, reference.parent / renewal.new.trace)
    found = [new for renewal in renewals for _, new in renewal.localizations]
    write_reference([_undated(renewal) for renewal in renewals], reference, found)


def _undated(renewal: _Renewed) -> Case:
    """Return the new case; the old one where only the date would change."""
    old, new = renewal.old, renewal.new
    if old and old.made and new.made and new.made.model_copy(update={"date": old.made.date}) == old.made:
        return new.model_copy(update={"made": old.made})
    return new
