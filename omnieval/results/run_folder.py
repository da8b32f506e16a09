"""The run folder: ``runs/<sequence>-<descriptor>[-<n>]/``.

    run.json              what was run, its status, metrics and timings
    steps.parquet         one row per frame: every decision and its evidence
    nodes.parquet         one row per node
    transitions.parquet   edges of the topological map
    quality.parquet       metrics of the map at every distance, with counts and intervals
    map.npz, map.json     the map with the descriptions of its images (`results.map_file`)
    replay.rrd            the recording for the Rerun viewer
    parts/                steps so far, while the run is under way

Steps are written in parts as they come, so that a killed run leaves a readable prefix.
"""

from __future__ import annotations

import contextlib
import hashlib
import io
import json
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any

import polars as pl

from omnieval.config import Config
from omnieval.errors import ResultError
from omnieval.mapping.interface import Method
from omnieval.mapping.map import TopologicalMap
from omnieval.results.atomic import interrupts_wait, write_table
from omnieval.results.content import content_hash, folder_hash
from omnieval.results.folder import ResultFolder, reason_of
from omnieval.results.manifest import expanded, read_manifest, status_of
from omnieval.results.map_file import MAP_ABOUT, MAP_FILE, load_map
from omnieval.results.schemas import steps_schema
from omnieval.results.tables import steps_frame
from omnieval.wording import counted, safe_name

KIND = "replay"
RECORDING = "replay.rrd"
PARTIAL_RECORDING = "replay.partial.rrd"
TABLES = ("steps", "nodes", "transitions", "quality")
_PARTS = "parts"
_PART = "steps-*.parquet"
_PART_ROWS = 250
_PART_SECONDS = 2.0
FILES = (
    RECORDING,
    PARTIAL_RECORDING,
    MAP_FILE,
    MAP_ABOUT,
    *(f"{table}.parquet" for table in TABLES),
    f"{_PARTS}/{_PART}",
)
"""All that a run writes besides ``run.json``."""


@dataclass(frozen=True)
class Run:
    """A run folder to read.

    Attributes
    ----------
    folder
        Where it is.
    manifest
        The content of ``run.json``.
    """

    folder: Path
    manifest: dict[str, Any]

    def __repr__(self) -> str:
        numbers = {"frame": self.manifest.get("frames"), "node": self.metrics.get("nodes")}
        facts = [self.status, *(counted(number, name) for name, number in numbers.items() if isinstance(number, int))]
        return f"Run({self.folder}: {', '.join(facts)})"

    @property
    def status(self) -> str:
        """``running``, ``complete``, ``interrupted`` or ``failed``; a dead process does not run."""
        return status_of(self.manifest)

    @property
    def config(self) -> Config:
        """What was replayed with what.

        Raises
        ------
        ResultError
            If ``run.json`` does not say it.
        """
        try:
            return Config.of_run(self.manifest)
        except (LookupError, TypeError, ValueError) as error:
            damaged = f"{self.folder}/run.json is damaged: it does not say what was run; run it again"
            raise ResultError(damaged) from error

    @property
    def method(self) -> Method:
        """The words of the evidence."""
        return method_of(self.manifest)

    @property
    def steps(self) -> pl.DataFrame:
        """One row per frame (`schemas.steps_schema`); of a run that did not finish, its steps so far."""
        whole = self.folder / "steps.parquet"
        if whole.exists():
            return self._table("steps")
        parts = _parts(self.folder)
        return (
            pl.concat([_read_table(part) for part in parts]) if parts else steps_schema(self.method.columns).to_frame()
        )

    @property
    def nodes(self) -> pl.DataFrame:
        """One row per node (`schemas.NODES`)."""
        return self._table("nodes")

    @property
    def transitions(self) -> pl.DataFrame:
        """One row per edge of the topological map (`schemas.TRANSITIONS`)."""
        return self._table("transitions")

    @property
    def map(self) -> TopologicalMap:
        """The map with the descriptions of its images.

        Raises
        ------
        ResultError
            If the run has none, or it is damaged.
        """
        return load_map(self.folder)

    @property
    def quality(self) -> pl.DataFrame:
        """One row per metric of the map's quality and distance (`schemas.QUALITY`)."""
        return self._table("quality")

    @property
    def metrics(self) -> dict[str, float | int | None]:
        """Metrics of the final map, empty unless the run is complete."""
        metrics: dict[str, float | int | None] = self.manifest["metrics"]
        return metrics

    @property
    def content_hash(self) -> str:
        """Hash of what the tables say (`content.folder_hash`); of a run that did not end, of its steps so far."""
        names = [name for name in TABLES if (self.folder / f"{name}.parquet").exists()]
        tables = {"steps": self.steps} | {name: self._table(name) for name in names[1:]}
        return folder_hash({name: content_hash(table) for name, table in tables.items()})

    def _table(self, name: str) -> pl.DataFrame:
        file = f"{name}.parquet"
        return _read_table(self.folder / file, self.manifest.get("file_digests", {}).get(file))

    def _repr_html_(self) -> str:
        """Return what a notebook shows."""
        from omnieval.results.summary import run_html  # with what only a notebook needs

        return run_html(self.folder, self.manifest, self.steps)

    @property
    def recording(self) -> Path:
        """Where the Rerun recording is, if there is one."""
        return self.folder / RECORDING


