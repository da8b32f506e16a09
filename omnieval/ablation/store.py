"""The folder of an ablation, safe to append to and to resume.

run.json             grid, dataset fingerprints, code, versions, status
parts/00012.json     the rows of job 12 (one; of an interval one a piece) and its components, there as soon as it has
                     ended, always whole
steps/00012.parquet  its decision trace, if asked for
ablation.parquet     all rows in the order of the grid, when all jobs have ended
ablation.csv         the same, if asked for
benchmark.md         the page, of the benchmark
best/                the run folder of the best run, if asked for
descriptors/         those that the cache cannot keep, while it runs
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import polars as pl

from omnieval.config import flattened
from omnieval.descriptors.stored import OWN
from omnieval.errors import ResultError
from omnieval.results.atomic import replacing, write_json, write_table
from omnieval.results.compare import differing
from omnieval.results.folder import ResultFolder, report_inside, results_inside
from omnieval.results.manifest import MANIFEST, expanded, read_manifest
from omnieval.results.run_folder import FILES
from omnieval.results.run_folder import KIND as RUN
from omnieval.results.schemas import ablation_schema

KIND = "ablation"
TABLE = "ablation.parquet"
CSV = "ablation.csv"
PAGE = "benchmark.md"
_PARTS = "parts"
_ALWAYS = {"job", "dataset", "source", "mapper", "descriptor", "seconds", "error"}
"""Columns that every row has, whether its job succeeded or failed."""
_STEPS = "steps"
_DESCRIPTORS = "descriptors"
BEST = "best"


class Store:
    """Stores rows, which arrive in any order.

    Parameters
    ----------
    folder
        The folder of the ablation; need not exist yet.
    """

    def __init__(self, folder: str | Path) -> None:
        self.folder = expanded(folder)

    def open(self, content: dict[str, Any] | None, *, overwrite: bool = False, resume: bool = False) -> ResultFolder:
        """Return the folder to be written; of an earlier ablation all is removed that it, or the report on it, wrote.

        Parameters
        ----------
        content
            What is known at the start; see `ResultFolder`, as for errors.
        overwrite
            Replace an earlier ablation.
        resume
            Keep its parts and continue with it; `check` tells whether it is the same.
        """
        files = [TABLE, CSV, PAGE]
        if not resume:
            best = results_inside(self.folder, BEST, RUN, (*FILES, *report_inside(self.folder / BEST)))
            files += [f"{_PARTS}/*.json", f"{_STEPS}/*.parquet", f"{_DESCRIPTORS}/*/{OWN}*", *best]
        return ResultFolder(self.folder, KIND, content, files=files, overwrite=overwrite, resume=resume)

    def check(self, content: Mapping[str, Any]) -> None:
        """See that the ablation in the folder is the one to continue with, as far as `content` tells.

        Raises
        ------
        ResultError
            If there is none, or anything differs; the message names it.
        """
        earlier = read_manifest(self.folder, KIND)
        before = dict(flattened({name: earlier[name] for name in content if name in earlier}))
        now = dict(flattened({name: value for name, value in content.items() if name in earlier}))
        if changed := differing(before, now):
            words = ", ".join(f"{name} was {_word(one)}, now {_word(other)}" for name, (one, other) in changed.items())
            raise ResultError(f"{self.folder} cannot be resumed: {words}; choose another --out or pass --overwrite")

    def exists(self) -> bool:
        """Whether the folder holds a folder of results."""
        try:
            return (self.folder / MANIFEST).exists()
        except OSError:  # such as a name that is too long
            return False

    def add(self, job: int, rows: Sequence[dict[str, Any]], config: Mapping[str, Any]) -> None:
        """Keep the rows of a job and its components (`Job.about`); they are on disk when this returns."""
        write_json({"job": job, "config": config, "rows": rows}, self.make(_PARTS) / f"{job:05d}.json")

    def parts(self) -> dict[int, list[dict[str, Any]]]:
        """Return the rows so far by their job; damaged ones count as missing."""
        found = ((path, _read(path)) for path in sorted((self.folder / _PARTS).glob("*.json")))
        return {int(path.stem): part["rows"] for path, part in found if part}

    def config(self, job: int) -> dict[str, Any] | None:
        """Return the components of a job; None if they are lost."""
        part = _read(self.folder / _PARTS / f"{job:05d}.json")
        return None if part is None else part["config"]

    def rows(self) -> list[dict[str, Any]]:
        """Return the rows so far."""
        return [row for rows in self.parts().values() for row in rows]

    def steps_file(self, job: int) -> Path:
        """Where the decision trace of a job is kept."""
        return self.make(_STEPS) / f"{job:05d}.parquet"

    def descriptors(self, number: int) -> Path:
        """Return a folder for descriptors that the cache cannot keep; it need not exist."""
        return self.folder / _DESCRIPTORS / str(number)

    def drop_descriptors(self) -> None:
        """Remove all descriptors: they are large, and come from the cache when the ablation is resumed."""
        shutil.rmtree(self.folder / _DESCRIPTORS, ignore_errors=True)

    def write(self, table: pl.DataFrame, *, csv: bool) -> None:
        """Write the final table."""
        write_table(table, self.folder / TABLE)
        if csv:
            with replacing(self.folder / CSV) as temporary:
                table.write_csv(temporary)

    def make(self, name: str) -> Path:
        """Create a folder in the folder of the ablation and return it."""
        try:
            (self.folder / name).mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise ResultError(f"cannot write {self.folder / name}: {error.strerror}; choose another --out") from error
        return self.folder / name


def rows_table(rows: Iterable[Mapping[str, Any]], types: Mapping[str, str]) -> pl.DataFrame:
    """Return rows as a table in the order of the grid; what a row lacks is null.

    `types` are those of the parameters, in words (`schemas.ablation_schema`).
    """
    schema = ablation_schema(types)
    texts = [name for name, kind in types.items() if kind == "text"]
    whole = [dict.fromkeys(schema) | dict(row) | {name: as_text(row.get(name)) for name in texts} for row in rows]
    return pl.DataFrame(whole, schema=schema).sort("job", "exact_from")


def as_text(value: Any) -> str | None:
    """Return the value of a parameter as a column of text holds it."""
    return value if value is None or isinstance(value, str) else json.dumps(value)


def _read(path: Path) -> dict[str, Any] | None:
    try:
        part = json.loads(path.read_text("utf-8"))
    except (OSError, ValueError):
        return None
    if not isinstance(part, dict) or path.stem != str(part.get("job")).zfill(5):
        return None
    rows = part.get("rows")
    if not isinstance(rows, list) or not all(isinstance(row, dict) and row.keys() >= _ALWAYS for row in rows):
        return None
    return part if rows and isinstance(part.get("config"), dict) else None


def _word(value: Any) -> str:
    return "absent" if value is None else json.dumps(value)
