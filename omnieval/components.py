"""Descriptors and mappers by name, by place, or as objects, each with its own identity.

A component is named on the command line, in files and from Python by

- a name: ``hog``, ``leader``, or one that an installed package registers under the entry points `GROUPS`,
- ``package.module:Class``,
- ``path/file.py:Class``,
- ``onnx:MODEL.onnx``, a descriptor that a network in a file makes.

Its **identity** is its name, its settings, a digest of its source code and one of its weights: equal identities make
the same of the same input. The source code is the component's module and the modules of the same package (or folder,
for a file) that it imports, directly or not.
"""

from __future__ import annotations

import copy
import dataclasses
import hashlib
import importlib
import inspect
import json
import re
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from importlib.metadata import entry_points
from pathlib import Path, PurePath
from types import CodeType, ModuleType
from typing import Any, Literal

from pydantic import BaseModel, ValidationError

from omnieval.errors import ConfigError, ResultError
from omnieval.source_code import digest_of, files_digest, is_loaded_from_file, module_of_file, root_of, sources_of
from omnieval.wording import did_you_mean, shown

Kind = Literal["descriptor", "mapper"]

BUILT_IN: dict[Kind, dict[str, str]] = {
    "descriptor": {"hog": "omnieval.descriptors.hog:Hog", "gist": "omnieval.descriptors.gist:Gist"},
    "mapper": {
        "roman2020": "omnieval.mapping.roman2020.mapper:Roman2020",
        "leader": "omnieval.mapping.leader:Leader",
        "geodesic": "omnieval.mapping.geodesic.mapper:Geodesic",
        "birch": "omnieval.mapping.birch:Birch",
        "valley": "omnieval.mapping.valley:Valley",
    },
}
"""Components that come with omnieval, the default first, by their place, so that each is imported when it is used."""

_OF_FILES: dict[Kind, dict[str, str]] = {
    "descriptor": {"onnx": "omnieval.descriptors.network:Network"},
    "mapper": {},
}
"""By the word before a file: what makes a component of that file."""

GROUPS: dict[Kind, str] = {"descriptor": "omnieval.descriptors", "mapper": "omnieval.mappers"}
"""Entry points under which installed packages register theirs."""

_WORK: dict[Kind, str] = {"descriptor": "describe", "mapper": "step"}
"""What makes a class one of its kind."""


