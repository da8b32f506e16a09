"""The axes of an ablation, and the configurations of their grid.

An axis varies one parameter of `omnieval.config.parameters`, or the components: ``mapper`` and ``descriptor``. A
parameter that only some of these have is varied for those. Values are numbers as ``first:last:step`` (the last one
included) or lists; decimals are exact, so that ``1.7:2.3:0.15`` is 1.7, 1.85, 2.0, 2.15, 2.3.
"""

from __future__ import annotations

import itertools
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal, InvalidOperation
from pathlib import Path
from typing import Any

from omnieval.components.component import Component
from omnieval.components.names import BUILT_IN
from omnieval.config import Config, Setting, full_name, parameters, presets, resolve
from omnieval.errors import ConfigError
from omnieval.mapping.interface import BranchingMapper
from omnieval.material.source import ARCHIVE

COMPONENTS = tuple(reversed(BUILT_IN))
"""Axes of components, which are varied before parameters."""
MOST_VALUES = 1000
"""Most values of one range; more come from a mistake in the step."""
_ROUNDING = Decimal("1e-9")
"""Tolerance for the end of a range, as a share of a step."""


@dataclass(frozen=True)
class Axis:
    """A parameter, the values it takes in turn (text or TOML values), and where that was said."""

    name: str
    values: tuple[Any, ...]
    origin: str


@dataclass(frozen=True)
class Span:
    """All values of a parameter from `first` to `last`."""

    name: str
    first: float
    last: float

    @property
    def origin(self) -> str:
        """The option that asked for it, for messages."""
        return f"--exact {self.name}={self.first:g}:{self.last:g}"


EXPERIMENTS: dict[str, dict[str, str]] = {
    name: {"descriptor": "hog,gist", "omega": "1.7:2.3:0.15", "merge_y": "0.75:2.25:0.25"}
    for name in ("figures-9-10", "table-2", "table-3")
}
"""Axes of the paper's experiments (doi 10.3390/app10186480, section 6.4); the tables are taken from the same sweep."""


def parse_axis(text: str) -> Axis:
    """Read ``NAME=VALUES`` as given to ``--vary``.

    Raises
    ------
    ConfigError
        If there is no ``=`` or no name, or the values are not understood.
    """
    name, separator, values = text.partition("=")
    if not separator or not name.strip():
        raise ConfigError(f"--vary {text!r}: expected NAME=VALUES, for example --vary omega=1.7:2.3:0.15")
    return make_axis(name.strip(), values, f"--vary {text}")


def parse_span(text: str) -> Span:
    """Read ``NAME=FIRST:LAST`` as given to ``--exact``.

    Raises
    ------
    ConfigError
        If it is not understood.
    """
    name, separator, values = text.partition("=")
    name = name.strip().removeprefix("mapper.")
    try:
        first, last = map(float, values.split(":"))
    except ValueError:
        separator = ""
    if not separator:
        raise ConfigError(f"--exact {text!r}: expected NAME=FIRST:LAST, for example --exact merge_y=0.5:3")
    if not first < last:
        raise ConfigError(f"--exact {text!r}: the first value must be below the last")
    return Span(name, first, last)


def read_axes(path: Path) -> list[Axis]:
    """Read the axes of a TOML file: ``name = [..]`` or ``name = "first:last:step"``; tables are sections.

    Raises
    ------
    ConfigError
        If the file cannot be read, is not TOML, or has values that are not understood.
    """
    try:
        content = tomllib.loads(path.read_text("utf-8"))
    except (OSError, ValueError, RecursionError) as error:  # of TOML and its numbers, of text, of depth
        raise ConfigError(f"cannot read axes {path}: {error}") from error
    flat = {
        name: values
        for section, table in content.items()
        for name, values in (
            {f"{section}.{key}": value for key, value in table.items()} if isinstance(table, dict) else {section: table}
        ).items()
    }
    return [make_axis(name, values, str(path)) for name, values in flat.items()]


