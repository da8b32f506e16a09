"""Output to a terminal: progress and notes on stderr, results on stdout."""

from __future__ import annotations

import json
import logging
import re
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import polars as pl


@contextmanager
def progress(label: str) -> Iterator[Callable[[int, int], None]]:
    """Give a callback (done, total) that shows progress with ETA on stderr; silent when that is not a terminal."""
    if not sys.stderr.isatty():
        yield _ignore
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(label, total=None)
        yield lambda done, total: bar.update(task, completed=done, total=total)


def print_json(content: dict[str, Any]) -> None:
    """Print one object on stdout."""
    print(json.dumps(content, indent=2, allow_nan=False))


def print_fields(fields: Iterable[tuple[str, str]]) -> None:
    """Print names and values in two aligned columns."""
    from omnieval.text_table import aligned

    for line in aligned(fields, "ll"):
        print(f"  {line}")


def print_table(table: pl.DataFrame) -> None:
    """Print a table whole, in Markdown, numbers with four decimals."""
    from omnieval.text_table import markdown

    print(markdown(table.columns, table.rows()))


def note(message: str) -> None:
    """Say something on stderr, in one line: the names of files in it may hold anything."""
    line = re.sub(r"\s*[\r\n]\s*", " ", message.strip())
    printable = "".join(letter if letter.isprintable() else repr(letter)[1:-1] for letter in line)
    print(f"omnieval: {printable}", file=sys.stderr)


@contextmanager
def library_notes() -> Iterator[None]:
    """Say on stderr what the library has to say while a command runs, each line once."""
    logger, handler = logging.getLogger("omnieval"), _Notes()
    logger.addHandler(handler)
    logger.setLevel(logging.INFO)
    logger.propagate = False
    try:
        yield
    finally:
        logger.propagate = True
        logger.setLevel(logging.NOTSET)
        logger.removeHandler(handler)


class _Notes(logging.Handler):
    """Prints log messages as notes of omnieval, each message once."""

    def __init__(self) -> None:
        super().__init__()
        self._said: set[str] = set()

    def emit(self, record: logging.LogRecord) -> None:
        message = record.getMessage()
        if message not in self._said:
            self._said.add(message)
            note(message)


def _ignore(done: int, total: int) -> None:
    del done, total