@dataclass(frozen=True)
class Component:
    """A descriptor or mapper with its settings, known by its identity.

    Attributes
    ----------
    kind
        What it is.
    name
        What it is called in tables.
    spec
        What names its class: see the module. None for an object whose class nothing else can find again.
    settings
        Its parameters, as plain values.
    code
        Digest of its source code.
    weights
        Digest of the file of its weights; None if it has none.
    given
        The object it was made from, if it was one.
    """

    kind: Kind
    name: str
    spec: str | None
    settings: dict[str, Any]
    code: str
    weights: str | None = None
    given: Any = field(default=None, compare=False, repr=False)

    @property
    def identity(self) -> dict[str, Any]:
        """What determines all that it makes of an input, as plain values."""
        return {"name": self.name, "settings": self.settings, "code": self.code, "weights": self.weights}

    @property
    def is_default(self) -> bool:
        """Whether it is the default."""
        return self.spec == next(iter(BUILT_IN[self.kind]))

    @property
    def about(self) -> dict[str, Any]:
        """What ``run.json`` says of it."""
        return {"name": self.name, "spec": self.spec, **self.identity, "identity": digest_of(self.identity)}

    @property
    def typed_settings(self) -> Any:
        """Its settings as its class wants them; the plain values if it does not say."""
        if self.given is not None:
            return getattr(self.given, "settings", None) or self.settings
        model = settings_model(self.cls)
        return model.model_validate(self.settings) if model else self.settings

    @property
    def cls(self) -> Any:
        """Its class.

        Raises
        ------
        ConfigError
            If it cannot be found.
        """
        if self.given is not None:
            return type(self.given)
        if self.spec is None:
            raise ConfigError(
                f"the {self.kind} {self.name} was an object in memory, not in a file or package; give it again"
            )
        return find_class(self.kind, self.spec)

    def make(self, **more: Any) -> Any:
        """Return a new object of it (the one it was made from, if it was one); `more` goes to its constructor.

        Raises
        ------
        ConfigError
            If it cannot be found or made.
        """
        if self.given is not None:
            return self.given
        return _instance(self.cls, self.kind, self.spec or self.name, self.settings, **more)

    def fresh(self, **more: Any) -> Any:
        """Return a new object, also where it was made from one: of the same class with the same settings.

        Raises
        ------
        ConfigError
            If it cannot be found or made.
        """
        if self.given is None:
            return self.make(**more)
        return _instance(type(self.given), self.kind, self.name, self.settings, **more)

    def again(self) -> Component:
        """Return the component as it can be made now.

        Raises
        ------
        ResultError
            If it cannot be made any more, or has another identity than this one.
        """
        if self.given is not None:
            return self
        try:
            now = resolve_component(self.kind, self.spec or "", self.settings) if self.spec else None
        except ValidationError as error:
            faults = "; ".join(f"{'.'.join(map(str, fault['loc']))}: {fault['msg']}" for fault in error.errors())
            raise ResultError(f"the {self.kind} {self.name} cannot be made again: {faults}") from error
        except ConfigError as error:
            raise ResultError(f"the {self.kind} {self.name} cannot be made again: {error}") from error
        if now is None:
            raise ResultError(
                f"the {self.kind} {self.name} was an object in memory, not in a file or package, so it cannot be made "
                "again"
            )
        if now.identity != self.identity:
            changed = ", ".join(key for key, value in self.identity.items() if now.identity[key] != value)
            raise ResultError(f"the {self.kind} {self.name} has changed since the run ({changed}); replay it again")
        return now

    @staticmethod
    def of_run(kind: Kind, about: Mapping[str, Any]) -> Component:
        """Return the component that ``run.json`` describes; nothing is imported for it."""
        return Component(
            kind, about["name"], about["spec"], dict(about["settings"]), about["code"], about.get("weights")
        )


def known(kind: Kind) -> list[str]:
    """Return the names of all components of a kind that are installed, the default first."""
    registered = {entry.name for entry in entry_points(group=GROUPS[kind])}
    return [*BUILT_IN[kind], *sorted(registered - set(BUILT_IN[kind]))]


def resolve_component(kind: Kind, chosen: Any, settings: Mapping[str, Any] | None = None) -> Component:
    """Return a component by what names it, or of an object or class.

    Parameters
    ----------
    kind
        What is wanted.
    chosen
        See the module; or an object, or a class.
    settings
        Values by the names of its parameters; the rest keep their defaults.

    Raises
    ------
    ConfigError
        If there is no such component, or it is none of its kind.
    pydantic.ValidationError
        If a setting is unknown or invalid.
    """
    if isinstance(chosen, Component):
        if chosen.kind != kind:
            raise ConfigError(f"{chosen.name} is not a {kind} but a {chosen.kind}")
        return chosen
    if not isinstance(chosen, str) and not inspect.isclass(chosen):
        return _of_object(kind, chosen)
    spec = canonical_spec(chosen) if isinstance(chosen, str) else _spec_of(chosen)
    cls = find_class(kind, chosen) if isinstance(chosen, str) else chosen
    _check(kind, cls, str(chosen))
    model, plain = settings_model(cls), dict(settings or {})
    if model is not None:
        plain = model.model_validate(plain).model_dump(mode="json")
    if spec is not None and (file := _file_of(kind, spec)):
        made = dataclasses.replace(_of_object(kind, _construct(cls, kind, spec, file)), spec=spec)
        if plain not in ({}, made.settings):
            raise ConfigError(f"the parameters of {made.name} are those of the card beside {file}; change them there")
        return made
    if spec in BUILT_IN[kind]:  # nothing but their settings and code tells them apart
        return Component(kind, name_of(cls), spec, plain, code_digest(cls))
    made = _of_object(kind, _instance(cls, kind, spec or cls.__name__, plain))
    return made if spec is None else dataclasses.replace(made, spec=spec, given=None)


