"""The plan of an ablation: every job, and what a table that is resumed must have in common with it."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from omnieval.ablation.grid import COMPONENTS, Axis, Span, configurations, value_of
from omnieval.ablation.jobs import Input, Job
from omnieval.components import Component
from omnieval.config import Config, Setting, parameters
from omnieval.datasets import Sequence as ImageSequence
from omnieval.datasets import load
from omnieval.errors import ConfigError, DatasetError
from omnieval.imaging.soundness import without_bad
from omnieval.loop import too_short
from omnieval.material import ARCHIVE, ARCHIVE_SCHEME, Cut, Source, archive_file, opened, refuse_descriptor
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
    """

    jobs: tuple[Job, ...]
    varied: tuple[str, ...]
    grid: dict[str, Any]
    exact: Span | None = None


def make_plan(
    sources: Sequence[Source],
    axes: Sequence[Axis],
    settings: Sequence[Setting] = (),
    *,
    exact: Span | None = None,
    preset: str | None = None,
    cut: Cut | None = None,
    skip_bad: bool = False,
) -> Plan:
    """Validate grid and sources whole, and lay out the jobs.

    No image is read, unless those that are not fit for use are to be left out (`skip_bad`).

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
    for source in sources or ("synthetic",):
        try:
            inputs.append(_input(source, cut or Cut(), skip_bad=skip_bad))
        except DatasetError as error:
            faults.append(error)
    if misfits := [*_twice(inputs), *_too_short(inputs, configs)]:
        raise ConfigError("; ".join([*misfits, *map(str, faults)]))
    if faults:
        raise DatasetError("; ".join(map(str, faults)))
    points = [(one, _config_for(one, config)) for one in inputs for config in configs]
    varied = tuple(axis.name for axis in axes)
    return Plan(
        tuple(Job(number, one, config, exact) for number, (one, config) in enumerate(points)),
        varied,
        _grid(inputs, [config for _, config in points], varied, exact),
        exact,
    )


def _config_for(one: Input, config: Config) -> Config:
    """Return the configuration of a job: the descriptors of an archive are those of no component."""
    file = archive_file(one.given)
    if file is None:
        return config
    refuse_descriptor(one.source, config)
    return dataclasses.replace(config, descriptor=ARCHIVE)


def _input(source: Source, cut: Cut, *, skip_bad: bool) -> Input:
    file = archive_file(source)
    if file is not None:
        with opened(source, configurations([])[0], cut) as material:
            return Input(material.name, f"{ARCHIVE_SCHEME}{file.resolve()}", cut, len(material.frames), file)
    sequence = source if isinstance(source, ImageSequence) else load(source)
    sequence = sequence.cut(start=cut.start, stride=cut.stride, limit=cut.limit)
    skipped = None
    if skip_bad:
        sequence, left_out = without_bad(sequence)
        skipped = tuple(bad.file for bad in left_out)
    return Input(sequence.name, sequence.source, Cut(*sequence.cut_from), len(sequence), sequence, skipped)


def _grid(
    inputs: Sequence[Input], configs: Sequence[Config], varied: Sequence[str], exact: Span | None
) -> dict[str, Any]:
    types = {name: parameter_type(field) for config in configs for name, field in _fields(config).items()}
    # The parameters of an object are what they are, and have no field.
    for config in configs:
        types |= {name: _type_of(value) for name, value in config.settings.items() if name not in types}
    axes = {name: list(dict.fromkeys([value_of(config, name) for config in configs])) for name in varied}
    grid = {
        "sources": [one.source for one in inputs],
        "cuts": [[one.cut.start, one.cut.stride, one.cut.limit] for one in inputs],
        "components": {
            kind: list({str(one): one for config in configs for one in [_known(getattr(config, kind))]}.values())
            for kind in COMPONENTS
        },
        "axes": {name: [value for value in values if value is not None] for name, values in axes.items()},
        "parameters": {
            name: value
            for config in configs
            for name, value in config.settings.items()
            if name not in varied and f"mapper.{name}" not in varied
        },
        "types": types,
        "exact": [exact.name, exact.first, exact.last] if exact else None,
    }
    if any(one.skipped is not None for one in inputs):
        grid["skipped"] = {one.source: list(one.skipped or ()) for one in inputs}
    plain: dict[str, Any] = json.loads(json.dumps(grid))
    return plain


def _known(component: Component) -> dict[str, Any]:
    """Return what a component is besides its parameters, which are those of the rows."""
    return {name: value for name, value in component.about.items() if name not in ("settings", "identity")}


def _fields(config: Config) -> dict[str, Any]:
    return parameters(config.mapper, config.descriptor, everything=False)


def _type_of(value: Any) -> str:
    return "float" if isinstance(value, float) else "int" if isinstance(value, int) else "text"


def _twice(inputs: Sequence[Input]) -> list[str]:
    sources = [one.source for one in inputs]
    return [f"{source} is named twice; name it once" for source in dict.fromkeys(sources) if sources.count(source) > 1]


def _too_short(inputs: Sequence[Input], configs: Sequence[Config]) -> list[str]:
    mappers = [config.mapper.fresh() for config in configs]
    faults = [
        f"{one.source}: {fault}" for one in inputs for mapper in mappers if (fault := too_short(mapper, one.images))
    ]
    return list(dict.fromkeys(faults))
