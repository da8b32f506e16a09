"""Writes what pages say of declarations: ``python docs/reference.py``.

``commands.md`` and ``parameters.md`` come from the command line; in ``columns.md``, what mappers declare; in
``metrics.md``, the catalogue of metrics.
"""

from __future__ import annotations

import contextlib
import io
import json
import re
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

from typer.main import get_command

from omnieval.cli import app, main
from omnieval.components.names import BUILT_IN, find_class
from omnieval.mapping.interface import Method
from omnieval.metrics.catalogue import CATALOGUE

HERE = Path(__file__).parent
_MADE = "<!-- made by docs/reference.py -->"

_COMMANDS = f"""\
{_MADE}

# Commands

Data goes to stdout; progress and errors go to stderr. `--json` gives one object with a `schema_version`. Nothing is
overwritten without `--overwrite`, and then only what omnieval wrote itself. `--debug`, with any command, shows the
traceback of an error. `omnieval --install-completion` teaches your shell to complete commands and options with Tab.
`python -m omnieval` is the same as `omnieval`.

| exit code | meaning |
|---|---|
| 0 | ok |
| 1 | unexpected |
| 2 | usage or configuration; results that cannot be written or read |
| 3 | dataset invalid |
| 4 | regression failed |
| 5 | some jobs of an ablation failed |
| 130 | interrupted |
"""

_PARAMETERS = f"""\
{_MADE}

# Parameters

Set them with `--set NAME=VALUE`, in a TOML file given with `--config`, or as the axis of an ablation with `--vary`;
later settings win over earlier ones, and all over a `--preset`. A mapper's parameters are set by their bare names,
those of imaging and of a descriptor with its name before them (`imaging.rows`, `hog.bins`); a bare name does where
only one of the chosen components has it. The bare name of a parameter of another component is refused; with the
component's name before it (`leader.radius`) it is set for when that one is chosen. `omnieval parameters --mapper NAME
--descriptor NAME` lists those of components of your own. What the choices of `roman2020` and of the descriptors
mean, and why the defaults are what they are, stands in [method.md](method.md).
"""

_FROM, _TO = "<!-- made by docs/reference.py from here -->", "<!-- to here -->"


def commands() -> str:
    """Return the text of ``commands.md``."""
    root: Any = get_command(app)
    sections = [_section(words, command) for words, command in _leaves(root, "omnieval")]
    return "\n".join([_COMMANDS, *sections])


def parameters() -> str:
    """Return the text of ``parameters.md``."""
    listed = {mapper: _listed("--mapper", mapper) for mapper in BUILT_IN["mapper"]}
    default = next(iter(listed))
    sections = [(f"Mapper {mapper}", "", facts) for mapper, facts in listed.items()]
    sections.append(("Imaging", "imaging.", listed[default]))
    sections += [(f"Descriptor {name}", f"{name}.", listed[default]) for name in BUILT_IN["descriptor"]]
    return "\n".join([_PARAMETERS, *(_parameters(*section) for section in sections)])


def columns() -> str:
    """Return the text of ``columns.md``, with what mappers declare written anew."""
    return _renewed("columns", map(_declared, BUILT_IN["mapper"]))


def metrics() -> str:
    """Return the text of ``metrics.md``, with the catalogue written anew."""
    groups = dict.fromkeys(metric.group for metric in CATALOGUE)
    return _renewed("metrics", (_catalogued(group) for group in groups))


def _renewed(page: str, parts: Iterable[str]) -> str:
    """Return a page with other parts between the marks."""
    before, _, rest = (HERE / f"{page}.md").read_text("utf-8").partition(_FROM)
    return "\n".join([before + _FROM, "", *parts, _TO + rest.partition(_TO)[2]])


def _catalogued(group: str) -> str:
    """Return the metrics of a group."""
    rows = [
        (f"`{one.name}`", one.meaning, one.formula, one.better or "", f"{one.source}")
        for one in CATALOGUE
        if one.group == group
    ]
    return f"### {group.capitalize()}\n\n{_table(('metric', 'is', 'formula', 'better', 'source'), rows)}\n"