def method_of(manifest: dict[str, Any]) -> Method:
    """Return the mapper that ``run.json`` describes, which has no words of its own where that tells nothing.

    Raises
    ------
    ResultError
        If its description of the mapper is damaged.
    """
    try:
        return Method.model_validate(manifest.get("mapper") or {"name": "unknown"})
    except ValueError as error:
        raise ResultError("run.json is damaged: what it says of the mapper cannot be read; run it again") from error


def open_run(folder: str | Path) -> Run:
    """Open a run folder.

    Raises
    ------
    ResultError
        If it is not one, or one of a schema this version does not know.
    """
    folder = expanded(folder)
    return Run(folder, read_manifest(folder, KIND))


class RunWriter(ResultFolder):
    """Writes one run folder as the run goes; see `ResultFolder`.

    A run that is left early keeps its steps. One that is complete stays so: what ends it early can only have cost the
    recording.

    Parameters
    ----------
    folder
        Created, with its parents.
    manifest
        What is known at the start.
    overwrite
        Whether an earlier run in `folder` may be replaced. Only files that a run, or the report in it, wrote are
        removed.
    """

    when_abandoned: Callable[[], dict[str, Any]] | None = None
    """What else ``run.json`` is to say of the steps so far (`steps`), should the run be left before its end."""

    def __init__(self, folder: str | Path, manifest: dict[str, Any], *, overwrite: bool = False) -> None:
        super().__init__(folder, KIND, manifest, files=FILES, overwrite=overwrite)
        self._columns = method_of(manifest).columns
        self._rows: list[dict[str, Any]] = []
        self._written: list[pl.DataFrame] = []
        self._last_write = time.monotonic()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            if error is not None and self.content.get("status") == "complete":
                self.annotate({"recording_failure": reason_of(error)})
        finally:
            super().__exit__(kind, error, trace)

    def step(self, row: dict[str, Any]) -> None:
        """Add the row of one step (`tables.step_row`)."""
        self._rows.append(row)
        if len(self._rows) >= _PART_ROWS or time.monotonic() - self._last_write > _PART_SECONDS:
            self._write_part()

    def steps(self) -> pl.DataFrame:
        """Return the steps so far."""
        with interrupts_wait():
            self._written = [pl.concat([*self._written, steps_frame(self._rows, self._columns)])]
            self._rows = []  # in here, or an interrupt that has waited comes between, and rows are kept twice
        return self._written[0]

    def finish(self, tables: dict[str, pl.DataFrame], manifest: dict[str, Any]) -> Run:
        """Write the final tables (by the names in `TABLES`) and close the run as complete."""
        for name, table in tables.items():
            write_table(table, self.path / f"{name}.parquet")
        hashes = {name: content_hash(table) for name, table in tables.items()}
        self.complete({**manifest, "content_hashes": hashes, "file_digests": self._file_digests()})
        return Run(self.path, self.content)

    def annotate(self, manifest: dict[str, Any]) -> Run:
        """Add to ``run.json`` of a complete run what was learned since, of its recording.

        The run is complete without it: if it cannot be written any more, the run that is returned has it all the same.
        """
        with contextlib.suppress(ResultError):
            self.update(manifest)
        return Run(self.path, self.content | manifest)

    def _seal(self) -> dict[str, Any]:
        write_table(self.steps(), self.path / "steps.parquet")
        sealed: dict[str, Any] = {"file_digests": self._file_digests()}
        # Only here: where the steps could not be written, what can be read of them are others.
        with contextlib.suppress(Exception):
            said = self.when_abandoned() if self.when_abandoned else {}
            json.dumps(said, allow_nan=False)  # what run.json cannot hold would cost it its status
            sealed = said | sealed
        return sealed

    def _close(self, status: str, content: dict[str, Any]) -> None:
        super()._close(status, content)
        if (self.path / "steps.parquet").exists():
            _remove_parts(self.path)

    def _file_digests(self) -> dict[str, str]:
        """Return the digests of the tables as they are on disk."""
        files = [path for name in TABLES if (path := self.path / f"{name}.parquet").exists()]
        return {path.name: _digest(path.read_bytes()) for path in files}

    def _write_part(self) -> None:
        parts = self.path / _PARTS
        with interrupts_wait():
            part = steps_frame(self._rows, self._columns)
        try:
            parts.mkdir(exist_ok=True)
        except OSError as error:
            raise ResultError(f"cannot write {parts}: {error.strerror}") from error
        write_table(part, parts / f"steps-{self._rows[0]['frame']:08d}.parquet")
        with interrupts_wait():
            self._written.append(part)
            self._rows = []
        self._last_write = time.monotonic()


