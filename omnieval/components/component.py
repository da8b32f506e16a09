"""A descriptor or mapper with its settings and its identity, and how it is made."""

from __future__ import annotations

import dataclasses
import hashlib
import inspect
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from omnieval.components.code import code_digest
from omnieval.components.names import (
    BUILT_IN,
    Kind,
    canonical_spec,
    check_kind,
    file_of,
    find_class,
    name_of,
    spec_of,
)
from omnieval.components.settings import is_plain, plain_settings, settings_model
from omnieval.errors import ConfigError, ResultError
from omnieval.source_code import digest_of
from omnieval.wording import shown


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
    spec = canonical_spec(chosen) if isinstance(chosen, str) else spec_of(chosen)
    cls = find_class(kind, chosen) if isinstance(chosen, str) else chosen
    check_kind(kind, cls, str(chosen))
    model, plain = settings_model(cls), dict(settings or {})
    if model is not None:
        plain = model.model_validate(plain).model_dump(mode="json")
    if spec is not None and (file := file_of(kind, spec)):
        made = dataclasses.replace(_of_object(kind, _construct(cls, kind, spec, file)), spec=spec)
        if plain not in ({}, made.settings):
            raise ConfigError(f"the parameters of {made.name} are those of the card beside {file}; change them there")
        return made
    if spec in BUILT_IN[kind]:  # nothing but their settings and code tells them apart
        return Component(kind, name_of(cls), spec, plain, code_digest(cls))
    made = _of_object(kind, _instance(cls, kind, spec or cls.__name__, plain))
    return made if spec is None else dataclasses.replace(made, spec=spec, given=None)


def _of_object(kind: Kind, given: Any) -> Component:
    cls = type(given)
    check_kind(kind, cls, cls.__name__)
    settings = plain_settings(given)
    if not is_plain(settings):
        raise ConfigError(f"the settings of {kind} {name_of(given)} must be plain values that JSON can hold")
    weights = _file_digest(getattr(given, "weights", None))
    return Component(kind, name_of(given), spec_of(cls), settings, code_digest(cls), weights, given)


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
