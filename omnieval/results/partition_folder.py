"""The folder of a baseline: ``runs/<sequence>-<descriptor>-<method>[-<n>]/``.

``run.json`` says what was clustered and how, its status and timings; ``baseline.parquet`` has one row a partition,
written as they come, so that a killed baseline leaves a readable prefix.
"""

from __future__ import annotations

import os
import platform
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import polars as pl

from omnieval.errors import ResultError
from omnieval.results.atomic import write_json, write_table
from omnieval.results.run_folder import MANIFEST, open_run
from omnieval.results.schemas import PARTITIONS, SCHEMA_VERSION

TABLE = "baseline.parquet"
KIND = "baseline"


class PartitionWriter:
    """Writes one baseline folder row by row; the status in ``run.json`` is always true.

    Parameters
    ----------
    folder
        Created, with its parents.
    manifest
        What is known at the start.
    overwrite
        Whether an earlier baseline in `folder` may be replaced. Only files that a baseline writes are replaced.

    Raises
    ------
    ResultError
        If the folder holds something already or cannot be written.
    """

    def __init__(self, folder: Path, manifest: dict[str, Any], *, overwrite: bool = False) -> None:
        _claim(folder, overwrite=overwrite)
        self.folder = folder
        self.table = PARTITIONS.to_frame()
        self._manifest = {
            "schema_version": SCHEMA_VERSION,
            "kind": KIND,
            "status": "running",
            "started": _now(),
            "process": {"pid": os.getpid(), "host": platform.node()},
            "metrics": {},
            **manifest,
        }
        write_json(self._manifest, folder / MANIFEST)

    def row(self, row: dict[str, Any]) -> None:
        """Add a row of the columns `schemas.PARTITIONS`; the table on disk has it from then on."""
        self.table = pl.concat([self.table, pl.DataFrame([row], schema=PARTITIONS)])
        write_table(self.table, self.folder / TABLE)

    def close(self, status: str, manifest: dict[str, Any]) -> dict[str, Any]:
        """Close the folder as ``complete``, ``interrupted`` or ``failed`` and return what ``run.json`` says."""
        self._manifest |= {**manifest, "status": status, "finished": _now()}
        write_json(self._manifest, self.folder / MANIFEST)
        return self._manifest


def _claim(folder: Path, *, overwrite: bool) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        occupied = any(folder.iterdir())
    except OSError as error:
        raise ResultError(f"cannot write to {folder}: {error.strerror}; choose another --out") from error
    if not occupied:
        return
    if not (folder / MANIFEST).exists() or open_run(folder).manifest.get("kind") != KIND:
        raise ResultError(f"{folder} holds files that are not a baseline of omnieval; choose another --out")
    if not overwrite:
        raise ResultError(f"{folder} holds a baseline already; choose another --out or pass --overwrite")
    for name in (MANIFEST, TABLE):
        (folder / name).unlink(missing_ok=True)


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="seconds")
