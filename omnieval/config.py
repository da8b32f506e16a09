"""What determines a replay besides the sequence: a mapper, a descriptor and imaging, each with its parameters.

There is one way to name and set a parameter. A name is the bare one (``omega``) or says whose it is (``mapper.omega``,
``roman2020.omega``, ``hog.bins``, ``imaging.rows``); a bare name goes to the mapper's parameter, else to the one that
the descriptor or imaging has of that name. The command line (``--set``), TOML files (``--config``), ablation axes and
Python all go through `resolve`.
"""

from __future__ import annotations

import inspect
import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo

from omnieval.components.component import Component, resolve_component
from omnieval.components.names import BUILT_IN, Kind, find_class, known, name_of
from omnieval.components.settings import settings_model
from omnieval.datasets.cards import parse_camera
from omnieval.datasets.scan import read_text
from omnieval.errors import ConfigError, DatasetError
from omnieval.imaging.settings import ImagingConfig
from omnieval.wording import did_you_mean

_IMAGING = "imaging"
RECOMMENDED = "recommended"
"""The preset that every mapper has, in which all parameters have their defaults."""


@dataclass(frozen=True)
class Config:
    """All that determines a replay besides the sequence."""

    mapper: Component
    descriptor: Component
    imaging: ImagingConfig

    @property
    def seed(self) -> int:
        """Root of every random choice; a mapper that has none may call it ``seed``."""
        seed: int = self.mapper.settings.get("seed", 0)
        return seed

    @property
    def settings(self) -> dict[str, Any]:
        """All parameters by the names they are set with: the mapper's bare, the others' behind whose they are."""
        return {
            **self.mapper.settings,
            **{f"{_IMAGING}.{name}": value for name, value in self.imaging.model_dump(mode="json").items()},
            **{f"{self.descriptor.name}.{name}": value for name, value in self.descriptor.settings.items()},
        }

    @staticmethod
    def of_run(manifest: Mapping[str, Any]) -> Config:
        """Return the configuration that ``run.json`` describes; no component is imported for it."""
        return Config(
            Component.of_run("mapper", manifest["mapper"]),
            Component.of_run("descriptor", manifest["descriptor"]),
            ImagingConfig.model_validate(manifest[_IMAGING]),
        )


@dataclass(frozen=True, slots=True)
class Setting:
    """One parameter set by someone: its name, its value (text or TOML value), and where it was set."""

    name: str
    value: Any
    origin: str


@dataclass(frozen=True)
class Owner:
    """Whose parameters some are: a component or imaging, and whether it was chosen."""

    name: str
    kind: Kind | None
    model: type[BaseModel] | None
    chosen: bool

    @property
    def fields(self) -> dict[str, FieldInfo]:
        """The parameters of this owner."""
        return dict(self.model.model_fields) if self.model else {}

    def full(self, field: str) -> str:
        """Return the name that a parameter is set with."""
        return field if self.kind == "mapper" and self.chosen else f"{self.name}.{field}"


def owners(mapper: Any = None, descriptor: Any = None, *, everything: bool = True) -> list[Owner]:
    """Return whose parameters can be set: those of the chosen mapper, of imaging, of the chosen descriptor.

    With `everything`, those of the other built-in components follow: files may set them for when they are chosen.

    Raises
    ------
    ConfigError
        If there is no such component.
    """
    found = [_owner("mapper", mapper), Owner(_IMAGING, None, ImagingConfig, True), _owner("descriptor", descriptor)]
    if everything:
        taken = {owner.name for owner in found}
        for kind, names in BUILT_IN.items():
            found += [
                Owner(name, kind, settings_model(find_class(kind, name)), chosen=False)
                for name in names
                if name not in taken
            ]
    return found


def parameters(mapper: Any = None, descriptor: Any = None, *, everything: bool = True) -> dict[str, FieldInfo]:
    """Return every parameter by the name it is set with; see `owners`."""
    found = owners(mapper, descriptor, everything=everything)
    return {owner.full(name): field for owner in found for name, field in owner.fields.items()}


