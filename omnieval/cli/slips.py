"""The message for an unknown option that is the name of a parameter."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

from typer.exceptions import TyperException


def in_place_of(error: TyperException, given: Sequence[str]) -> str | None:
    """Return the message for an option that names a parameter of a mapper, a descriptor or imaging; None for others.

    Parameters
    ----------
    error
        What the parser of the command line refuses.
    given
        The arguments.
    """
    option: str | None = getattr(error, "option_name", None)
    command = getattr(getattr(error, "ctx", None), "command", None)
    if option is None or not any(one.name == "set_" for one in getattr(command, "params", ())):
        return None
    from omnieval.config import parameters

    field = option.lstrip("-").replace("-", "_")
    names = [name for name in parameters() if field in {name, name.rpartition(".")[2]}]
    if not names:
        return None
    ways = " or ".join(f"--set {name}={_value(option, given) or 'VALUE'}" for name in names[:3])
    return f"{option} is not an option but a parameter; set it with: {ways}"


def _value(option: str, given: Sequence[str]) -> str | None:
    for argument in given:
        if argument.startswith(f"{option}="):
            return argument.removeprefix(f"{option}=")
    return next((after for one, after in pairwise(given) if one == option and not after.startswith("--")), None)
