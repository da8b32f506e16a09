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

import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path, PurePosixPath
from typing import Any, Literal

import tomlkit
from pydantic import BaseModel, ConfigDict, Field, StrictFloat, StrictInt, StrictStr, ValidationError, model_validator
from tomlkit.exceptions import TOMLKitError
from tomlkit.items import AoT, Table

from omnieval.config import Config, Setting, resolve
from omnieval.errors import ConfigError, RegressionError
from omnieval.metrics.evaluation import METRICS
from omnieval.results.atomic import replacing
from omnieval.wording import did_you_mean

SCHEMA_VERSION = 2
_HEADER = "Written by `omnieval check --update`. Tolerances and comments may be edited: an update keeps them."
_LOCKED = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

_SECTIONS = ("parameters", "expected", "made", "versions")
"""Tables of a case that have a heading of their own."""

Value = StrictStr | StrictInt | StrictFloat


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


class Cut(BaseModel):
    """Which frames of the sequence are replayed; see `Sequence.cut`."""

    model_config = _LOCKED

    start: int = Field(0, ge=0)
    stride: int = Field(1, ge=1)
    limit: int | None = Field(None, ge=1)


class Made(BaseModel):
    """How the expected values came about."""

    model_config = _LOCKED

    date: str
    code: str
    mapper_code: str = ""
    descriptor_code: str = ""
    dataset_fingerprint: str
    versions: dict[str, str]
    parameters: dict[str, Value]


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
    cut: Cut = Cut()
    skipped: tuple[str, ...] | None = None
    trace: str | None = None
    mapper: str | None = None
    descriptor: str | None = None
    parameters: dict[str, Value] = Field(default_factory=dict)
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


def read_reference(path: Path) -> tuple[Case, ...]:
    """Read the cases of a reference file.

    Raises
    ------
    RegressionError
        If there is no such file, or it holds no case: what guards nothing must not pass.
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
    found = content.get("case")
    if not found:
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
        If the file that is there is no TOML.
    ResultError
        If it cannot be written.
    """
    try:
        document = tomlkit.parse(path.read_text("utf-8")) if path.exists() else _new_document()
    except (OSError, ValueError, TOMLKitError) as error:
        raise ConfigError(f"cannot read reference {path}: {error}") from error
    tables = document.setdefault("case", tomlkit.aot())
    assert isinstance(tables, AoT)
    known = {str(table["name"]): table for table in tables}
    for case in cases:
        if case.name in known:
            _renew(known[case.name], case)
        else:
            tables.append(_table(_plain(case)))
    with replacing(path) as temporary:
        temporary.write_text(tomlkit.dumps(document), "utf-8")


def parameters_of(config: Config) -> dict[str, Value]:
    """Return what a replay depends on besides its images: components, and parameters that have a value, by name.

    A component is called by what finds it again, or by its name if nothing does.
    """
    chosen = {kind: component.spec or component.name for kind, component in _components(config).items()}
    return {**chosen, **{name: value for name, value in config.settings.items() if value is not None}}


def _components(config: Config) -> dict[str, Any]:
    return {"mapper": config.mapper, "descriptor": config.descriptor}


def _new_document() -> tomlkit.TOMLDocument:
    document = tomlkit.document()
    document.add(tomlkit.comment(_HEADER))
    document.add(tomlkit.nl())
    document.add("schema_version", tomlkit.item(SCHEMA_VERSION))
    document.add(tomlkit.nl())
    return document


def _plain(case: Case) -> dict[str, Any]:
    """Return a case as it stands in the file."""
    plain = case.model_dump(exclude_none=True, exclude={"nodes", "guards"})
    if case.trace is not None:
        plain["trace"] = PurePosixPath(case.trace).as_posix()
    guards = {name: guard.model_dump(exclude_defaults=True) for name, guard in case.guards.items()}
    made = plain.pop("made", None)
    plain["expected"] = {"nodes": case.nodes.model_dump(), **guards}
    return plain if made is None else {**plain, "made": made}


def _table(content: Mapping[str, Any]) -> Table:
    """Return a table: short tables within it in one line, the sections of a case as tables of their own."""
    table = tomlkit.table()
    for name, value in content.items():
        if name in _SECTIONS:
            table.add(name, _table(value))
        elif isinstance(value, Mapping):
            inside = ", ".join(f"{key} = {tomlkit.item(one).as_string()}" for key, one in value.items())
            table.add(name, tomlkit.value(f"{{ {inside} }}"))
        else:
            table.add(name, list(value) if isinstance(value, tuple) else value)
    return table


def _renew(table: Any, case: Case) -> None:
    """Bring a table up to a case, key by key, so that comments and order stay."""
    _update(table, _table(_plain(case)), drop=False)
    _update(table["expected"], _table(_plain(case))["expected"], drop=True)


def _update(old: Any, new: Any, *, drop: bool) -> None:
    for name, value in new.items():
        if isinstance(value, Mapping) and isinstance(old.get(name), Mapping):
            _update(old[name], value, drop=False)
        elif old.get(name) != value:
            old[name] = value
    if drop:
        for name in [name for name in old if name not in new]:
            del old[name]


def _case(table: dict[str, Any], path: Path) -> Case:
    expected = table.pop("expected", {})
    if not isinstance(expected, dict):
        raise ConfigError(f"{path}: expected of case {table.get('name')} is no table")
    guards = {name: guard for name, guard in expected.items() if name != "nodes"}
    for name in guards:
        if name not in METRICS:
            hint = did_you_mean(name, METRICS)
            raise ConfigError(f"{path}: case {table.get('name')} guards the unknown metric {name!r}; {hint}")
    nodes = {"nodes": expected["nodes"]} if "nodes" in expected else {}
    try:
        return Case.model_validate({**table, **nodes, "guards": guards})
    except ValidationError as error:
        fault = error.errors()[0]
        where = ".".join(str(part) for part in fault["loc"])
        raise ConfigError(f"{path}: case {table.get('name')}: {where}: {fault['msg']}") from error