def full_name(name: str, mapper: Any = None, descriptor: Any = None) -> str | None:
    """Return the name that a parameter of the chosen components, or of imaging, is set with; None if they have none."""
    all_owners = owners(mapper, descriptor, everything=False)
    place = _place(Setting(name, None, ""), all_owners)
    if isinstance(place, str):
        return None
    return next(owner for owner in all_owners if owner.name == place[0]).full(place[1])


def presets(mapper: Any = None) -> dict[str, Mapping[str, Any]]:
    """Return the named sets of parameters of a mapper."""
    return {RECOMMENDED: {}, **getattr(_class("mapper", mapper), "presets", {})}


def resolve(
    settings: Iterable[Setting] = (), *, preset: str | None = None, mapper: Any = None, descriptor: Any = None
) -> Config:
    """Return the configuration with a preset and then settings applied, later ones winning.

    Parameters
    ----------
    settings
        What is set; ``mapper`` and ``descriptor`` choose components.
    preset
        A name of `presets`.
    mapper, descriptor
        Components (`components.resolve_component`), which win over those that settings choose.

    Raises
    ------
    ConfigError
        One line that names every unknown name (with the nearest known one) and every invalid value.
    """
    given = list(settings)
    mapper = _chosen("mapper", mapper, given)
    descriptor = _chosen("descriptor", descriptor, given)
    given = [setting for setting in given if setting.name not in BUILT_IN]
    named = presets(mapper)
    if preset is not None and preset not in named:
        raise ConfigError(f"unknown preset {preset!r}; {did_you_mean(preset, named)}")
    all_owners = owners(mapper, descriptor, everything=False)
    if any(isinstance(_place(setting, all_owners), str) for setting in given):
        all_owners = owners(mapper, descriptor)
    applied: dict[tuple[str, str], Setting] = {}
    faults: list[str] = []
    chosen = [Setting(name, value, f"preset {preset}") for name, value in named[preset or RECOMMENDED].items()] + given
    for setting in chosen:
        place = _place(setting, all_owners)
        if isinstance(place, str):
            faults.append(place)
            continue
        applied[place] = setting
    known_fields = {owner.name: owner.fields for owner in all_owners}
    # bool is a number to pydantic, but `omega = true` is a slip.
    faults += [
        f"{setting.name}: expected {_expected(known_fields[owner][name])}, got {str(setting.value).lower()} "
        f"({setting.origin})"
        for (owner, name), setting in applied.items()
        if isinstance(setting.value, bool) and known_fields[owner][name].annotation is not bool
    ]
    if faults:
        raise ConfigError("; ".join(dict.fromkeys(faults)))
    others = [owner for owner in all_owners[3:] if any(whose == owner.name for whose, _ in applied)]
    made = _together(
        lambda: _made("mapper", mapper, all_owners[0], applied),
        lambda: _made("descriptor", descriptor, all_owners[2], applied),
        lambda: _validated(all_owners[1], applied),
        # Files may set the parameters of components that were not chosen: for when they are.
        *(partial(_validated, owner, applied) for owner in others),
    )
    return Config(*made[:3])


def configure(
    settings: Mapping[str, Any] | None = None,
    *,
    preset: str | None = None,
    mapper: Any = None,
    descriptor: Any = None,
    **parameters: Any,
) -> Config:
    """Return a configuration from Python: ``configure(omega=1.85)``, ``configure({"hog.bins": 8}, mapper="leader")``.

    Raises
    ------
    ConfigError
        See `resolve`.
    """
    given = {**(settings or {}), **parameters}
    chosen = [Setting(name, value, "configure") for name, value in given.items()]
    return resolve(chosen, preset=preset, mapper=mapper, descriptor=descriptor)