def make_axis(name: str, values: Any, origin: str) -> Axis:
    """Return an axis from text (``1:3:1``, ``a,b``), a list, or a single value.

    Raises
    ------
    ConfigError
        If there is no value, or a range is not understood.
    """
    given = (values,) if isinstance(values, str) or not isinstance(values, Iterable) else tuple(values)
    apart = _listed if name in COMPONENTS else _spread  # the colon of module:Class is not a range
    spread = tuple(value for one in given for value in (apart(one, origin) if isinstance(one, str) else (one,)))
    if not spread or "" in spread:
        raise ConfigError(f"{name}: an axis needs values, for example 1.7:2.3:0.15 or 20,30 ({origin})")
    return Axis(name.removeprefix("mapper."), spread, origin)


def preset_axes(axes: Sequence[Axis], experiment: Mapping[str, str], name: str) -> list[Axis]:
    """Return the axes of one of the paper's experiments, with those that were asked for in their place."""
    asked = {axis.name: axis for axis in axes}
    ours = [
        asked.pop(parameter, make_axis(parameter, values, f"--preset {name}"))
        for parameter, values in experiment.items()
    ]
    return [*ours, *asked.values()]


def configurations(
    axes: Sequence[Axis],
    settings: Sequence[Setting] = (),
    preset: str | None = None,
    *,
    exact: Span | None = None,
) -> list[Config]:
    """Return the configuration of every point of the grid: components first, then the last axis varying fastest.

    With `exact`, its parameter has its first value in all of them.

    Raises
    ------
    ConfigError
        One line with every fault of the axes, the settings and the preset.
    """
    chosen = [_choice(kind, axes, settings) for kind in COMPONENTS]
    others = [axis for axis in axes if axis.name not in COMPONENTS]
    settings = [setting for setting in settings if setting.name not in COMPONENTS]
    faults: list[str] = []
    pairs = list(itertools.product(*chosen))
    grids = [_Grid(dict(zip(COMPONENTS, pair, strict=True)), others, settings, preset, exact) for pair in pairs]
    for grid in grids:
        faults += _clashes(axes, settings, exact, grid.components) + grid.faults(grids)
    if faults:
        raise ConfigError("; ".join(dict.fromkeys(faults)))
    return [config for grid in grids for config in grid.points()]


def value_of(config: Config, name: str) -> Any:
    """Return the value of a parameter, or the name of a component, None if the configuration has none of that name."""
    if name in COMPONENTS:
        return getattr(config, name).name
    return config.settings.get(column_of(config, name) or name)


def column_of(config: Config, name: str) -> str | None:
    """Return the name that the table has for an axis; None if it is not a parameter of the configuration."""
    return name if name in COMPONENTS else full_name(name, *components(config))


def components(config: Config) -> tuple[Component, Component | None]:
    """Return mapper and descriptor, None for that of an archive, which has no parameters."""
    return config.mapper, None if config.descriptor == ARCHIVE else config.descriptor


@dataclass(frozen=True)
class _Grid:
    """The points of one mapper and one descriptor, with what concerns these of axes, settings and preset."""

    components: Mapping[str, Any]
    axes: Sequence[Axis]
    settings: Sequence[Setting]
    preset: str | None
    exact: Span | None

    def points(self) -> list[Config]:
        """Return the configurations."""
        axes = [axis for axis in self.axes if self._has(axis.name)]
        fixed = [setting for setting in self.settings if self._has(setting.name) or "." in setting.name]
        if self.exact:
            fixed.append(Setting(self.exact.name, self.exact.first, self.exact.origin))
        points = itertools.product(
            *([Setting(axis.name, value, axis.origin) for value in axis.values] for axis in axes)
        )
        preset = self.preset if self.preset in presets(self.components["mapper"]) else None
        configs = [resolve([*fixed, *point], preset=preset, **self.components) for point in points]
        twice = [axis for axis in axes if len({value_of(config, axis.name) for config in configs}) < len(axis.values)]
        if twice:
            raise ConfigError("; ".join(f"{axis.name}: a value is given twice ({axis.origin})" for axis in twice))
        return configs

    def faults(self, grids: Sequence[_Grid]) -> list[str]:
        """Return what is wrong for these components; what others of the grids have is not a fault."""
        given = [*self.settings]
        for axis in self.axes:
            given += [Setting(axis.name, value, axis.origin) for value in axis.values]
        if self.exact:
            given += [
                Setting(self.exact.name, value, self.exact.origin) for value in (self.exact.first, self.exact.last)
            ]
        mine = [one for one in given if self._has(one.name) or not any(grid.has(one.name) for grid in grids)]
        known = any(self.preset in presets(grid.components["mapper"]) for grid in grids)
        preset = None if known and self.preset not in presets(self.components["mapper"]) else self.preset
        faults = self._fault([], preset)
        for one in mine:
            faults += self._fault([one], None)
        return faults + ([] if faults or self.exact is None else self._fault_of_span(self.exact))

    def has(self, name: str) -> bool:
        """Whether one of these components has a parameter."""
        return self._has(name)

    def _has(self, name: str) -> bool:
        return full_name(name, **self.components) is not None

    def _fault(self, settings: Sequence[Setting], preset: str | None) -> list[str]:
        try:
            resolve(settings, preset=preset, **self.components)
        except ConfigError as error:
            return [str(error)]
        return []

    def _fault_of_span(self, exact: Span) -> list[str]:
        """Refuse a parameter whose values do not divide an interval: it must enter decisions by comparisons only."""
        mapper: Component = resolve(**self.components).mapper
        swept = mapper.cls.swept if issubclass(mapper.cls, BranchingMapper) else ()
        fields = parameters(everything=False, **self.components)
        thresholds = [name for name in swept if fields[name].annotation is float]
        if exact.name in thresholds:
            return []
        some = f"only {', '.join(thresholds)} are thresholds" if thresholds else "it has no thresholds"
        return [f"{exact.origin}: of {mapper.name} {some}; vary {exact.name} with --vary"]


