"""Writes ``commands.md`` and ``parameters.md`` from the command line itself: ``python docs/reference.py``."""

from __future__ import annotations

import contextlib
import io
import json
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from typer.main import get_command

from omnieval.cli import app, main

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
later settings win over earlier ones, and all over a `--preset`. What the choices mean, and why the defaults are what
they are, stands in [method.md](method.md).

| name | default | range | meaning |
|---|---|---|---|
"""


def commands() -> str:
    """Return the text of ``commands.md``."""
    root: Any = get_command(app)
    sections = [_section(words, command) for words, command in _leaves(root, "omnieval")]
    return "\n".join([_COMMANDS, *sections])


def parameters() -> str:
    """Return the text of ``parameters.md``."""
    rows = [
        f"| `{name}` | {_cell(facts['default'])} | {_escaped(facts['range'])} | {_escaped(facts['meaning'])} |"
        for name, facts in _listed().items()
    ]
    return _PARAMETERS + "\n".join(rows) + "\n"


def _listed() -> dict[str, dict[str, Any]]:
    """Return what ``omnieval parameters --json`` lists."""
    with contextlib.redirect_stdout(io.StringIO()) as said, contextlib.suppress(SystemExit):
        main(["parameters", "--json"])
    listed: dict[str, dict[str, Any]] = json.loads(said.getvalue())["parameters"]
    return listed


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
        parts.append("\n".join(["| argument or option | meaning |", "|---|---|", *_rows([*arguments, *options])]))
    return "\n\n".join(parts) + "\n"


def _rows(params: Iterable[Any]) -> Iterator[str]:
    for one in params:
        named = one.opts[0].startswith("-")
        value = "" if not named or one.is_flag else f" {one.metavar or one.name.strip('_').upper()}"
        name = f"{one.opts[0]}{value}" if named else _argument(one)
        default = "" if one.default is None or one.default is False else f" Default: `{one.default}`."
        required = " Required." if named and one.required else ""
        yield f"| `{_escaped(name)}` | {_escaped(one.help)}{default}{required} |"


def _argument(argument: Any) -> str:
    dots = "..." if argument.nargs == -1 else ""
    return f"{argument.metavar}{dots}" if argument.required else f"[{argument.metavar}{dots}]"


def _cell(value: object) -> str:
    return "none" if value is None else f"`{value}`"


def _escaped(text: str) -> str:
    return text.replace("|", "\\|").replace("<", "&lt;") if "`" not in text else text.replace("|", "\\|")


if __name__ == "__main__":
    (HERE / "commands.md").write_text(commands(), "utf-8")
    (HERE / "parameters.md").write_text(parameters(), "utf-8")
