"""The reference file: what replays are expected to come to, as TOML that people read, edit and commit.

schema_version = 1

[[case]]
name = "synthetic-night-hog"
source = "synthetic:night"          # paths are relative to the working directory
cut = { start = 0, stride = 1 }
trace = "synthetic/synthetic-night-hog.parquet"    # beside the reference; optional

[case.parameters]                   # only what differs from the defaults, so that the defaults are guarded too
descriptor = "hog"

[case.expected]
nodes = { value = 9, min = 8, max = 10 }
silhouette = { value = 0.31, tolerance = 0.02 }
share_forced = { value = 0.04, tolerance = 0.05, better = "lower" }

[case.made]                         # how the expected values came about; written by --update, never judged
date = "2026-01-31T12:00:00+00:00"
code = "..."
dataset_fingerprint = "..."
"""

from __future__ import annotations

import json
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path, PurePosixPath
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, StrictFloat, StrictInt, StrictStr, ValidationError, model_validator

from omnieval.config import Config, Setting, resolve
from omnieval.errors import ConfigError, RegressionError
from omnieval.metrics.evaluation import METRICS
from omnieval.results.atomic import replacing
from omnieval.wording import did_you_mean

SCHEMA_VERSION = 1
_HEADER = "# Written by `omnieval check --update`. Tolerances may be edited: an update keeps them.\n"
_LOCKED = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

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
    trace
        File of the decision trace, relative to the reference; None if there is none.
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
    trace: str | None = None
    parameters: dict[str, Value] = Field(default_factory=dict)
    nodes: NodeRange
    guards: dict[str, Guard]
    made: Made | None = None

    def config(self) -> Config:
        """Return the configuration to replay with.

        Raises
        ------
        ConfigError
            If a parameter is unknown or invalid.
        """
        return resolve(Setting(name, value, f"case {self.name}") for name, value in self.parameters.items())


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


def write_reference(cases: tuple[Case, ...], path: Path) -> None:
    """Write a reference file; see `read_reference`.

    Raises
    ------
    ResultError
        If it cannot be written.
    """
    lines = [_HEADER, f"schema_version = {SCHEMA_VERSION}"]
    for case in cases:
        lines += ["", *_case_lines(case)]
    with replacing(path) as temporary:
        temporary.write_text("\n".join(lines) + "\n", "utf-8")


def parameters_of(configuration: Mapping[str, Any]) -> dict[str, Value]:
    """Return the parameters that a replay depends on, by name.

    Parameters
    ----------
    configuration
        `Config.model_dump`, as in ``run.json``. Sections of descriptors that are not used, and parameters
        without a value, are left out.
    """
    chosen = configuration["descriptor"]
    flat: dict[str, Value] = {"descriptor": chosen}
    for section, values in configuration.items():
        if section in {"mapper", "imaging", chosen}:
            prefix = "" if section == "mapper" else f"{section}."
            flat |= {prefix + name: value for name, value in values.items() if value is not None}
    return flat


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


def _case_lines(case: Case) -> Iterator[str]:
    yield "[[case]]"
    yield f"name = {_toml(case.name)}"
    yield f"source = {_toml(case.source)}"
    yield f"cut = {_toml(case.cut.model_dump(exclude_none=True))}"
    if case.trace is not None:
        yield f"trace = {_toml(PurePosixPath(case.trace).as_posix())}"
    yield from _table_lines("case.parameters", case.parameters)
    guards = {name: guard.model_dump(exclude_defaults=True) for name, guard in case.guards.items()}
    yield from _table_lines("case.expected", {"nodes": case.nodes.model_dump(), **guards})
    if case.made:
        yield from _table_lines("case.made", case.made.model_dump(exclude={"versions", "parameters"}))
        yield from _table_lines("case.made.versions", case.made.versions)
        yield from _table_lines("case.made.parameters", case.made.parameters)


def _table_lines(name: str, content: Mapping[str, Any]) -> Iterator[str]:
    yield ""
    yield f"[{name}]"
    for key, value in content.items():
        yield f"{_key(key)} = {_toml(value)}"


def _key(name: str) -> str:
    return name if name.replace("-", "").replace("_", "").isalnum() and name.isascii() else _toml(name)


def _toml(value: Any) -> str:
    """Return a text, number or flat table in TOML. JSON's texts and finite numbers are TOML's, but for DEL."""
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{_key(key)} = {_toml(one)}" for key, one in value.items()) + " }"
    return json.dumps(value, ensure_ascii=False, allow_nan=False).replace("\x7f", "\\u007f")
