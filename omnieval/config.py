"""Every parameter of a replay in one frozen, validated object, and the one way to name and set them.

A name is the bare one (``omega``, ``n_new``, ...) for parameters of the mapper and ``section.name`` for the
others (``hog.bins``, ``imaging.rows``). The command line (``--set``), TOML files (``--config``) and ablation axes
all go through `resolve`.
"""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError
from pydantic.fields import FieldInfo

from omnieval.descriptors.description import Descriptor
from omnieval.descriptors.gist import Gist, GistConfig
from omnieval.descriptors.hog import Hog, HogConfig
from omnieval.errors import ConfigError
from omnieval.imaging.settings import ImagingConfig
from omnieval.mapping.config import PRESETS, MapperConfig
from omnieval.wording import did_you_mean


class Config(BaseModel):
    """All that determines a replay besides the sequence."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    descriptor: str = Field("hog", description="which descriptor describes the panoramas")
    mapper: MapperConfig = MapperConfig()
    imaging: ImagingConfig = ImagingConfig()
    hog: HogConfig = HogConfig()
    gist: GistConfig = GistConfig()

    def make_descriptor(self) -> Descriptor:
        """Return the descriptor that `descriptor` names, with the settings of its section."""
        return DESCRIPTORS[self.descriptor](getattr(self, self.descriptor))


DESCRIPTORS: dict[str, Callable[[Any], Descriptor]] = {"hog": Hog, "gist": Gist}
"""Descriptors by name; each has a section of the same name in `Config`."""


@dataclass(frozen=True, slots=True)
class Setting:
    """One parameter set by someone: its name, its value (text or TOML value), and where it was set."""

    name: str
    value: Any
    origin: str


def parameters() -> dict[str, FieldInfo]:
    """Return every parameter by the name it is set with, in order of definition."""
    return dict(_walk(Config, ""))


def resolve(settings: Iterable[Setting] = (), *, preset: str | None = None) -> Config:
    """Return the configuration with a preset and then settings applied, later ones winning.

    Raises
    ------
    ConfigError
        One line that names every unknown name (with the nearest known one) and every invalid value.
    """
    if preset is not None and preset not in PRESETS:
        raise ConfigError(f"unknown preset {preset!r}; {did_you_mean(preset, PRESETS)}")
    chosen = [Setting(name, value, f"preset {preset}") for name, value in PRESETS[preset or "recommended"].items()]
    chosen += settings
    applied = {_canonical(setting.name): setting for setting in chosen}
    known = parameters()
    faults = [
        f"unknown parameter {setting.name!r} ({setting.origin}); "
        f"{did_you_mean(name, known, otherwise='omnieval parameters lists them')}"
        for name, setting in applied.items()
        if name not in known
    ]
    # bool is a number to pydantic, but `omega = true` is a slip.
    faults += [
        f"{name}: expected {_expected(known[name])}, got {str(setting.value).lower()} ({setting.origin})"
        for name, setting in applied.items()
        if name in known and isinstance(setting.value, bool)
    ]
    if faults:
        raise ConfigError("; ".join(faults))
    try:
        config = Config.model_validate(_nested(applied))
    except ValidationError as error:
        raise ConfigError("; ".join(_explain(error, applied))) from error
    if config.descriptor not in DESCRIPTORS:
        hint = did_you_mean(config.descriptor, DESCRIPTORS)
        raise ConfigError(f"unknown descriptor {config.descriptor!r} ({applied['descriptor'].origin}); {hint}")
    return config


def configure(settings: Mapping[str, Any] | None = None, *, preset: str | None = None, **parameters: Any) -> Config:
    """Return a configuration from Python: ``configure(omega=1.85)``, ``configure({"hog.bins": 8}, preset=...)``.

    Raises
    ------
    ConfigError
        See `resolve`.
    """
    given = {**(settings or {}), **parameters}
    return resolve([Setting(name, value, "configure") for name, value in given.items()], preset=preset)


def parse_assignment(text: str) -> Setting:
    """Read ``NAME=VALUE`` as given to ``--set``.

    Raises
    ------
    ConfigError
        If there is no ``=`` or no name.
    """
    name, separator, value = text.partition("=")
    if not separator or not name.strip():
        raise ConfigError(f"--set {text!r}: expected NAME=VALUE, for example --set omega=1.85")
    return Setting(name.strip(), value.strip(), f"--set {text}")


def read_settings(path: Path) -> list[Setting]:
    """Read the settings of a TOML file; tables are sections.

    Raises
    ------
    ConfigError
        If the file cannot be read or is not TOML.
    """
    try:
        content = tomllib.loads(path.read_text("utf-8"))
        return [Setting(name, value, str(path)) for name, value in _flatten(content, "")]
    except OSError as error:
        raise ConfigError(f"cannot read configuration {path}: {error.strerror or error}; check --config") from error
    except (ValueError, RecursionError) as error:  # not only TOMLDecodeError: a number may have too many digits
        raise ConfigError(f"cannot read configuration {path}: {error}; correct it to valid TOML in UTF-8") from error


def _walk(model: type[BaseModel], prefix: str) -> Iterator[tuple[str, FieldInfo]]:
    for name, field in model.model_fields.items():
        if isinstance(field.annotation, type) and issubclass(field.annotation, BaseModel):
            yield from _walk(field.annotation, "" if field.annotation is MapperConfig else f"{name}.")
        else:
            yield prefix + name, field


def _flatten(content: Mapping[str, Any], prefix: str) -> Iterator[tuple[str, Any]]:
    for name, value in content.items():
        if isinstance(value, dict):
            yield from _flatten(value, f"{prefix}{name}.")
        else:
            yield prefix + name, value


def _canonical(name: str) -> str:
    return name.removeprefix("mapper.")


def _location(name: str) -> tuple[str, ...]:
    """Where a parameter stands in `Config`."""
    if "." in name:
        return tuple(name.split("."))
    return ("mapper", name) if name in MapperConfig.model_fields else (name,)


def _nested(applied: Mapping[str, Setting]) -> dict[str, Any]:
    nested: dict[str, Any] = {}
    for name, setting in applied.items():
        *sections, leaf = _location(name)
        table = nested
        for section in sections:
            table = table.setdefault(section, {})
        table[leaf] = setting.value
    return nested


def _explain(error: ValidationError, applied: Mapping[str, Setting]) -> Iterator[str]:
    by_location = {_location(name): (name, setting) for name, setting in applied.items()}
    for fault in error.errors():
        location = tuple(str(part) for part in fault["loc"])
        name, setting = by_location.get(location[:2], by_location.get(location[:1], (".".join(location), None)))
        message = fault["msg"].removeprefix("Input should be ").removeprefix("Value error, ")
        message = message.removeprefix("a valid number, ").removeprefix("a valid integer, ")
        if setting is None:
            yield f"{name}: {message}"
        else:
            yield f"{name}: expected {message}, got {setting.value!r} ({setting.origin})"


def _expected(field: FieldInfo) -> str:
    names: dict[Any, str] = {float: "a number", int: "a whole number", str: "text"}
    return names.get(field.annotation, "one of its choices")
