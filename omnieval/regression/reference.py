"""The reference file: what replays are expected to come to, as TOML that people read, edit and commit.

schema_version = 2

[[case]]
name = "synthetic-night-hog"
source = "synthetic:night"          # paths are relative to the working directory
cut = { start = 0, stride = 1 }
skipped = ["0007.png"]              # images left out because they are not fit for use; optional
trace = "synthetic/synthetic-night-hog.parquet"    # beside the reference; optional
mapper = "leader"                   # as on the command line; without it the default
descriptor = "hog"

[case.parameters]                   # only what differs from the defaults, so that the defaults are guarded too
radius = 2.5

[case.expected]
nodes = { value = 9, min = 8, max = 10 }
silhouette = { value = 0.31, tolerance = 0.02 }
share_forced = { value = 0.04, tolerance = 0.05, better = "lower" }

[case.made]                         # how the expected values came about; written by --update, never judged
date = "2026-01-31T12:00:00+00:00"
code = "..."
mapper_code = "..."
descriptor_code = "..."
dataset_fingerprint = "..."

What people write into it, comments and order included, survives an update.
"""

from __future__ import annotations

import dataclasses
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path, PurePosixPath
from typing import Annotated, Any, Literal

import tomlkit
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, JsonValue, ValidationError, model_validator
from tomlkit.exceptions import TOMLKitError
from tomlkit.items import AoT, Table

from omnieval.config import Config, Setting, resolve
from omnieval.errors import ConfigError, RegressionError
from omnieval.material import Cut
from omnieval.metrics.catalogue import BY_NAME, METRICS
from omnieval.results.atomic import replacing
from omnieval.wording import did_you_mean

SCHEMA_VERSION = 2
_LOCKED = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

_NEW = f"""\
# Written by `omnieval check --update`. Tolerances and comments may be edited: an update keeps them.

schema_version = {SCHEMA_VERSION}
"""
_SECTIONS = ("parameters", "expected", "made", "versions")
"""Tables of a case that have a heading of their own."""


class Guard(BaseModel):
    """The expected value of a metric, and by how much a replay may be worse."""

    model_config = _LOCKED

    value: float
    tolerance: float = Field(ge=0)
    better: Literal["higher", "lower"] = "higher"


class NodeRange(BaseModel):
    """The expected number of nodes, and the range it must stay in, both ends included."""

    model_config = _LOCKED

    value: int
    min: int
    max: int

    @model_validator(mode="after")
    def _ordered(self) -> NodeRange:
        if not self.min <= self.value <= self.max:
            raise ValueError(f"min {self.min} <= value {self.value} <= max {self.max} does not hold")
        return self


def _sound(cut: Cut) -> Cut:
    if cut.start < 0 or cut.stride < 1 or (cut.limit is not None and cut.limit < 1):
        raise ValueError("start is at least 0, stride and limit are at least 1")
    return cut


class Made(BaseModel):
    """How the expected values came about."""

    model_config = _LOCKED

    date: str
    code: str
    mapper_code: str = ""
    descriptor_code: str = ""
    dataset_fingerprint: str
    versions: dict[str, str]
    parameters: dict[str, JsonValue]


class Case(BaseModel):
    """One guarded replay.

    Attributes
    ----------
    name
        Unique within its reference.
    source
        Source as on the command line; paths are relative to the working directory.
    cut
        Which of its frames.
    skipped
        Images that were left out because they are not fit for use; None if nobody asked for that.
    trace
        File of the decision trace, relative to the reference; None if there is none.
    mapper, descriptor
        Components as on the command line; None for the defaults.
    parameters
        Parameters that are set, by name; all others have the defaults of the code that is checked.
    nodes
        Expected number of nodes.
    guards
        Expected metrics by name.
    made
        How this was made; None if it was written by hand.
    """

    model_config = _LOCKED

    name: str = Field(min_length=1)
    source: str
    cut: Annotated[Cut, AfterValidator(_sound)] = Cut()
    skipped: tuple[str, ...] | None = None
    trace: str | None = None
    mapper: str | None = None
    descriptor: str | None = None
    parameters: dict[str, JsonValue] = Field(default_factory=dict)
    nodes: NodeRange
    guards: dict[str, Guard]
    made: Made | None = None

    def config(self) -> Config:
        """Return the configuration to replay with.

        Raises
        ------
        ConfigError
            If there is no such component, or a parameter is unknown or invalid.
        """
        settings = [Setting(name, value, f"case {self.name}") for name, value in self.parameters.items()]
        return resolve(settings, mapper=self.mapper, descriptor=self.descriptor)


