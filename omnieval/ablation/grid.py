"""The axes of an ablation, and the configurations of their grid.

An axis varies one parameter of `omnieval.config.parameters`. Its values are numbers as ``first:last:step`` (the last
one included) or lists; decimals are exact, so that ``1.7:2.3:0.15`` is 1.7, 1.85, 2.0, 2.15, 2.3.
"""

from __future__ import annotations

import itertools
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal, InvalidOperation
from functools import reduce
from pathlib import Path
from typing import Any

from omnieval.config import Config, Setting, parameters, resolve
from omnieval.errors import ConfigError
from omnieval.mapping.config import MapperConfig

THRESHOLDS = ("omega", "merge_y", "gamma")
"""Parameters that numbers are compared with, so that an interval of their values falls into pieces."""
MOST_VALUES = 1000
"""Values of one range; more is a slip of the step."""
_ROUNDING = Decimal("1e-9")
"""By how much of a step the end of a range may be missed."""


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
        """Where it was said."""
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
        If it is not understood, or the parameter is none whose values part an interval.
    """
    name, separator, values = text.partition("=")
    name = name.strip().removeprefix("mapper.")
    try:
        first, last = map(float, values.split(":"))
    except ValueError:
        separator = ""
    if not separator:
        raise ConfigError(f"--exact {text!r}: expected NAME=FIRST:LAST, for example --exact merge_y=0.5:3")
    if name not in THRESHOLDS:
        raise ConfigError(f"--exact {text!r}: only {', '.join(THRESHOLDS)} are thresholds; vary {name} with --vary")
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
    spread = tuple(value for one in given for value in (_spread(one, origin) if isinstance(one, str) else (one,)))
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
    """Return the configuration of every point of the grid, the last axis varying fastest.

    With `exact`, its parameter has its first value in all of them.

    Raises
    ------
    ConfigError
        One line with every fault of the axes, the settings and the preset.
    """
    spanned = [] if exact is None else [Axis(exact.name, (exact.first, exact.last), exact.origin)]
    faults = [*_clashes([*axes, *spanned], settings), *_faults(settings, preset)]
    for axis in (*axes, *spanned):
        # Values of a name that is unknown share one fault.
        faults += dict.fromkeys(
            fault for value in axis.values for fault in _faults([Setting(axis.name, value, axis.origin)], None)
        )
    if faults:
        raise ConfigError("; ".join(faults))
    points = itertools.product(*([Setting(axis.name, value, axis.origin) for value in axis.values] for axis in axes))
    settings = [*settings, *(Setting(axis.name, axis.values[0], axis.origin) for axis in spanned)]
    configs = [resolve([*settings, *point], preset=preset) for point in points]
    twice = [axis for axis in axes if len({value_of(config, axis.name) for config in configs}) < len(axis.values)]
    if twice:
        raise ConfigError("; ".join(f"{axis.name}: a value stands there twice ({axis.origin})" for axis in twice))
    return configs


def value_of(config: Config, name: str) -> Any:
    """Return the value of a parameter by the name it is set with."""
    holder = config.mapper if name in MapperConfig.model_fields else config
    return reduce(getattr, name.split("."), holder)


def flattened(config: Config) -> dict[str, Any]:
    """Return all parameters by the names they are set with."""
    return {name: value_of(config, name) for name in parameters()}


def _spread(text: str, origin: str) -> tuple[str, ...]:
    """Return the values of a list of values and ranges, as text."""
    return tuple(
        value
        for part in text.split(",")
        for value in (_steps(part.strip(), origin) if ":" in part else (part.strip(),))
    )


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


def _clashes(axes: Sequence[Axis], settings: Sequence[Setting]) -> list[str]:
    names = [axis.name for axis in axes]
    fixed = {setting.name.removeprefix("mapper."): setting.origin for setting in settings}
    twice = [
        f"{name} is varied twice; give all its values at once" for name in dict.fromkeys(names) if names.count(name) > 1
    ]
    return twice + [
        f"{axis.name} is both varied ({axis.origin}) and set ({fixed[axis.name]}); drop one"
        for axis in axes
        if axis.name in fixed
    ]


def _faults(settings: Sequence[Setting], preset: str | None) -> list[str]:
    try:
        resolve(settings, preset=preset)
    except ConfigError as error:
        return [str(error)]
    return []
