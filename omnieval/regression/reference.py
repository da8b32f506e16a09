"""The reference file: the expected results of replays, as TOML that people read, edit and commit.

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
pair_f1 = { value = 0.22, interval = [0.18, 0.27] }    # fails when the whole interval of a replay is below this one

[case.made]                         # how the expected values came about; written by --update, never judged
date = "2026-01-31T12:00:00+00:00"
code = "..."
mapper_code = "..."
descriptor_code = "..."
dataset_fingerprint = "..."

[[localization]]
name = "night-in-cloudy"
map = "synthetic-cloudy-hog"        # the case whose map it is
query = "synthetic:night"           # what is looked for in it
within = 0.5                        # up to how many metres two images show the same place; optional

[localization.expected.levels]      # a table per strategy; without any, --update makes those of the default guards
"recall@1" = { value = 0.41, tolerance = 0.05 }

[localization.made]
date = "2026-01-31T12:00:00+00:00"
code = "..."
dataset_fingerprint = "..."         # of the query
map_digest = "..."

What people write into it, comments and order included, survives an update.
"""

from __future__ import annotations

import dataclasses
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path, PurePosixPath
from typing import Any, TypeVar

import tomlkit
from pydantic import BaseModel, ValidationError
from tomlkit.exceptions import TOMLKitError
from tomlkit.items import AoT, Table

from omnieval.errors import ConfigError, RegressionError
from omnieval.localization.measures import METRICS as OF_LOCALIZATION
from omnieval.localization.strategies import STRATEGIES, check_strategies
from omnieval.metrics.catalogue import BY_NAME, METRICS
from omnieval.regression.guarded import Case, Guard, LocalizationCase, better_of_localization
from omnieval.results.atomic import replacing
from omnieval.wording import did_you_mean

SCHEMA_VERSION = 2


_Model = TypeVar("_Model", bound=BaseModel)


_NEW = f"""\
# Written by `omnieval check --update`. Tolerances and comments may be edited: an update keeps them.

schema_version = {SCHEMA_VERSION}
"""


_SECTIONS = ("parameters", "expected", *STRATEGIES, "made", "versions")
"""Tables of a case that have a heading of their own."""


def read_reference(path: Path, *, may_be_empty: bool = False) -> tuple[Case, ...]:
    """Read the cases of a reference file.

    Raises
    ------
    RegressionError
        If there is no such file, or it holds no case and must: what guards nothing must not pass.
    ConfigError
        If it is not a reference of this version.
    """
    content = _content(path)
    if not content.get("case") and not may_be_empty:
        raise RegressionError(f"{path} has no [[case]], so it guards nothing; add one with --update")
    cases = tuple(_case(table, path) for table in _tables(content, "case", path))
    _refuse_repeated([case.name for case in cases], path)
    return cases


def read_localizations(path: Path, cases: Sequence[Case]) -> tuple[LocalizationCase, ...]:
    """Read the localisations of a reference file, which has these cases.

    Raises
    ------
    RegressionError
        If there is no such file.
    ConfigError
        If one is faulty, or names a map that no case makes.
    """
    found = tuple(_localization(table, path) for table in _tables(_content(path), "localization", path))
    names = [case.name for case in cases]
    _refuse_repeated([*names, *(one.name for one in found)], path)
    for one in found:
        if one.map not in names:
            hint = did_you_mean(one.map, names) if names else "there is no case"
            raise ConfigError(f"{path}: localization {one.name}: no case makes the map {one.map!r}; {hint}")
    return found


