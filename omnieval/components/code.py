"""The code of components, known by a digest: of the files it is in, or of what a notebook holds."""

from __future__ import annotations

import inspect
import sys
from collections.abc import Iterator
from pathlib import Path
from types import CodeType
from typing import Any

from omnieval.components.settings import as_plain
from omnieval.source_code import digest_of, files_digest, root_of, sources_of


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
            found[one.__qualname__] = {
                name: as_plain(value) for name, value in own.items() if not name.startswith("__")
            }
            used = [*one.__bases__, *own.values()]
        else:
            found[one.__qualname__] = _source_of(one)
            names = {name for code in _codes(one.__code__) for name in code.co_names} & one.__globals__.keys()
            used = [one.__globals__[name] for name in sorted(names)]
            found |= {
                name: as_plain(one.__globals__[name])
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
