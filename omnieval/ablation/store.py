"""The folder of an ablation, safe to append to and to resume.

run.json                 grid, dataset fingerprints, code, versions, status
parts/00012-KEY.json     the rows of job 12 (one; of an interval one a piece) and its components, there as soon as it
                         has ended, always whole; the key says what determines the rows (`Job.key`), the number is the
                         job's place in the grid, which is another one when the grid has grown
steps/00012-KEY.parquet  its decision trace, if asked for
ablation.parquet         all rows in the order of the grid, when all jobs have ended
ablation.csv             the same, if asked for
benchmark.md             the page, of the benchmark
best/                    the run folder of the best run, if asked for
descriptors/             those that the cache cannot keep, while it runs
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import polars as pl

from omnieval.ablation.growth import lost
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
FINGERPRINTS = "dataset_fingerprints"
"""Entry of ``run.json``: the fingerprint of each sequence by its source."""
_PARTS = "parts"
_ALWAYS = {"job", "dataset", "source", "mapper", "descriptor", "seconds", "error"}
"""Columns that every row has, whether its job succeeded or failed."""
_STEPS = "steps"
_DESCRIPTORS = "descriptors"
BEST = "best"


@dataclass(frozen=True)
class Part:
    """What is kept of a job.

    Attributes
    ----------
    number, key
        Its place in the grid, and what determines it (`Job.key`).
    config
        Its components (`Job.about`).
    rows
        Its rows, at least one.
    """

    number: int
    key: str
    config: dict[str, Any]
    rows: list[dict[str, Any]]

    @property
    def name(self) -> str:
        """What its files are called."""
        return f"{self.number:05d}-{self.key}"

    @property
    def error(self) -> str | None:
        """Why it failed, None if it did not."""
        return next((row["error"] for row in self.rows if row["error"] is not None), None)


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
            files += [f"{_PARTS}/*.json", f"{_STEPS}/*.parquet", f"{_DESCRIPTORS}/*/{OWN}*", *self.best_files()]
        return ResultFolder(self.folder, KIND, content, files=files, overwrite=overwrite, resume=resume)

    def best_files(self) -> list[str]:
        """Return names and patterns of all that the best run, and the report on it, wrote."""
        return results_inside(self.folder, BEST, RUN, (*FILES, *report_inside(self.folder / BEST)))

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
        self._refuse(differing(before, now))

    def check_growth(self, grid: Mapping[str, Any], shard: Mapping[str, Any] | None, keys: Iterable[str]) -> None:
        """See that every row in the folder is one of the ablation that is to go on; that may be a larger one.

        Parameters
        ----------
        grid, shard
            What determines its jobs (`Plan`), for the message.
        keys
            All its jobs (`Job.key`).

        Raises
        ------
        ResultError
            If a row is of no job; the message says which values, sources or components are missing.
        """
        parts = self.parts()
        if foreign := sorted(parts[key].number for key in parts.keys() - set(keys)):
            earlier = read_manifest(self.folder, KIND)
            rows = {"jobs": (f"{len(foreign)} more, such as job {foreign[0]}", None)}
            words = lost(earlier["grid"], grid)
            if earlier.get("shard") and earlier["shard"] != shard:
                words["shard"] = _shard(earlier["shard"]), _shard(shard)
            self._refuse(words or rows)

    def check_fingerprints(self, prints: Mapping[str, str]) -> None:
        """See that the images of the sequences that both have are those that its rows are of.

        Raises
        ------
        ResultError
            If some have changed.
        """
        before = read_manifest(self.folder, KIND).get(FINGERPRINTS, {})
        shared = before.keys() & prints.keys()
        changed = differing({name: before[name] for name in shared}, {name: prints[name] for name in shared})
        self._refuse({f"{FINGERPRINTS}.{name}": both for name, both in sorted(changed.items())})

    def _refuse(self, changed: Mapping[str, tuple[Any, Any]]) -> None:
        if changed:
            words = ", ".join(f"{name} was {_word(one)}, now {_word(other)}" for name, (one, other) in changed.items())
            raise ResultError(f"{self.folder} cannot be resumed: {words}; choose another --out or pass --overwrite")

    def exists(self) -> bool:
        """Whether the folder holds a folder of results."""
        try:
            return (self.folder / MANIFEST).exists()
        except OSError:  # such as a name that is too long
            return False

    def add(self, part: Part) -> None:
        """Keep the rows of a job; they are on disk when this returns."""
        content = {"job": part.number, "key": part.key, "config": part.config, "rows": part.rows}
        write_json(content, self.make(_PARTS) / f"{part.name}.json")

    def parts(self) -> dict[str, Part]:
        """Return the parts so far by their key; damaged ones count as missing."""
        return {part.key: part for _, part in self._found()}

    def part(self, job: int) -> Part | None:
        """Return the part of a job by its number; None if it is lost."""
        return next((part for _, part in self._found(f"{job:05d}-*")), None)

    def rows(self) -> list[dict[str, Any]]:
        """Return the rows so far."""
        return [row for part in self.parts().values() for row in part.rows]

    def renumber(self, numbers: Mapping[str, int]) -> None:
        """Give every part the number that its job has now; whenever this is stopped, no part is lost.

        Parameters
        ----------
        numbers
            Place in the grid by key.
        """
        for file, part in list(self._found()):
            number = numbers[part.key]
            if number == part.number:
                continue
            moved = Part(number, part.key, part.config, [{**row, "job": number} for row in part.rows])
            if (trace := self.steps(part)) is not None:
                trace.replace(self.steps_file(moved.name))
            self.add(moved)
            file.unlink(missing_ok=True)

    def steps(self, part: Part) -> Path | None:
        """Return the file of a part's decision trace; None if it was not kept."""
        return next((self.folder / _STEPS).glob(f"*-{part.key}.parquet"), None)

    def _found(self, name: str = "*") -> Iterator[tuple[Path, Part]]:
        for path in sorted((self.folder / _PARTS).glob(f"{name}.json")):
            part = _read(path)
            if part:
                yield path, part

    def steps_file(self, name: str) -> Path:
        """Where the decision trace of a job is kept, by the name of its part."""
        return self.make(_STEPS) / f"{name}.parquet"

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


def _read(path: Path) -> Part | None:
    try:
        content = json.loads(path.read_text("utf-8"))
    except (OSError, ValueError):
        return None
    if not isinstance(content, dict):
        return None
    number, key, config, rows = (content.get(name) for name in ("job", "key", "config", "rows"))
    if not (isinstance(number, int) and isinstance(key, str) and isinstance(config, dict)):
        return None
    if not rows or not isinstance(rows, list) or not all(_is_row(row) for row in rows):
        return None
    part = Part(number, key, config, rows)
    return part if path.stem == part.name else None


def _is_row(row: Any) -> bool:
    return isinstance(row, dict) and row.keys() >= _ALWAYS


def _shard(shard: Mapping[str, Any] | None) -> str | None:
    return f"{shard['number']}/{shard['of']}" if shard else None


def _word(value: Any) -> str:
    return "absent" if value is None else json.dumps(value)