def free_folder(parent: Path, name: str) -> Path:
    """Return the first of ``name``, ``name-2``, ``name-3`` ... that `parent` does not have yet.

    Whatever `name` is made of, the folder is one in `parent`.
    """
    return next(folder for folder in _numbered(parent, safe_name(name)) if not folder.exists())


def _numbered(parent: Path, name: str) -> Iterator[Path]:
    yield parent / name
    number = 2
    while True:
        yield parent / f"{name}-{number}"
        number += 1


def _parts(folder: Path) -> list[Path]:
    return sorted((folder / _PARTS).glob(_PART))


def _remove_parts(folder: Path) -> None:
    # The whole table is there and is read instead: parts that cannot be removed do no harm.
    with contextlib.suppress(OSError):
        for part in _parts(folder):
            part.unlink()
        (folder / _PARTS).rmdir()


def _read_table(path: Path, digest: str | None = None) -> pl.DataFrame:
    """Read a table whose bytes have this digest (None: whatever they are).

    A flipped bit may give other values, or bring the interpreter down: parquet files have no checksum of their own.
    """
    try:
        data = path.read_bytes()
        if digest is not None and _digest(data) != digest:
            raise ResultError(f"{path} is damaged or was changed since it was written; replay the sequence again")
        return pl.read_parquet(io.BytesIO(data))
    except (OSError, pl.exceptions.PolarsError, pl.exceptions.PanicException) as error:
        raise ResultError(f"cannot read {path}: {error}; replay the sequence again") from error


def _digest(data: bytes) -> str:
    return hashlib.blake2b(data, digest_size=16).hexdigest()
