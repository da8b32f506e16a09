"""The home folder in arguments of the command line."""

from __future__ import annotations

import os
import re

_HOME = re.compile(r"(--[a-z][a-z-]*=)?(~[^/]*(?:/.*)?)", re.DOTALL)


def with_home(argument: str) -> str:
    """Return an argument with ``~`` for the home folder, which no shell fills in behind ``=`` or within quotes.

    Of ``--set NAME=VALUE`` and the like the value is left alone.

    Examples
    --------
    >>> os.path.expanduser("~/runs") == with_home("~/runs") and with_home("--set"), with_home("a~/b")
    ('--set', 'a~/b')
    """
    match = _HOME.fullmatch(argument)
    return argument if match is None else f"{match[1] or ''}{os.path.expanduser(match[2])}"  # noqa: PTH111 (text)