def _declared(mapper: str) -> str:
    """Return what a mapper declares: its gates, its columns and the names of its curves."""
    method = Method.of(find_class("mapper", mapper), mapper, {})
    heads = ("gate", "values", "threshold", "one of each", "asked of every loop closure")
    gates = [
        (f"`{gate.name}`", gate.value, gate.threshold, gate.of or "", "yes" if gate.closes else "")
        for gate in method.gates
    ]
    columns = [(f"`{column.name}`", column.type, column.unit, column.meaning) for column in method.columns]
    parts = [f"### {mapper}", _table(heads, gates)]
    parts.append(_table(("column", "type", "unit", "meaning"), columns) if columns else "It has no columns of its own.")
    if method.curves:
        parts.append(f"Similarity curves, which no table holds: {', '.join(method.curves)}.")
    return "\n\n".join(parts) + "\n"


def _parameters(heading: str, prefix: str, listed: dict[str, dict[str, Any]]) -> str:
    """Return the table of the parameters whose names are bare behind a prefix."""
    rows = [
        (f"`{name}`", _cell(facts["default"]), facts["range"], facts["meaning"])
        for name, facts in listed.items()
        if name.startswith(prefix) and "." not in name.removeprefix(prefix)
    ]
    return f"## {heading}\n\n{_table(('name', 'default', 'range', 'meaning'), rows)}\n"


def _listed(*options: str) -> dict[str, dict[str, Any]]:
    """Return what ``omnieval parameters --json`` lists."""
    with contextlib.redirect_stdout(io.StringIO()) as said, contextlib.suppress(SystemExit):
        main(["parameters", "--json", *options])
    listed: dict[str, dict[str, Any]] = json.loads(said.getvalue())["parameters"]
    return listed


def _table(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table of Markdown."""
    lines = [heads, ["---"] * len(heads), *(list(map(_escaped, row)) for row in rows)]
    return "\n".join(f"| {' | '.join(line)} |" if line[0] != "---" else f"|{'|'.join(line)}|" for line in lines)


def _leaves(command: Any, words: str) -> Iterator[tuple[str, Any]]:
    """Yield every command that does something, with the words that call it."""
    inner = getattr(command, "commands", None)
    if inner is None:
        yield words, command
        return
    for name, one in inner.items():
        yield from _leaves(one, f"{words} {name}")


def _section(words: str, command: Any) -> str:
    text, _, examples = command.help.partition("Examples:")
    lines = [line.strip() for line in examples.splitlines() if line.strip()]
    arguments = [one for one in command.params if not one.opts[0].startswith("-")]
    options = [one for one in command.params if one.opts[0].startswith("-")]
    usage = " ".join([words, *map(_argument, arguments), *(["[OPTIONS]"] if options else [])])
    parts = [f"## {words}", f"`{usage}`", text.strip(), "```sh\n" + "\n".join(lines) + "\n```"]
    if command.params:
        parts.append(_table(("argument or option", "meaning"), _rows([*arguments, *options])))
    return "\n\n".join(parts) + "\n"


def _rows(params: Iterable[Any]) -> Iterator[tuple[str, str]]:
    for one in params:
        named = one.opts[0].startswith("-")
        value = "" if not named or one.is_flag else f" {one.metavar or one.name.strip('_').upper()}"
        name = f"{one.opts[0]}{value}" if named else _argument(one)
        default = "" if one.default is None or one.default is False else f" Default: `{one.default}`."
        required = " Required." if named and one.required else ""
        yield f"`{name}`", f"{one.help}{default}{required}"


def _argument(argument: Any) -> str:
    dots = "..." if argument.nargs == -1 else ""
    return f"{argument.metavar}{dots}" if argument.required else f"[{argument.metavar}{dots}]"


def _cell(value: object) -> str:
    return "none" if value is None else f"`{value}`"


def _escaped(text: str) -> str:
    """Return a cell of a table: places such as ``runs/<map>`` as code, other signs as themselves."""
    text = text.replace("|", "\\|")
    if "`" not in text:
        text = re.sub(r"[^\s<]*<\w+>(?:[^\s.;,]*)", lambda found: f"`{found[0]}`", text)
    return re.sub(r"`[^`]*`|<", lambda found: "&lt;" if found[0] == "<" else found[0], text)


if __name__ == "__main__":
    for page in (columns, commands, metrics, parameters):
        (HERE / f"{page.__name__}.md").write_text(page(), "utf-8")