def write_reference(cases: Sequence[Case], path: Path, localizations: Sequence[LocalizationCase] = ()) -> None:
    """Write cases into a reference file, in place of those of the same names; what else is in it stays as it is.

    Parameters
    ----------
    cases
        Those to write; new ones come after all others.
    path
        The file.
    localizations
        Those to write; every one of them is there already.

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
    if localizations:
        there = {one.name: _plain_localization(one) for one in read_localizations(path, read_reference(path))}
        places_of = {str(table["name"]): table for table in document["localization"]}
        for one in localizations:
            _renew(places_of[one.name], there[one.name], _plain_localization(one))
            if "made" not in there[one.name]:
                places_of[one.name]["made"].add(tomlkit.nl())  # before the next heading
    added = [tomlkit.dumps({"case": AoT([_table(_plain(case))])}) for case in cases if case.name not in places]
    parts = [tomlkit.dumps(document), *added]
    with replacing(path) as temporary:
        temporary.write_text("\n".join(part.rstrip("\n") + "\n" for part in parts), "utf-8")


def sayable(value: Any) -> bool:
    """Whether TOML has words for a plain value: it has none for None."""
    inside = value.values() if isinstance(value, Mapping) else value if isinstance(value, list) else ()
    return value is not None and all(map(sayable, inside))


def _content(path: Path) -> dict[str, Any]:
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
    return content


def _tables(content: Mapping[str, Any], kind: str, path: Path) -> list[dict[str, Any]]:
    found = content.get(kind, [])
    if not isinstance(found, list) or not all(isinstance(table, dict) for table in found):
        raise ConfigError(f"{path}: write every {kind} as a [[{kind}]] table")
    return found


def _refuse_repeated(names: Sequence[str], path: Path) -> None:
    if repeated := sorted({name for name in names if names.count(name) > 1}):
        raise ConfigError(f"{path} has more than one case {repeated[0]}; give each a name of its own")


def _plain(case: Case) -> dict[str, Any]:
    """Return a case as it stands in the file."""
    plain = case.model_dump(exclude_none=True, exclude={"nodes", "guards", "made"})
    plain["cut"] = {name: value for name, value in dataclasses.asdict(case.cut).items() if value is not None}
    if case.skipped is not None:
        plain["skipped"] = list(case.skipped)
    if case.trace is not None:
        plain["trace"] = PurePosixPath(case.trace).as_posix()
    guards = {name: _plain_guard(guard) for name, guard in case.guards.items()}
    plain["expected"] = {"nodes": case.nodes.model_dump(), **guards}
    return plain | ({} if case.made is None else {"made": case.made.model_dump()})


def _plain_localization(case: LocalizationCase) -> dict[str, Any]:
    """Return a localisation as it stands in the file."""
    plain: dict[str, Any] = case.model_dump(include={"name", "map", "query", "within"})
    plain["cut"] = {name: value for name, value in dataclasses.asdict(case.cut).items() if value is not None}
    plain["expected"] = {
        strategy: {name: _plain_guard(guard) for name, guard in guards.items()}
        for strategy, guards in case.expected.items()
    }
    return plain | ({} if case.made is None else {"made": case.made.model_dump()})


def _plain_guard(guard: Guard) -> dict[str, Any]:
    plain = guard.model_dump(exclude_defaults=True)
    return plain | ({} if guard.interval is None else {"interval": list(guard.interval)})


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
        raise ConfigError(f"{path}: expected of case {table.get('name')} is not a table")
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
    return _validated(Case, {**table, **nodes, "guards": guards}, f"{path}: case {table.get('name')}")


def _localization(table: dict[str, Any], path: Path) -> LocalizationCase:
    where = f"{path}: localization {table.get('name')}"
    expected = table.pop("expected", {})
    if not isinstance(expected, dict) or not all(isinstance(guards, dict) for guards in expected.values()):
        raise ConfigError(f"{where}: write what is expected as [localization.expected.STRATEGY] tables")
    if expected:
        check_strategies(list(expected))
    for name in (name for guards in expected.values() for name in guards if name not in OF_LOCALIZATION):
        raise ConfigError(f"{where} guards the unknown metric {name!r}; {did_you_mean(name, OF_LOCALIZATION)}")
    guarded = {
        strategy: {
            name: {"better": better_of_localization(name), **guard} if isinstance(guard, dict) else guard
            for name, guard in guards.items()
        }
        for strategy, guards in expected.items()
    }
    return _validated(LocalizationCase, {**table, "expected": guarded}, where)


def _validated(model: type[_Model], content: Mapping[str, Any], where: str) -> _Model:
    try:
        return model.model_validate(content)
    except ValidationError as error:
        fault = error.errors()[0]
        part = ".".join(str(one) for one in fault["loc"])
        raise ConfigError(f"{where}: {part}: {fault['msg']}") from error