def canonical_spec(spec: str) -> str:
    """Return what names a class so that it means the same from every folder: with the whole path of a file."""
    word, colon, file = spec.partition(":")
    if colon and any(word in words for words in _OF_FILES.values()):
        return f"{word}:{Path(file).expanduser().resolve()}"
    where, colon, name = spec.rpartition(":")
    return f"{Path(where).expanduser().resolve()}:{name}" if colon and where.endswith(".py") else spec


def find_class(kind: Kind, spec: str) -> Any:
    """Return the class that a text names; see the module.

    Raises
    ------
    ConfigError
        If there is none, or importing it fails.
    """
    place = BUILT_IN[kind].get(spec)
    if place is None and _file_of(kind, spec):
        place = _OF_FILES[kind][spec.partition(":")[0]]
    if place is None and ":" not in spec:
        entry = next((entry for entry in entry_points(group=GROUPS[kind]) if entry.name == spec), None)
        if entry is None:
            hint = did_you_mean(spec, known(kind))
            raise ConfigError(
                f"unknown {kind} {shown(spec)!r}; {hint} (one of your own: package.module:Class or path/file.py:Class)"
            )
        place = entry.value
    where, _, name = (place or spec).rpartition(":")
    if not where or not name:
        raise ConfigError(f"{kind} {shown(spec)!r}: expected package.module:Class or path/file.py:Class")
    module = module_of_file(kind, spec, Path(where)) if where.endswith(".py") else _module(kind, spec, where)
    try:
        found = module
        for part in name.split("."):
            found = getattr(found, part)
    except AttributeError as error:
        classes = [one for one, value in vars(module).items() if inspect.isclass(value)]
        hint = did_you_mean(name, classes, otherwise="it has no class")
        raise ConfigError(f"{kind} {shown(spec)!r}: {where} has no {name}; {hint}") from error
    _check(kind, found, spec)
    return found


def _file_of(kind: Kind, spec: str) -> str:
    """Return the file that a component is made of; empty if it is made of none."""
    word, _, file = spec.partition(":")
    return file if word in _OF_FILES[kind] else ""


def settings_model(cls: Any) -> type[BaseModel] | None:
    """Return the model of a component's parameters; None if it declares none, or a base class one without any."""
    model = getattr(cls, "Settings", None)
    return model if inspect.isclass(model) and issubclass(model, BaseModel) and model.model_fields else None


def code_digest(cls: Any) -> str:
    """Return the digest of the source code of a class: of its module, and of what this imports from beside it.

    It is that of the code that runs: a module that was edited after it was loaded still runs as it was.
    """
    module = sys.modules.get(cls.__module__)
    file = getattr(module, "__file__", None)
    if file is None or not Path(file).is_file():
        return digest_of(_own_source(cls))
    known, specs, digest = _DIGESTS.get(cls.__module__, (None, {}, ""))
    if known is module and all(_spec_in_use(name) is spec for name, spec in specs.items()):
        return digest
    found = sorted(sources_of(Path(file), cls.__module__))
    digest = files_digest(tuple(found), root_of(Path(file), cls.__module__))
    files = {str(one) for one in found}
    names = [name for name, one in list(sys.modules.items()) if getattr(one, "__file__", None) in files]
    _DIGESTS[cls.__module__] = module, {name: _spec_in_use(name) for name in names}, digest
    return digest


def _spec_in_use(name: str) -> Any:
    """Return the spec of a loaded module; loading it again gives it another."""
    return getattr(sys.modules.get(name), "__spec__", None)


_DIGESTS: dict[str, tuple[Any, dict[str, Any], str]] = {}
"""By module: the module, the specs of those that its code is in by name, and the digest of that code."""


