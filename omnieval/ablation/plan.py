"""The plan of an ablation: every job, and what a table that is resumed must have in common with it."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from omnieval.ablation.grid import COMPONENTS, Axis, Span, column_of, components, configurations, value_of
from omnieval.ablation.jobs import Input, Job
from omnieval.ablation.store import Part, as_text
from omnieval.components.component import Component
from omnieval.config import Config, Setting, parameters
from omnieval.datasets import Sequence as ImageSequence
from omnieval.datasets import load
from omnieval.datasets.perturbation import OPTIONS as OF_PERTURBATION
from omnieval.datasets.perturbation import Perturbation
from omnieval.datasets.registry import canonical
from omnieval.datasets.source import apart
from omnieval.errors import ConfigError, DatasetError
from omnieval.imaging.settings import ImagingConfig
from omnieval.imaging.soundness import without_bad
from omnieval.loop import too_short
from omnieval.material.opening import opened
from omnieval.material.reopened import described_again
from omnieval.material.source import ARCHIVE, Cut, Source, archive_file, refuse_descriptor
from omnieval.results.schemas import parameter_type


@dataclass(frozen=True)
class Plan:
    """A validated ablation.

    Attributes
    ----------
    jobs
        In the order of the grid: source by source, the last axis varying fastest.
    varied
        Names of the parameters that are varied.
    grid
        What determines the jobs, as plain JSON values: sources, cuts, components, axes with their values, the other
        parameters, and the types of all.
    exact
        The parameter that takes all values of an interval in every job; None for a grid of points.
    tuned_on
        Sources, without perturbations, that parameters are chosen on, to be judged on the others.
    shard
        Of which shard these are the jobs, and of what plan, as ``run.json`` tells of it (`shards.shard_of`); None if
        they are all.
    """

    jobs: tuple[Job, ...]
    varied: tuple[str, ...]
    grid: dict[str, Any]
    exact: Span | None = None
    tuned_on: tuple[str, ...] = ()
    shard: dict[str, Any] | None = None


def make_plan(
    sources: Sequence[Source],
    axes: Sequence[Axis],
    settings: Sequence[Setting] = (),
    *,
    exact: Span | None = None,
    preset: str | None = None,
    cut: Cut | None = None,
    skip_bad: bool = False,
    perturbations: Sequence[Perturbation] = (),
    tune_on: Sequence[Source] = (),
    localize: Mapping[str, str] | None = None,
) -> Plan:
    """Validate grid and sources whole, and lay out the jobs.

    No image is read, unless those that are not fit for use are to be left out (`skip_bad`).

    Parameters
    ----------
    sources, axes, settings, exact, preset, cut, skip_bad
        See `run.ablate`.
    perturbations
        Every source is run with each of them (`datasets.perturbation`); none: as it is.
    tune_on
        Sources that parameters are chosen on; run as well if they are not among `sources`.
    localize
        By source: the source in whose map its images are also looked for; both must be among the sources.

    Raises
    ------
    ConfigError
        One line with every fault of the grid, or if a sequence is named twice or too short.
    DatasetError
        One line with every fault of the sources.
    """
    configs = configurations(axes, settings, preset, exact=exact)  # first: a source may have to be rendered
    faults: list[DatasetError] = []
    inputs: list[Input] = []
    tuned_on: list[str] = []
    asked = [*(sources or ("synthetic",)), *tune_on]
    for number, source in enumerate(asked):
        try:
            own = _inputs(source, configs, cut or Cut(), perturbations, skip_bad=skip_bad)
        except DatasetError as error:
            faults.append(error)
            continue
        if number >= len(asked) - len(tune_on):
            tuned_on.append(apart(own[0].source, OF_PERTURBATION)[0])
            own = [one for one in own if one.source not in {other.source for other in inputs}]
        inputs += own
    if tune_on and not faults and all(apart(one.source, OF_PERTURBATION)[0] in tuned_on for one in inputs):
        raise ConfigError("--tune-on names all sequences; name others too, on which to judge")
    inputs = _in_maps(inputs, localize or {})
    if misfits := [*_twice(inputs), *_too_short(inputs, configs)]:
        raise ConfigError("; ".join([*misfits, *map(str, faults)]))
    if faults:
        raise DatasetError("; ".join(map(str, faults)))
    pairs = [(one, config) for one in inputs for config in _of_input(one, configs)]
    columns = (column_of(config, axis.name) for axis in axes for _, config in pairs)
    varied = tuple(dict.fromkeys(column for column in columns if column is not None))
    jobs = tuple(Job(number, one, config, exact) for number, (one, config) in enumerate(pairs))
    if len({job.key for job in jobs}) < len(jobs):
        raise ConfigError("two components of the grid are the same, with the same settings; leave one of them out")
    return Plan(
        jobs,
        varied,
        _grid(inputs, [config for _, config in pairs], varied, exact),
        exact,
        tuple(tuned_on),
    )


def jobs_again(grid: Mapping[str, Any], parts: Sequence[Part]) -> tuple[Job, ...]:
    """Return the jobs of a grid whose rows are there, with images that can be opened and components as they were.

    In whose maps images were looked for is not told: nothing can be run again with them.

    Raises
    ------
    DatasetError
        If a source cannot be opened any more.
    ResultError
        If a descriptor has changed or is gone.
    """
    cuts = dict(zip(grid["sources"], grid["cuts"], strict=True))
    inputs: dict[str, Input] = {}
    jobs = []
    for part in parts:
        source = part.rows[0]["source"]
        config = described_again(Config.of_run(part.config))
        if source not in inputs:
            inputs[source] = _input(source, [config], Cut(*cuts[source]), skip_bad="skipped" in grid)
        jobs.append(Job(part.number, replace(inputs[source], replicate=part.rows[0]["replicate"]), config))
    return tuple(jobs)


def _in_maps(inputs: Sequence[Input], localize: Mapping[str, str]) -> list[Input]:
    """Return the inputs, each with the one in whose map it is looked for: of the same replicate.

    Raises
    ------
    ConfigError
        If a source is not among the inputs.
    """
    pairs = {canonical(query): canonical(map_) for query, map_ in localize.items()}
    known = {(_bare(one), one.replicate): one for one in inputs}
    for source in dict.fromkeys([*pairs, *pairs.values()]):
        if source not in {bare for bare, _ in known}:
            raise ConfigError(f"{source} is needed for localisation, and is not among the sequences")
    return [
        replace(one, in_map=known[pairs[bare], one.replicate]) if (bare := _bare(one)) in pairs else one
        for one in inputs
    ]


def _bare(one: Input) -> str:
    return apart(one.source, OF_PERTURBATION)[0]


def _inputs(
    source: Source, configs: Sequence[Config], cut: Cut, perturbations: Sequence[Perturbation], *, skip_bad: bool
) -> list[Input]:
    """Return a source with each of the perturbations; as it is if there are none."""
    if not perturbations:
        return [_input(source, configs, cut, skip_bad=skip_bad)]
    if archive_file(source) is not None:
        raise ConfigError(f"{source} holds descriptors, and only images can be perturbed; leave --perturb out")
    whole = source if isinstance(source, ImageSequence) else load(source)
    if whole.perturbation:
        raise ConfigError(f"{whole.source} is perturbed already; leave that out of its name, or leave --perturb out")
    return [
        replace(_input(one.applied(whole), configs, cut, skip_bad=skip_bad), replicate=number)
        for number, one in enumerate(perturbations)
    ]


def _input(source: Source, configs: Sequence[Config], cut: Cut, *, skip_bad: bool) -> Input:
    file = archive_file(source)
    if file is not None:
        for config in configs:
            refuse_descriptor(source, config)
        with opened(source, configs[0], cut) as material:
            return Input(material.name, material.source, cut, len(material.frames), file)
    sequence = source if isinstance(source, ImageSequence) else load(source)
    sequence = sequence.cut(start=cut.start, stride=cut.stride, limit=cut.limit)
    skipped = None
    if skip_bad:
        sequence, skipped = without_bad(sequence)
    return Input(
        sequence.name,
        sequence.source,
        Cut(*sequence.cut_from),
        len(sequence),
        sequence,
        skipped,
        sequence.perturbation,
    )


def _of_input(one: Input, configs: Sequence[Config]) -> list[Config]:
    """Return the configurations as they are run on these images: an archive has its descriptions."""
    if not isinstance(one.given, Path):
        return list(configs)
    own = [replace(config, descriptor=ARCHIVE, imaging=ImagingConfig()) for config in configs]
    if any(config in own[:number] for number, config in enumerate(own)):
        raise ConfigError(f"{one.source} holds descriptors already; vary only parameters of the mapper")
    return own


def _grid(
    inputs: Sequence[Input], configs: Sequence[Config], varied: Sequence[str], exact: Span | None
) -> dict[str, Any]:
    types = _types(configs)
    shown = {name: as_text if types.get(name) == "text" else _as_it_is for name in varied}
    axes = {name: list(dict.fromkeys([shown[name](value_of(config, name)) for config in configs])) for name in varied}
    found = {
        kind: list({str(one): one for config in configs for one in [_known(getattr(config, kind))]}.values())
        for kind in COMPONENTS
    }
    for kind, known in found.items():
        places = {(one["name"], one["spec"], one["code"]) for one in known}
        if namesakes := [name for name, count in Counter(name for name, *_ in places).items() if count > 1]:
            raise ConfigError(f"there are several {kind}s called {', '.join(namesakes)}; give each a name of its own")
    grid = {
        "sources": [one.source for one in inputs],
        "cuts": [[one.cut.start, one.cut.stride, one.cut.limit] for one in inputs],
        "components": found,
        "axes": {name: [value for value in values if value is not None] for name, values in axes.items()},
        "parameters": {
            name: value for config in configs for name, value in config.settings.items() if name not in varied
        },
        "types": types,
        "exact": [exact.name, exact.first, exact.last] if exact else None,
    }
    if any(one.in_map for one in inputs):
        grid["localize"] = {one.source: one.in_map.source for one in inputs if one.in_map}
    if any(one.skipped is not None for one in inputs):
        grid["skipped"] = {one.source: [bad.file for bad in one.skipped or ()] for one in inputs}
    plain: dict[str, Any] = json.loads(json.dumps(grid))
    return plain


def _known(component: Component) -> dict[str, Any]:
    """Return what a component is besides its parameters, which are those of the rows."""
    return {name: value for name, value in component.about.items() if name not in ("settings", "identity")}


def _types(configs: Sequence[Config]) -> dict[str, str]:
    """Return the types of all parameters in words; components may have one of the same name and another type."""
    types: dict[str, set[str]] = {}
    for config in configs:
        fields = parameters(*components(config), everything=False)
        for name, value in config.settings.items():
            # The parameters of an object are what they are, and have no field.
            types.setdefault(name, set()).add(parameter_type(fields[name]) if name in fields else _type_of(value))
    return {
        name: next(iter(kinds)) if len(kinds) == 1 else "float" if kinds == {"int", "float"} else "text"
        for name, kinds in types.items()
    }


def _type_of(value: Any) -> str:
    return {float: "float", int: "int"}.get(type(value), "text")


def _as_it_is(value: Any) -> Any:
    return value


def _twice(inputs: Sequence[Input]) -> list[str]:
    sources = [one.source for one in inputs]
    return [f"{source} is named twice; name it once" for source in dict.fromkeys(sources) if sources.count(source) > 1]


def _too_short(inputs: Sequence[Input], configs: Sequence[Config]) -> list[str]:
    mappers = [config.mapper.fresh() for config in configs]
    faults = [
        f"{one.source}: {fault}" for one in inputs for mapper in mappers if (fault := too_short(mapper, one.images))
    ]
    return list(dict.fromkeys(faults))
