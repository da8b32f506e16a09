"""What names a component, and its class found by that."""

from __future__ import annotations

import importlib
import inspect
import re
import sys
from importlib.metadata import entry_points
from pathlib import Path
from types import ModuleType
from typing import Any, Literal

from omnieval.errors import ConfigError
from omnieval.source_code import is_loaded_from_file, module_of_file
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

WORK: dict[Kind, str] = {"descriptor": "describe", "mapper": "step"}
"""What makes a class one of its kind."""


def known(kind: Kind) -> list[str]:
    """Return the names of all components of a kind that are installed, the default first."""
    registered = {entry.name for entry in entry_points(group=GROUPS[kind])}
    return [*BUILT_IN[kind], *sorted(registered - set(BUILT_IN[kind]))]


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
    if place is None and file_of(kind, spec):
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
    module = module_of_file(kind, spec, Path(where)) if where.endswith(".py") else _imported(kind, spec, where)
    try:
        found = module
        for part in name.split("."):
            found = getattr(found, part)
    except AttributeError as error:
        classes = [one for one, value in vars(module).items() if inspect.isclass(value)]
        hint = did_you_mean(name, classes, otherwise="it has no class")
        raise ConfigError(f"{kind} {shown(spec)!r}: {where} has no {name}; {hint}") from error
    check_kind(kind, found, spec)
    return found


def file_of(kind: Kind, spec: str) -> str:
    """Return the file that a component is made of; empty if it is made of none."""
    word, _, file = spec.partition(":")
    return file if word in _OF_FILES[kind] else ""


def name_of(component: Any) -> str:
    """Return the name a component gives itself; else that of its class, in the form names have."""
    name = getattr(component, "name", None)
    if isinstance(name, str) and name:
        return name
    cls = component if inspect.isclass(component) else type(component)
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "-", cls.__name__).lower()


def spec_of(cls: Any) -> str | None:
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


def check_kind(kind: Kind, cls: Any, what: str) -> None:
    """Refuse a class that is none of its kind.

    Raises
    ------
    ConfigError
        If it is no class, or cannot do the work.
    """
    if not callable(getattr(cls, WORK[kind], None)) or not inspect.isclass(cls):
        raise ConfigError(f"{shown(what)} is not a {kind}: a {kind} is a class with a method {WORK[kind]}")


def _imported(kind: Kind, spec: str, name: str) -> ModuleType:
    try:
        return importlib.import_module(name)
    except Exception as error:  # whatever the code of others raises when it is run
        raise ConfigError(f"{kind} {shown(spec)!r} cannot be imported: {type(error).__name__}: {error}") from error
