"""Files that appear whole or not at all: written beside, synced, and moved into place, whenever Ctrl-C comes."""

from __future__ import annotations

import contextlib
import io
import json
import os
import re
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import Any

import polars as pl

from omnieval.errors import ResultError

_TEMPORARY = re.compile(r"\.(?P<name>.+)\.\d+\.tmp")


def claim_file(file: Path, *, overwrite: bool) -> None:
    """Refuse a file that cannot or must not be written, before the work of filling it is done.

    Raises
    ------
    ResultError
        If it exists and is not to be overwritten, or has no folder.
    """
    try:
        occupied = file.is_dir() or (file.exists() and not overwrite)
    except OSError as error:
        raise ResultError(f"cannot write {file}: {error.strerror or error}; choose another --out") from error
    if occupied:
        raise ResultError(f"{file} exists; choose another --out or pass --overwrite")
    if not file.parent.is_dir():
        raise ResultError(f"cannot write {file}: there is no folder {file.parent}; make it or choose another --out")


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Give a temporary path beside `path` to write to; move it into place when the block ends well.

    Raises
    ------
    ResultError
        If the file cannot be written.
    """
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        yield temporary
        with temporary.open("rb+") as written:
            os.fsync(written.fileno())
        temporary.replace(path)
    except OSError as error:
        raise ResultError(f"cannot write {path}: {error.strerror or error}; choose another --out") from error
    finally:
        # What made the writing fail may keep us from tidying up as well, and is what to tell.
        with contextlib.suppress(OSError):
            temporary.unlink(missing_ok=True)


def named(path: Path) -> Path:
    """Return what a file of `replacing` will be called, any other file as it is."""
    found = _TEMPORARY.fullmatch(path.name)
    return path if found is None else path.with_name(found["name"])


def is_temporary(path: Path, *, of: str | None = None) -> bool:
    """Whether this is a file of `replacing` (for the name `of`), which only a killed process leaves behind."""
    found = _TEMPORARY.fullmatch(path.name)
    return found is not None and of in {None, found["name"]}


def write_table(table: pl.DataFrame, path: Path) -> None:
    """Write a table as parquet; see `replacing`."""
    content = io.BytesIO()  # so that only the operating system can fail, with an error that says how
    with interrupts_wait():
        table.write_parquet(content)
    with replacing(path) as temporary:
        temporary.write_bytes(content.getbuffer())


def write_json(content: dict[str, Any], path: Path) -> None:
    """Write an object as readable JSON; see `replacing`."""
    text = json.dumps(content, indent=2, allow_nan=False) + "\n"
    with replacing(path) as temporary:
        temporary.write_text(text, "utf-8")


@contextmanager
def interrupts_wait() -> Iterator[None]:
    """Let Ctrl-C wait until the block has ended.

    A `KeyboardInterrupt` in the middle of native code, such as that of polars, gets lost there or comes out as another
    error. Only the main thread is ever interrupted; in others this does nothing.
    """
    handler = signal.getsignal(signal.SIGINT)
    if threading.current_thread() is not threading.main_thread() or not callable(handler):
        yield
        return
    arrived: list[tuple[int, FrameType | None]] = []
    signal.signal(signal.SIGINT, lambda number, frame: arrived.append((number, frame)))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, handler)
    if arrived:
        handler(*arrived[-1])