def read_reference(path: Path, *, may_be_empty: bool = False) -> tuple[Case, ...]:
    """Read the cases of a reference file.

    Raises
    ------
    RegressionError
        If there is no such file, or it holds no case and must: what guards nothing must not pass.
    ConfigError
        If it is not a reference of this version.
    """
    try:
        content = tomllib.loads(path.read_text("utf-8"))
    except FileNotFoundError as error:
        raise RegressionError(f"there is no reference {path}; make it with --update") from error
    except (OSError, ValueError, RecursionError) as error:
        raise ConfigError(f"cannot read reference {path}: {error}") from error
    if content.get("schema_version") != SCHEMA_VERSION:
        raise ConfigError(
            f"{path} has schema version {content.get('schema_version')}, this omnieval reads {SCHEMA_VERSION}; "
            "remove it and make it again with --update"
        )
    found = content.get("case", [])
    if not found and not may_be_empty:
        raise RegressionError(f"{path} has no [[case]], so it guards nothing; add one with --update")
    if not isinstance(found, list) or not all(isinstance(table, dict) for table in found):
        raise ConfigError(f"{path}: write every case as a [[case]] table")
    cases = tuple(_case(table, path) for table in found)
    names = [case.name for case in cases]
    if repeated := sorted({name for name in names if names.count(name) > 1}):
        raise ConfigError(f"{path} has more than one case {repeated[0]}; give each a name of its own")
    return cases


def write_reference(cases: Sequence[Case], path: Path) -> None:
    """Write cases into a reference file, in place of those of the same names; what else is in it stays as it is.

    Raises
    ------
    ConfigError
        If the file that is there is no reference.
    ResultError
        If it cannot be written.
    """
    before = {case.name: _plain(case) for case in read_reference(path, may_be_empty=True)} if path.exists() else {}
    try:
        document = tomlkit.parse(path.read_text("utf-8") if path.exists() else _NEW)
    except TOMLKitError as error:
        raise ConfigError(f"cannot read reference {path}: {error}") from error
    tables = document.get("case", [])
    if before and not isinstance(tables, AoT):
        raise ConfigError(f"{path}: write every case as a [[case]] table")
    places = {str(table["name"]): table for table in tables}
    for case in cases:
        if case.name in places:
            _renew(places[case.name], before[case.name], _plain(case))
    added = [tomlkit.dumps({"case": AoT([_table(_plain(case))])}) for case in cases if case.name not in places]
    parts = [tomlkit.dumps(document), *added]
    with replacing(path) as temporary:
        temporary.write_text("\n".join(part.rstrip("\n") + "\n" for part in parts), "utf-8")


def sayable(value: Any) -> bool:
    """Whether TOML has words for a plain value: it has none for None."""
    inside = value.values() if isinstance(value, Mapping) else value if isinstance(value, list) else ()
    return value is not None and all(map(sayable, inside))


def _plain(case: Case) -> dict[str, Any]:
    """Return a case as it stands in the file."""
    plain = case.model_dump(exclude_none=True, exclude={"nodes", "guards", "made"})
    plain["cut"] = {name: value for name, value in dataclasses.asdict(case.cut).items() if value is not None}
    if case.skipped is not None:
        plain["skipped"] = list(case.skipped)
    if case.trace is not None:
        plain["trace"] = PurePosixPath(case.trace).as_posix()
    guards = {name: guard.model_dump(exclude_defaults=True) for name, guard in case.guards.items()}
    plain["expected"] = {"nodes": case.nodes.model_dump(), **guards}
    return plain | ({} if case.made is None else {"made": case.made.model_dump()})


def _table(content: Mapping[str, Any]) -> Table:
    """Return a table: the sections of a case as tables of their own, all other tables in one line."""
    table = tomlkit.table()
    for name, value in content.items():
        table.add(name, _item(name, value))
    return table


def _item(name: str, value: Any) -> Any:
    return _table(value) if name in _SECTIONS and isinstance(value, Mapping) else tomlkit.value(_in_one_line(value))


def _in_one_line(value: Any) -> str:
    if isinstance(value, Mapping):
        inside = ", ".join(f"{tomlkit.key(key).as_string()} = {_in_one_line(one)}" for key, one in value.items())
        return f"{{ {inside} }}"
    if isinstance(value, list):
        return f"[{', '.join(map(_in_one_line, value))}]"
    text: str = tomlkit.item(value).as_string()
    return text


def _renew(table: Any, before: Mapping[str, Any], after: Mapping[str, Any]) -> None:
    """Change in a table only what is not as it was, so that all else in it stays as people wrote it."""
    for name in before:
        if name not in after:
            del table[name]
    for name, value in after.items():
        known = before.get(name)
        if isinstance(value, Mapping) and isinstance(known, Mapping) and name in table:
            _renew(table[name], known, value)
        elif known != value:
            table[name] = _item(name, value)


def _case(table: dict[str, Any], path: Path) -> Case:
    expected = table.pop("expected", {})
    if not isinstance(expected, dict):
        raise ConfigError(f"{path}: expected of case {table.get('name')} is no table")
    guards = {name: guard for name, guard in expected.items() if name != "nodes"}
    for name in guards:
        if name not in METRICS:
            hint = did_you_mean(name, METRICS)
            raise ConfigError(f"{path}: case {table.get('name')} guards the unknown metric {name!r}; {hint}")
    # Which way is better need not be said.
    guards = {
        name: {"better": BY_NAME[name].better or "higher", **guard} if isinstance(guard, dict) else guard
        for name, guard in guards.items()
    }
    nodes = {"nodes": expected["nodes"]} if "nodes" in expected else {}
    try:
        return Case.model_validate({**table, **nodes, "guards": guards})
    except ValidationError as error:
        fault = error.errors()[0]
        where = ".".join(str(part) for part in fault["loc"])
        raise ConfigError(f"{path}: case {table.get('name')}: {where}: {fault['msg']}") from error