def plain_settings(given: Any) -> dict[str, Any]:
    """Return the settings of an object as plain values; where it says none, all that it holds, told in plain values."""
    model = settings_model(type(given))
    settings = getattr(given, "settings", None)
    if model is not None and not isinstance(settings, model):
        settings = next((value for value in _held(given).values() if isinstance(value, model)), settings)
    if isinstance(settings, BaseModel) and type(settings).model_fields:
        return settings.model_dump(mode="json")
    if isinstance(settings, Mapping):
        return copy.deepcopy(dict(settings))
    told = {name: _told(value) for name, value in _held(given).items()}
    return {name: value for name, value in told.items() if value not in ([], {})}  # which a new object fills later


def _held(given: Any) -> dict[str, Any]:
    """Return the attributes of an object."""
    slots = [name for cls in type(given).__mro__ for name in getattr(cls, "__slots__", ()) if hasattr(given, name)]
    return {**{name: getattr(given, name) for name in slots if name != "__dict__"}, **getattr(given, "__dict__", {})}


def _told(value: Any, around: tuple[Any, ...] = ()) -> Any:
    """Return plain values that differ where values do, as far as can be told; `around` is what holds it."""
    if any(value is one for one in around):
        return "itself"
    inside = (*around, value)
    if isinstance(value, Mapping):
        return {str(name): _told(one, inside) for name, one in value.items()}
    if isinstance(value, list | tuple):
        return [_told(one, inside) for one in value]
    if value is None or isinstance(value, str | int | float):
        return value if _plain(value) else repr(value)
    return _told_object(value, inside)


def _told_object(value: Any, inside: tuple[Any, ...]) -> Any:
    if isinstance(value, BaseModel):
        return value.model_dump(mode="json")
    if hasattr(value, "dtype") and hasattr(value, "tobytes"):  # of NumPy, which need not be loaded for this
        digest = hashlib.blake2b(value.tobytes(), digest_size=16).hexdigest()
        return f"{value.dtype} {value.shape} {digest}" if value.size else []
    if isinstance(value, PurePath):
        return str(value)
    if inspect.isroutine(value) or inspect.isclass(value):
        return f"{value.__module__}:{value.__qualname__}"
    told = {"class": f"{type(value).__module__}:{type(value).__qualname__}"}
    if dataclasses.is_dataclass(value) or any(hasattr(value, work) for work in _WORK.values()):
        told |= {name: _told(one, inside) for name, one in _held(value).items()}
    return told


def _of_object(kind: Kind, given: Any) -> Component:
    cls = type(given)
    _check(kind, cls, cls.__name__)
    settings = plain_settings(given)
    if not _plain(settings):
        raise ConfigError(f"the settings of {kind} {name_of(given)} must be plain values that JSON can hold")
    weights = _file_digest(getattr(given, "weights", None))
    return Component(kind, name_of(given), _spec_of(cls), settings, code_digest(cls), weights, given)


def _check(kind: Kind, cls: Any, what: str) -> None:
    if not callable(getattr(cls, _WORK[kind], None)) or not inspect.isclass(cls):
        raise ConfigError(f"{shown(what)} is not a {kind}: a {kind} is a class with a method {_WORK[kind]}")


def _instance(cls: Any, kind: Kind, what: str, settings: Mapping[str, Any], **more: Any) -> Any:
    """Return a new object with these settings; the constructor of a class without `Settings` may take some by name."""
    model = settings_model(cls)
    if model is not None:
        return _construct(cls, kind, what, model.model_validate(dict(settings)), **more)
    taken = inspect.signature(cls).parameters
    by_name = {name.lstrip("_"): value for name, value in settings.items()}
    made = _construct(cls, kind, what, **{name: by_name[name] for name in taken if name in by_name}, **more)
    now = plain_settings(made)
    if lost := [name for name, value in settings.items() if now.get(name) != value]:
        raise ConfigError(
            f"{kind} {shown(what)} cannot be made with the {', '.join(lost)} it had; let its constructor take "
            f"{'it' if len(lost) == 1 else 'them'}, or declare Settings"
        )
    return made


