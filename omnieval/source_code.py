"""Source code: which files a module is made of, their digest, and how the module of a file of your own is loaded."""

from __future__ import annotations

import ast
import hashlib
import importlib.util
import json
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import cache, lru_cache
from importlib.machinery import FileFinder, ModuleSpec, SourceFileLoader
from pathlib import Path
from types import CodeType, ModuleType
from typing import Any

from omnieval.errors import ConfigError
from omnieval.wording import shown

_PREFIX = "omnieval_component_"
_INSTALLED = {"site-packages", "dist-packages"}
_OURS = __name__.partition(".")[0]
"""This package: a file in a checkout lies beside its folder, and means the one that runs all the same."""
_LAZY = Path(__file__).with_name("__init__.py")
"""Names everything there is without loading it."""


def digest_of(content: Any) -> str:
    """Return a digest of plain values."""
    text = json.dumps(content, sort_keys=True, separators=(",", ":"), ensure_ascii=False)
    return hashlib.blake2b(text.encode(), digest_size=16).hexdigest()


def files_digest(files: tuple[Path, ...], root: Path) -> str:
    """Return a digest of source files and of their places below `root`."""
    return digest_of([[file.relative_to(root).as_posix(), file.read_text("utf-8", "replace")] for file in files])


@cache
def module_digest(name: str) -> str:
    """Return the digest of a module of this package and of those that it imports."""
    file = importlib.util.find_spec(name)
    assert file is not None
    assert file.origin is not None
    path = Path(file.origin)
    return files_digest(tuple(sorted(sources_of(path, name))), root_of(path, name))


def is_loaded_from_file(module: str) -> bool:
    """Whether a module is that of a file (`module_of_file`), which has no name of its own."""
    return module.startswith(_PREFIX)


def module_of_file(kind: str, spec: str, file: Path) -> ModuleType:
    """Return the module of a file; another one when the file has changed, or what it imports from beside it."""
    path = file.expanduser().resolve()
    try:
        beside = sources_of(path, _PREFIX)
        name = _PREFIX + digest_of([str(path), files_digest(tuple(sorted(beside)), path.parent)])
    except OSError as error:
        raise ConfigError(f"{kind} {shown(spec)!r}: cannot read {path}: {error.strerror or error}") from error
    if name in sys.modules:
        return sys.modules[name]
    loader = _Source(name, str(path))
    module = importlib.util.module_from_spec(ModuleSpec(name, loader, origin=str(path)))
    module.__file__ = str(path)
    with _importing_from(path.parent, {one.relative_to(path.parent).parts[0].removesuffix(".py") for one in beside}):
        sys.modules[name] = module
        try:
            loader.exec_module(module)
        except Exception as error:  # whatever the code of others raises when it is run
            del sys.modules[name]
            raise ConfigError(f"{kind} {shown(spec)!r} cannot be imported: {type(error).__name__}: {error}") from error
    return module


class _Source(SourceFileLoader):
    """Loads a module from its source: bytecode is taken for current by size and seconds, which an edit may keep."""

    def get_code(self, fullname: str) -> CodeType:
        return self.source_to_code(self.get_data(self.path), self.path)


class _Beside:
    """Finds the modules beside a file before all others, as where a script is run."""

    def __init__(self, folder: Path) -> None:
        self._folder = str(folder)

    def find_spec(self, name: str, path: Sequence[str] | None = None, target: Any = None) -> ModuleSpec | None:
        """See `importlib.abc.MetaPathFinder`."""
        del target
        folders = [self._folder] if path is None else [one for one in path if one.startswith(self._folder)]
        finders = (FileFinder(folder, (_Source, [".py"])) for folder in folders)
        return next((found for finder in finders if (found := finder.find_spec(name))), None)


@contextmanager
def _importing_from(folder: Path, names: set[str]) -> Iterator[None]:
    """Let the modules of these names be those of a folder; two folders may have other modules of one name."""

    def taken() -> dict[str, ModuleType]:
        return {name: sys.modules.pop(name) for name in list(sys.modules) if name.partition(".")[0] in names}

    finder, others = _Beside(folder), taken()
    sys.meta_path.insert(0, finder)
    try:
        yield
    finally:
        sys.meta_path.remove(finder)
        taken()
        sys.modules.update(others)


def root_of(file: Path, module: str) -> Path:
    """Return the folder above which no source file belongs to a component: of its package, or of its file."""
    levels = 0 if module == "__main__" or is_loaded_from_file(module) else module.count(".")
    if file.name == "__init__.py":
        levels += 1
    folder = file.parent
    for _ in range(levels):
        folder = folder.parent
    return folder


def sources_of(file: Path, module: str) -> set[Path]:
    """Return a source file and all below its root that it imports, directly or not."""
    root = root_of(file, module)
    if root.name in _INSTALLED and root == file.parent:
        return {file}  # beside it lie the packages of others
    inside = module.partition(".")[0] if "." in module else None
    found: set[Path] = set()
    waiting = [file]
    while waiting:
        one = waiting.pop()
        if one not in found:
            found.add(one)
            names = [name for name in _imports(one, root) if inside or name.partition(".")[0] != _OURS]
            waiting += [path for name in names for path in _files(name, root, inside)]
    return found


def _imports(file: Path, root: Path) -> tuple[str, ...]:
    """Return the names that a source file imports; one that has not changed is not read again."""
    status = file.stat()
    return _imports_of(file, root, status.st_mtime_ns, status.st_size)


@lru_cache(maxsize=4096)
def _imports_of(file: Path, root: Path, *state: int) -> tuple[str, ...]:
    del state
    return tuple(_imported(file, root))


def _imported(file: Path, root: Path) -> Iterator[str]:
    """Yield the names that a source file imports, as modules or from them, but for the type checker alone."""
    try:
        tree = ast.parse(file.read_text("utf-8", "replace"))
    except (SyntaxError, ValueError):  # whoever imports it will say so
        return
    package = file.relative_to(root).parent.parts
    waiting: list[ast.AST] = [tree]
    while waiting:
        node = waiting.pop()
        if isinstance(node, ast.If) and ast.unparse(node.test).endswith("TYPE_CHECKING"):
            waiting += node.orelse
            continue
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            above = package[: len(package) - node.level + 1] if node.level else ()
            base = ".".join([*above, *((node.module or "").split(".") if node.module else ())])
            yield base
            yield from (f"{base}.{alias.name}" if base else alias.name for alias in node.names)
        waiting += ast.iter_child_nodes(node)


def _files(name: str, root: Path, inside: str | None) -> Iterator[Path]:
    """Yield the source file of a module, if it lies below the root."""
    parts = name.split(".")
    if not name or (inside is not None and parts[0] != inside):
        return
    path = root.joinpath(*parts)
    for file in (path.with_suffix(".py"), path / "__init__.py"):
        if file.is_file() and file != _LAZY:
            yield file