def as_config(
    config: Config | Mapping[str, Any] | None = None,
    *,
    preset: str | None = None,
    mapper: Any = None,
    descriptor: Any = None,
    **parameters: Any,
) -> Config:
    """Return the configuration that a function of Python was given; what is given besides a `Config` changes it.

    Raises
    ------
    ConfigError
        See `resolve`.
    """
    if not isinstance(config, Config):
        return configure(config, preset=preset, mapper=mapper, descriptor=descriptor, **parameters)
    if preset is None and mapper is None and descriptor is None and not parameters:
        return config
    imaging = {f"{_IMAGING}.{name}": value for name, value in config.imaging.model_dump(exclude_defaults=True).items()}
    return configure(
        {**imaging, **parameters},
        preset=preset,
        mapper=config.mapper if mapper is None else mapper,
        descriptor=config.descriptor if descriptor is None else descriptor,
    )


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
        content = tomllib.loads(path.expanduser().read_text("utf-8"))
        return [Setting(name, value, str(path)) for name, value in flattened(content)]
    except OSError as error:
        raise ConfigError(f"cannot read configuration {path}: {error.strerror or error}; check --config") from error
    except (ValueError, RecursionError) as error:  # not only TOMLDecodeError: a number may have too many digits
        raise ConfigError(f"cannot read configuration {path}: {error}; correct it to valid TOML in UTF-8") from error


def read_camera(path: Path) -> list[Setting]:
    """Read what a file like ``camera.toml`` says as settings of imaging.

    Raises
    ------
    ConfigError
        If it cannot be read, or describes no camera.
    """
    return [Setting(f"{_IMAGING}.{name}", value, str(path)) for name, value in _camera_values(path).items()]


def with_camera(imaging: ImagingConfig, path: Path) -> ImagingConfig:
    """Return how images become panoramas of the same size, of a camera that a file like ``camera.toml`` describes.

    Raises
    ------
    ConfigError
        If it cannot be read, or describes no camera.
    """
    return ImagingConfig.model_validate({"rows": imaging.rows, "columns": imaging.columns, **_camera_values(path)})


def _camera_values(path: Path) -> dict[str, Any]:
    file = path.expanduser()
    try:
        camera = parse_camera(read_text(file), file.absolute().parent)
    except DatasetError as error:
        raise ConfigError(f"cannot read the camera {path}: {error}; check --camera") from error
    mask = None if camera.mask is None else str(camera.mask)
    values = {"kind": camera.kind, "belt": camera.belt, "mask": mask}
    values |= {} if camera.mirror is None else asdict(camera.mirror)
    return {name: value for name, value in values.items() if value is not None}


