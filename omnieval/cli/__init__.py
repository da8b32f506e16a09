"""The command line: one thin file per command; this one assembles them and turns errors into exit codes."""

from __future__ import annotations

import functools
import os
import sys
from collections.abc import Callable, Sequence
from typing import Any

import typer
from typer.exceptions import TyperException
from typer.main import get_command

from omnieval.cli import (
    ablate,
    baseline,
    cache,
    check,
    compare,
    dataset,
    describe,
    diff,
    doctor,
    explain,
    export,
    localize,
    map_descriptors,
    parameters,
    render,
    replay,
    report,
    view,
)
from omnieval.cli.console import library_notes, note
from omnieval.cli.front_page import COMPARE, DATA, JUDGE, LOOK, RUN, FrontPage
from omnieval.cli.home import with_home
from omnieval.cli.slips import in_place_of
from omnieval.cli.streams import ready_streams
from omnieval.errors import OmnievalError

INTERRUPTED = 130

app = typer.Typer(
    name="omnieval",
    cls=FrontPage,
    help="Replay incremental topological mapping over omnidirectional images and keep the evidence of every decision.",
    epilog="A SOURCE is synthetic[:cloudy|night|sunny[:N]], cold:PATH, innova:PATH, folder:PATH, video:FILE, bag:PATH, "
    "npz:FILE, or a path recognised by its content. "
    "Exit codes: 0 ok, 1 unexpected, 2 usage or configuration, 3 dataset invalid, 4 regression failed, "
    "5 some jobs failed, 130 interrupted. Add --debug to any command for the traceback of an error.",
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)
app.command("replay", rich_help_panel=RUN, short_help="Replay a sequence into a run folder.")(replay.replay)
app.command("map", rich_help_panel=RUN, short_help="Map descriptors from anywhere.")(map_descriptors.map_descriptors)
app.command("ablate", rich_help_panel=RUN, short_help="Sweep parameters: one row per run.")(ablate.ablate)
app.command("localize", rich_help_panel=RUN, short_help="Find other images in a run's map.")(localize.localize)
app.command("view", rich_help_panel=LOOK, short_help="Open runs in the Rerun viewer.")(view.view)
app.command("explain", rich_help_panel=LOOK, short_help="Explain one decision.")(explain.explain)
app.command("render", rich_help_panel=LOOK, short_help="Rebuild a run's recording.")(render.render)
app.command("report", rich_help_panel=JUDGE, short_help="Draw figures and tables: one page.")(report.report)
app.command("baseline", rich_help_panel=JUDGE, short_help="Cluster by other methods, same metrics.")(baseline.baseline)
app.command("check", rich_help_panel=JUDGE, short_help="Guard results against a reference.")(check.check)
app.command("compare", rich_help_panel=COMPARE, short_help="Show runs in one table.")(compare.compare)
app.command("diff", rich_help_panel=COMPARE, short_help="Show where two runs differ, and why.")(diff.diff)
app.add_typer(dataset.app, name="dataset", rich_help_panel=DATA)
app.add_typer(cache.app, name="cache", rich_help_panel=DATA)
app.command("describe", rich_help_panel=DATA, short_help="Write descriptors as a NumPy archive.")(describe.describe)
app.command("export", rich_help_panel=DATA, short_help="Write a run for other programs.")(export.export)
app.command("parameters", short_help="List every parameter.")(parameters.parameters)
app.command("doctor", short_help="Show and test the installation.")(doctor.doctor)


@app.callback(invoke_without_command=True)
def _root(
    ctx: typer.Context, version: bool = typer.Option(False, "--version", help="Show the version and exit.")
) -> None:
    if version:
        import omnieval

        typer.echo(f"omnieval {omnieval.__version__}")
    elif ctx.invoked_subcommand is None:
        typer.echo(ctx.get_help())


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line and exit with its documented code. Every error is handled here, once."""
    given = [with_home(argument) for argument in (sys.argv[1:] if arguments is None else arguments)]
    debug = "--debug" in given
    ready_streams()
    # What is wrong with an image or a video is said by omnieval, once.
    os.environ.setdefault("OPENCV_LOG_LEVEL", "SILENT")
    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")
    try:
        with library_notes():
            code = _parser()(args=[argument for argument in given if argument != "--debug"], standalone_mode=False)
        if code == INTERRUPTED:  # typer has caught the interrupt itself
            code = _fail("interrupted; what was computed so far is kept", INTERRUPTED)
    except TyperException as error:
        code = _fail(in_place_of(error, given) or error.format_message(), error.exit_code)
    except OmnievalError as error:
        if debug:
            raise
        code = _fail(str(error), error.exit_code)
    except BrokenPipeError:
        # Whoever read our output has gone; nothing is left to say and stdout must not be flushed at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        code = 1
    except Exception as error:
        if debug:
            raise
        code = _fail(f"unexpected {type(error).__name__}: {error}; run again with --debug and report it", 1)
    sys.exit(code if isinstance(code, int) else 0)


@functools.cache
def _parser() -> Callable[..., Any]:
    """Return what reads a command line and runs it; made once, because that takes longer than many a command runs."""
    return get_command(app)


def _fail(message: str, code: int) -> int:
    note(message)
    return code
