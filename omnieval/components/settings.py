"""The settings of components as plain values, also of those that declare none."""

from __future__ import annotations

import copy
import dataclasses
import hashlib
import inspect
import json
from collections.abc import Mapping
from pathlib import PurePath
from typing import Any

from pydantic import BaseModel

from omnieval.components.names import WORK


def settings_model(cls: Any) -> type[BaseModel] | None:
    """Return the model of a component's parameters; None if it declares none, or a base class one without any."""
    model = getattr(cls, "Settings", None)
    return model if inspect.isclass(model) and issubclass(model, BaseModel) and model.model_fields else None


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
    told = {name: as_plain(value) for name, value in _held(given).items()}
    return {name: value for name, value in told.items() if value not in ([], {})}  # which a new object fills later


def _held(given: Any) -> dict[str, Any]:
    """Return the attributes of an object."""
    slots = [name for cls in type(given).__mro__ for name in getattr(cls, "__slots__", ()) if hasattr(given, name)]
    return {**{name: getattr(given, name) for name in slots if name != "__dict__"}, **getattr(given, "__dict__", {})}


def as_plain(value: Any, around: tuple[Any, ...] = ()) -> Any:
    """Return plain values that differ where values do, as far as can be told; `around` is what holds it."""
    if any(value is one for one in around):
        return "itself"
    inside = (*around, value)
    if isinstance(value, Mapping):
        return {str(name): as_plain(one, inside) for name, one in value.items()}
    if isinstance(value, list | tuple):
        return [as_plain(one, inside) for one in value]
    if value is None or isinstance(value, str | int | float):
        return value if is_plain(value) else repr(value)
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
    if dataclasses.is_dataclass(value) or any(hasattr(value, work) for work in WORK.values()):
        told |= {name: as_plain(one, inside) for name, one in _held(value).items()}
    return told


def is_plain(value: Any) -> bool:
    """Whether JSON can hold a value."""
    try:
        json.dumps(value, allow_nan=False)
    except (TypeError, ValueError):
        return False
    return True