def flattened(content: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Yield the values of nested tables by their dotted names."""
    for name, value in content.items():
        if isinstance(value, dict):
            yield from flattened(value, f"{prefix}{name}.")
        else:
            yield prefix + name, value


def _chosen(kind: Kind, given: Any, settings: Iterable[Setting]) -> Any:
    """Return what chooses a component: what was given, else the last setting of that name, else the default."""
    if given is not None:
        return given
    named = [setting for setting in settings if setting.name == kind]
    if not named:
        return next(iter(BUILT_IN[kind]))
    value = named[-1].value
    if isinstance(value, str) and ":" not in value and value not in known(kind):
        raise ConfigError(f"unknown {kind} {value!r} ({named[-1].origin}); {did_you_mean(value, known(kind))}")
    return value


def _class(kind: Kind, chosen: Any) -> Any:
    """Return the class of what chooses a component, or the object that does."""
    if isinstance(chosen, Component):
        return chosen.cls if chosen.given is None else chosen.given
    if chosen is None or isinstance(chosen, str):
        return find_class(kind, chosen or next(iter(BUILT_IN[kind])))
    return chosen


def _owner(kind: Kind, chosen: Any) -> Owner:
    cls = _class(kind, chosen)
    # The parameters of an object are what they are.
    return Owner(name_of(cls), kind, settings_model(cls) if inspect.isclass(cls) else None, chosen=True)


def _place(setting: Setting, all_owners: list[Owner]) -> tuple[str, str] | str:
    """Return the owner and the name of a parameter that is set, or what is wrong with its name."""
    head, dot, rest = setting.name.partition(".")
    if dot:
        for owner in all_owners:
            if (head == owner.name or (owner.chosen and head == owner.kind)) and rest in owner.fields:
                return owner.name, rest
    else:
        having = [owner for owner in all_owners if owner.chosen and setting.name in owner.fields]
        if having and (having[0].kind == "mapper" or len(having) == 1):
            return having[0].name, setting.name
        if having:
            names = " or ".join(owner.full(setting.name) for owner in having)
            return f"{setting.name} can be {names}: say which ({setting.origin})"
        other = next((owner for owner in all_owners if setting.name in owner.fields), None)
        if other is not None:
            return f"{setting.name} is a parameter of {other.name}, which was not chosen ({setting.origin})"
    names_known = [owner.full(name) for owner in all_owners for name in owner.fields]
    hint = did_you_mean(setting.name.removeprefix("mapper."), names_known, otherwise="omnieval parameters lists them")
    return f"unknown parameter {setting.name!r} ({setting.origin}); {hint}"


def _made(kind: Kind, chosen: Any, owner: Owner, applied: Mapping[tuple[str, str], Setting]) -> Component:
    values = {name: setting.value for (whose, name), setting in applied.items() if whose == owner.name}
    if isinstance(chosen, Component):
        if not values:
            return chosen
        values, chosen = {**chosen.settings, **values}, chosen.spec if chosen.given is None else chosen.given
    made: Component = _explaining(owner, applied, lambda: resolve_component(kind, chosen, values))
    return made


def _validated(owner: Owner, applied: Mapping[tuple[str, str], Setting]) -> Any:
    values = {name: setting.value for (whose, name), setting in applied.items() if whose == owner.name}
    assert owner.model is not None
    model = owner.model
    return _explaining(owner, applied, lambda: model.model_validate(values))


def _together(*makers: Callable[[], Any]) -> list[Any]:
    """Return what is made, or raise what is wrong with all of it at once."""
    made, faults = [], []
    for make in makers:
        try:
            made.append(make())
        except ConfigError as error:
            faults.append(str(error))
    if faults:
        raise ConfigError("; ".join(faults))
    return made


def _explaining(owner: Owner, applied: Mapping[tuple[str, str], Setting], make: Callable[[], Any]) -> Any:
    """Return what is made, or say in one line which settings are invalid."""
    try:
        return make()
    except ValidationError as error:
        raise ConfigError("; ".join(_explain(error, owner, applied))) from error


_OF_NUMBERS = {"float_parsing": "a number", "int_parsing": "a whole number", "int_from_float": "a whole number"}
"""What to say in place of how a number was not parsed."""


def _explain(error: ValidationError, owner: Owner, applied: Mapping[tuple[str, str], Setting]) -> Iterator[str]:
    for fault in error.errors():
        name = str(fault["loc"][0]) if fault["loc"] else ""
        setting = applied.get((owner.name, name))
        message = fault["msg"].removeprefix("Input should be ").removeprefix("Value error, ")
        message = _OF_NUMBERS.get(fault["type"], message)
        if "," in str(fault["input"]) and message == _OF_NUMBERS["float_parsing"]:
            message += " with a decimal point"
        if setting is None:
            yield f"{owner.full(name)}: {message}"
        else:
            yield f"{owner.full(name)}: expected {message}, got {setting.value!r} ({setting.origin})"


def _expected(field: FieldInfo) -> str:
    names: dict[Any, str] = {float: "a number", int: "a whole number", str: "text"}
    return names.get(field.annotation, "one of its choices")
