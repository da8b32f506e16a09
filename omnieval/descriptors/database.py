"""A SQLite file whose loss is no loss: never in the way, and begun anew when damaged."""

from __future__ import annotations

import sqlite3
from pathlib import Path
from typing import Any

_BATCH = 64
"""Rows written in one transaction; a transaction is open only while they are written, so processes do not wait."""
_PATIENCE_S = 30.0
_FAULTS = (sqlite3.Error, UnicodeDecodeError)
"""What a damaged file makes SQLite raise; the latter when it quotes the damage in a message of its own."""


class SpareDatabase:
    """Rows that can be computed again. Several processes can use one file.

    When the file cannot be read or written, nothing is found and nothing kept from then on. A damaged file is put
    aside, with the suffix ``.damaged``, and an empty one takes its place.

    Parameters
    ----------
    path
        The file; its folder is made when it is missing.
    tables
        SQL that creates the tables unless they exist.

    Attributes
    ----------
    note
        Why rows are not kept, or what was done about damage; None while all is well.
    """

    def __init__(self, path: Path, tables: str) -> None:
        self.note: str | None = None
        self._path = path
        self._tables = tables
        self._pending: list[tuple[str, tuple[Any, ...]]] = []
        self._renewed = False
        self._connection: sqlite3.Connection | None = None
        self._open()

    def find(self, query: str, values: tuple[Any, ...]) -> tuple[Any, ...] | None:
        """Return the first row a query yields, None if there is none. Rows not saved yet are not found."""
        if self._connection is None:
            return None
        try:
            row: tuple[Any, ...] | None = self._connection.execute(query, values).fetchone()
        except _FAULTS as error:
            self._survive(error)
            return None
        return row

    def write(self, statement: str, values: tuple[Any, ...]) -> None:
        """Have a statement executed, sooner or later."""
        if self._connection is None:
            return
        self._pending.append((statement, values))
        if len(self._pending) >= _BATCH:
            self.save()

    def save(self) -> None:
        """Execute what is pending."""
        pending, self._pending = self._pending, []
        if self._connection is None or not pending:
            return
        try:
            with self._connection:
                for statement, values in pending:
                    self._connection.execute(statement, values)
        except _FAULTS as error:
            self._survive(error)

    def close(self) -> None:
        """Execute what is pending and close the file."""
        self.save()
        self._disconnect()

    def _open(self) -> None:
        try:
            self._path.parent.mkdir(parents=True, exist_ok=True)
            self._connect()
        except (*_FAULTS, OSError) as error:
            self._survive(error)

    def _connect(self) -> None:
        self._connection = sqlite3.connect(self._path, timeout=_PATIENCE_S, check_same_thread=False)
        self._connection.text_factory = _decode
        self._connection.execute("PRAGMA journal_mode = WAL")
        self._connection.execute("PRAGMA synchronous = NORMAL")
        self._connection.executescript(self._tables)

    def _disconnect(self) -> None:
        if self._connection is not None:
            self._connection.close()
            self._connection = None

    def _survive(self, error: Exception) -> None:
        """Begin anew if the file is damaged (once), else go on without it."""
        self._disconnect()
        self._pending = []
        # Subclasses stand for a locked, full or unwritable place; a malformed file has the plain class.
        damaged = type(error) is sqlite3.DatabaseError or isinstance(error, UnicodeDecodeError)
        if not damaged or self._renewed:
            self.note = f"{self._path} is not used: {error}"
            return
        self._renewed = True
        aside = self._path.with_suffix(".damaged")
        try:
            self._path.replace(aside)
            for suffix in ("-wal", "-shm"):  # an old log must not be applied to the new file
                self._path.with_name(self._path.name + suffix).unlink(missing_ok=True)
        except OSError as failure:
            self.note = f"{self._path} is not used: {error}, and it cannot be put aside: {failure}"
            return
        self.note = f"{self._path} was damaged ({error}); it is begun anew and the old one kept as {aside.name}"
        self._open()


def _decode(text: bytes) -> str:
    """Read a text; a damaged one is another text, not an error."""
    return text.decode("utf-8", "replace")
