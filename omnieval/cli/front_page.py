"""The main help page: commands grouped by purpose, and the first ones to try."""

from __future__ import annotations

from typing import Any

from typer.core import TyperGroup

RUN, LOOK, JUDGE, COMPARE, DATA, MORE = "Run", "Look", "Judge", "Compare", "Data", "More"
"""Headings of commands, in their order; each is registered with one as its panel."""

_FIRST = [
    ("omnieval replay", "replays a building that omnieval renders itself, and prints a folder"),
    ("omnieval view RUN", "shows that folder, decision by decision"),
    ("omnieval COMMAND --help", "says what a command does, with examples"),
]


class FrontPage(TyperGroup):
    """The group of all commands."""

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write what to try first, and the commands below their headings."""
        with formatter.section("Try first"):
            formatter.write_dl(_FIRST)
        panels: dict[str, list[tuple[str, str]]] = {name: [] for name in (RUN, LOOK, JUDGE, COMPARE, DATA, MORE)}
        for name in self.list_commands(ctx):
            command = self.get_command(ctx, name)
            if command is not None and not command.hidden:
                panel = getattr(command, "rich_help_panel", None)
                panels[panel if panel in panels else MORE].append((name, command.get_short_help_str(limit=60)))
        for heading, commands in panels.items():
            if commands:
                with formatter.section(heading):
                    formatter.write_dl(commands)
