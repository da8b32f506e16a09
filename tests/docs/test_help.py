"""Help texts as somebody reads them who has never seen the tool."""

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from typer.main import get_command

from omnieval.cli import app

WIDTH = 78
"""Columns of a terminal that an example may fill, so that it can be copied as one line."""


def commands(command, words=()):
    """Yield every command that does something, with the words that call it."""
    inner = getattr(command, "commands", None)
    if inner is None:
        yield words, command
        return
    for name, one in inner.items():
        yield from commands(one, (*words, name))


COMMANDS = dict(commands(get_command(app)))


@pytest.fixture(params=COMMANDS, ids="-".join)
def command(request):
    return COMMANDS[request.param]


def test_every_command_has_examples_that_fit_on_a_line(command):
    _, _, examples = command.help.partition("Examples:")
    lines = [line for line in examples.splitlines() if line.strip()]
    assert lines
    assert all(line.strip().startswith("omnieval ") for line in lines)
    # Help indents by two more.
    assert [line for line in lines if len(line) + 2 > WIDTH] == []


def test_every_argument_and_option_is_explained_and_says_what_it_takes(command):
    for one in command.params:
        assert one.help, one.name
        assert one.help.endswith("."), one.name
        takes_no_value = getattr(one, "is_flag", False)
        chooses = one.name == "format_"  # whose values stand in its place
        assert takes_no_value or chooses or one.metavar, one.name


def test_every_command_says_what_it_does_in_half_a_line():
    root: Any = get_command(app)
    shorts = {name: one.short_help or one.help for name, one in root.commands.items()}
    assert {name: text for name, text in shorts.items() if len(text) > 50 or not text.endswith(".")} == {}


def run(*command, **environment):
    return subprocess.run(command, capture_output=True, text=True, check=True, env=os.environ | environment).stdout


def script():
    found = Path(sys.executable).with_name("omnieval")
    if not found.exists():
        pytest.skip(f"no {found}: omnieval is not installed as a command")
    return str(found)


def test_a_shell_can_complete_commands_and_options():
    asked = {"_OMNIEVAL_COMPLETE": "complete_bash", "COMP_CWORD": "1", "COMP_WORDS": "omnieval re"}
    assert set(run(script(), **asked).split()) == {"replay", "report", "render"}
    asked |= {"COMP_CWORD": "2", "COMP_WORDS": "omnieval replay --s"}
    assert {"--set", "--stride", "--skip-bad"} <= set(run(script(), **asked).split())
    assert "--install-completion" in run(script(), "--help")
    assert "complete -o default" in run(script(), _OMNIEVAL_COMPLETE="source_bash")


def test_a_shell_can_complete_mappers_and_descriptors():
    def completed(words):
        count = str(len(words.split()) - 1)
        return run(script(), _OMNIEVAL_COMPLETE="complete_bash", COMP_CWORD=count, COMP_WORDS=words).split()

    assert completed("omnieval replay --mapper rom") == ["roman2020"]
    assert "hog" in completed("omnieval describe --descriptor h")


def test_who_types_nothing_is_told_what_there_is_and_what_to_try_first():
    bare = run(sys.executable, "-m", "omnieval")
    assert "  omnieval replay  " in bare.partition("Try first:")[2].splitlines()[1]
    headings = [line.removesuffix(":") for line in bare.splitlines() if line.endswith(":") and not line.startswith(" ")]
    assert headings == ["Options", "Try first", "Run", "Look", "Judge", "Compare", "Data", "More"]
    root: Any = get_command(app)
    listed = [line.split()[0] for line in bare.partition("\nRun:")[2].splitlines() if line.startswith("  ")]
    assert set(root.commands) <= set(listed)
    assert "synthesize" in run(sys.executable, "-m", "omnieval", "dataset")


def test_the_package_runs_as_a_module():
    assert run(sys.executable, "-m", "omnieval", "--version").startswith("omnieval ")
