"""The folder of a baseline: ``runs/<sequence>-<descriptor>-<method>[-<n>]/``.

``run.json`` says what was clustered and how, its status and timings; ``baseline.parquet`` has one row a partition,
written as they come, so that a killed baseline leaves a readable prefix.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import polars as pl

from omnieval.results.atomic import write_table
from omnieval.results.content import content_hash
from omnieval.results.inside import report_inside
from omnieval.results.manifest import Manifest
from omnieval.results.schemas import PARTITIONS

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
        Whether an earlier baseline in `folder` may be replaced. Only files that a baseline, or the report in it,
        wrote are removed.

    Raises
    ------
    ResultError
        If the folder holds something already or cannot be written.
    """

    def __init__(self, folder: Path, manifest: dict[str, Any], *, overwrite: bool = False) -> None:
        self.folder = folder
        self.table = PARTITIONS.to_frame()
        self._manifest = Manifest(folder, KIND, manifest, files=[TABLE, *report_inside(folder)], overwrite=overwrite)

    def row(self, row: dict[str, Any]) -> None:
        """Add a row of the columns `schemas.PARTITIONS`; the table on disk has it from then on."""
        self.table = pl.concat([self.table, pl.DataFrame([row], schema=PARTITIONS)])
        write_table(self.table, self.folder / TABLE)

    def close(self, status: str, manifest: dict[str, Any]) -> dict[str, Any]:
        """Close the folder as ``complete``, ``interrupted`` or ``failed`` and return what ``run.json`` says."""
        try:
            self._manifest.close(status, {**manifest, "content_hashes": {"baseline": content_hash(self.table)}})
        finally:
            self._manifest.release()
        return self._manifest.content