def _choice(kind: str, axes: Sequence[Axis], settings: Sequence[Setting]) -> tuple[Any, ...]:
    """Return what an axis, or else a setting, chooses of a kind of component; the default if neither does."""
    for axis in axes:
        if axis.name == kind:
            return axis.values
    return next(((setting.value,) for setting in reversed(settings) if setting.name == kind), (None,))


def _spread(text: str, origin: str) -> tuple[str, ...]:
    """Return the values of a list of values and ranges, as text."""
    return tuple(
        value
        for part in text.split(",")
        for value in (_steps(part.strip(), origin) if ":" in part else (part.strip(),))
    )


def _listed(text: str, origin: str) -> tuple[str, ...]:
    del origin
    return tuple(part.strip() for part in text.split(","))


def _steps(text: str, origin: str) -> tuple[str, ...]:
    """Return the numbers of ``first:last:step``, as text."""
    try:
        first, last, step = map(Decimal, text.split(":"))
        steps = (last - first) / step
        finite = steps.is_finite() and step.is_finite()
    except (ValueError, InvalidOperation, ZeroDivisionError):
        finite = False
    if not finite or steps < 0:
        raise ConfigError(f"{text!r}: expected first:last:step, for example 1.7:2.3:0.15 ({origin})")
    if steps >= MOST_VALUES:
        raise ConfigError(f"{text!r} has more than {MOST_VALUES} values; take a larger step ({origin})")
    beyond = min if step > 0 else max  # what rounding adds must not leave the range
    return tuple(f"{beyond(first + number * step, last):f}" for number in range(int(steps + _ROUNDING) + 1))


def _clashes(
    axes: Sequence[Axis], settings: Sequence[Setting], exact: Span | None, chosen: Mapping[str, Any]
) -> list[str]:
    """Return what is given twice, under whatever names."""

    def full(name: str) -> str:
        return full_name(name, **chosen) or name

    varied: list[Axis | Span] = [*axes, *([exact] if exact else [])]
    names = [full(one.name) for one in varied]
    fixed = {full(setting.name): setting.origin for setting in settings}
    twice = [
        f"{name} is varied twice; give all its values in one option"
        for name in dict.fromkeys(names)
        if names.count(name) > 1
    ]
    again = [
        f"{axis.name}: a value is given twice ({axis.origin})"
        for axis in axes
        if axis.name in COMPONENTS and len(set(map(str, axis.values))) < len(axis.values)
    ]
    origins = {full(one.name): one.origin for one in varied}
    both = [
        f"{name} is both varied ({origin}) and set ({fixed[name]}); drop one"
        for name, origin in origins.items()
        if name in fixed
    ]
    return twice + again + both