def _construct(cls: Any, kind: Kind, what: str, *arguments: Any, **more: Any) -> Any:
    try:
        return cls(*arguments, **more)
    except TypeError as error:
        raise ConfigError(
            f"{kind} {shown(what)} cannot be made: {error}; it must take one object of its Settings, or nothing"
        ) from error


def _file_digest(file: Any) -> str | None:
    if file is None:
        return None
    try:
        with Path(file).expanduser().open("rb") as stream:
            return hashlib.file_digest(stream, lambda: hashlib.blake2b(digest_size=16)).hexdigest()
    except OSError as error:
        raise ConfigError(f"cannot read the weights {file}: {error.strerror or error}") from error


def name_of(component: Any) -> str:
    """Return the name a component gives itself; else that of its class, in the form names have."""
    name = getattr(component, "name", None)
    if isinstance(name, str) and name:
        return name
    cls = component if inspect.isclass(component) else type(component)
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "-", cls.__name__).lower()


def _plain(value: Any) -> bool:
    try:
        json.dumps(value, allow_nan=False)
    except (TypeError, ValueError):
        return False
    return True


def _spec_of(cls: Any) -> str | None:
    """Return what names a class; None where only this process knows it."""
    for places in BUILT_IN.values():
        for name, place in places.items():
            if place == f"{cls.__module__}:{cls.__qualname__}":
                return name
    module = sys.modules.get(cls.__module__)
    if "<locals>" in cls.__qualname__ or module is None:
        return None
    file = getattr(module, "__file__", None)
    if file is None:
        return None
    if cls.__module__ == "__main__" or is_loaded_from_file(cls.__module__):
        return f"{Path(file).resolve()}:{cls.__qualname__}"
    return f"{cls.__module__}:{cls.__qualname__}"


def _module(kind: Kind, spec: str, name: str) -> ModuleType:
    try:
        return importlib.import_module(name)
    except Exception as error:  # whatever the code of others raises when it is run
        raise ConfigError(f"{kind} {shown(spec)!r} cannot be imported: {type(error).__name__}: {error}") from error


def _own_source(cls: Any) -> dict[str, Any]:
    """Return the source of a class that has no file, such as one of a notebook, and of what it uses from beside it."""
    found: dict[str, Any] = {}
    waiting = [cls]
    while waiting:
        one = waiting.pop()
        if one.__qualname__ in found:
            continue
        if inspect.isclass(one):
            own = {name: getattr(value, "__func__", value) for name, value in vars(one).items()}
            own |= {name: value.fget for name, value in own.items() if isinstance(value, property)}
            found[one.__qualname__] = {name: _told(value) for name, value in own.items() if not name.startswith("__")}
            used = [*one.__bases__, *own.values()]
        else:
            found[one.__qualname__] = _source_of(one)
            names = {name for code in _codes(one.__code__) for name in code.co_names} & one.__globals__.keys()
            used = [one.__globals__[name] for name in sorted(names)]
            found |= {
                name: _told(one.__globals__[name])
                for name in names
                if not _is_code(one.__globals__[name]) and not inspect.ismodule(one.__globals__[name])
            }
        waiting += [value for value in used if _is_code(value) and value.__module__ == cls.__module__]
    return found


def _is_code(value: Any) -> bool:
    return inspect.isclass(value) or inspect.isfunction(value)


def _source_of(function: Any) -> Any:
    """Return the source of a function; what it was compiled to if that is all."""
    try:
        return inspect.getsource(function)
    except (OSError, TypeError):
        return [
            [code.co_code.hex(), repr([one for one in code.co_consts if not inspect.iscode(one)]), code.co_names]
            for code in _codes(function.__code__)
        ]


def _codes(code: CodeType) -> Iterator[CodeType]:
    """Yield compiled code and all that lies within."""
    yield code
    for one in code.co_consts:
        if inspect.iscode(one):
            yield from _codes(one)
