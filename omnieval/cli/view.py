"""``omnieval view``: runs in the Rerun viewer."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from omnieval.results.run_folder import Run

_KEPT = 8
"""Recordings of two runs that stay in the cache folder."""


def view(
    runs: Annotated[
        list[Path],
        typer.Argument(help="Folders of runs, localisations or ablations, or recordings (.rrd).", metavar="RUN"),
    ],
    web: Annotated[
        bool, typer.Option("--web", help="Serve them to a browser on this machine, until Ctrl-C; needs no display.")
    ] = False,
    port: Annotated[
        int, typer.Option(min=1, max=65534, help="With --web: port of the page; the next one is used too.", metavar="N")
    ] = 9090,
) -> None:
    """Open the recordings of runs in one Rerun viewer; all have the same layout.

    Of several folders, those without a recording are left out, and named: runs/* opens all that there is. Of an
    ablation, what was recorded of it (--rrd best).

    Two runs over the same images are also shown side by side at the same step, in a recording of its own that is made
    from their tables and kept in the cache folder.

    On a machine without a display, --web prints the address of a page that only this machine can reach, and the ssh
    command that brings it to yours.

    Examples:

      omnieval view runs/synthetic-cloudy-hog

      omnieval view runs/a runs/b

      omnieval view runs/*

      omnieval view --web runs/a
    """
    from omnieval.cli.console import note
    from omnieval.recording.viewer import check_recording, open_viewer
    from omnieval.results.run_folder import open_run

    recordings, without = _found(runs)
    for recording in recordings:
        check_recording(recording)
    if without:
        note(
            f"left out because they have no recording: {', '.join(map(str, without))}; "
            "make one with: omnieval render RUN"
        )
    if len(runs) == 2 and not without and not any(map(_is_no_run, runs)):
        one, other = map(open_run, runs)
        if both := _side_by_side(one, other):
            recordings.append(both)
    if len(recordings) > 1:
        note(f"{len(recordings)} recordings: switch with Ctrl+Alt+Up and Down, or in the left panel (Ctrl+Shift+B)")
    if web:
        _serve(recordings, port)
    else:
        open_viewer(recordings)


def _serve(recordings: list[Path], port: int) -> None:
    import signal
    import socket
    from contextlib import suppress

    from omnieval.cli.console import note
    from omnieval.recording.viewer import web_viewer

    for name in ("SIGTERM", "SIGHUP"):  # or the server would go on without us, also when ssh hangs up
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.default_int_handler)
    with suppress(KeyboardInterrupt), web_viewer(recordings, port) as served:
        print(served.url, flush=True)
        forwarded = " ".join(f"-L {one}:127.0.0.1:{one}" for one in (served.page_port, served.data_port))
        note(f"from another machine: ssh {forwarded} {socket.gethostname()}, then the same address there")
        note("Ctrl-C ends it")
        served.wait()


def _found(given: list[Path]) -> tuple[list[Path], list[Path]]:
    """Return the recordings of what was given, and which of several folders have none.

    Raises
    ------
    ResultError
        If none has one, or one that was named alone, or by a name with nothing of omnieval's behind it.
    """
    from omnieval.errors import ResultError

    recordings: list[Path] = []
    without: list[Path] = []
    said: ResultError | None = None
    for one in given:
        try:
            recordings.append(one if _is_recording(one) else _recording_in(one))
        except ResultError as error:
            if not one.is_dir():
                raise
            said = said or error
            without.append(one)
    if said is not None and not recordings:
        raise said
    return recordings, without


def _recording_in(folder: Path) -> Path:
    """Return the recording of a folder of results."""
    from omnieval.ablation.store import BEST
    from omnieval.ablation.store import KIND as ABLATION
    from omnieval.errors import ResultError
    from omnieval.localization.run import KIND as LOCALIZATION
    from omnieval.localization.run import RECORDING
    from omnieval.results.manifest import expanded, kind_of
    from omnieval.results.run_folder import open_run

    kind = kind_of(folder)
    if kind == LOCALIZATION:
        return _recording(folder, expanded(folder) / RECORDING)
    if kind == ABLATION:
        best = expanded(folder) / BEST
        if not best.exists():
            raise ResultError(f"{folder} has no recording; make it again with --rrd best, which records its best run")
        return _recording(best, open_run(best).recording)
    run = open_run(folder)
    return _recording(run.folder, run.recording)


def _is_no_run(path: Path) -> bool:
    from omnieval.results.manifest import kind_of
    from omnieval.results.run_folder import KIND

    return kind_of(path) != KIND


def _is_recording(path: Path) -> bool:
    return path.suffix == ".rrd" and not path.is_dir()


def _recording(folder: Path, recording: Path) -> Path:
    from omnieval.errors import ResultError

    if not recording.exists():
        raise ResultError(f"{folder} has no recording; make one with: omnieval render {folder}")
    return recording


def _side_by_side(one: Run, other: Run) -> Path | None:
    """Record two runs together and return where; None if they are not over the same images."""
    import hashlib
    from contextlib import suppress

    from omnieval.datasets.cachedir import cache_dir
    from omnieval.errors import ResultError
    from omnieval.recording.side_by_side import record_pair
    from omnieval.results.compare import agreement

    agreed = agreement(one, other)
    if agreed is None or not len(agreed.verdicts):
        return None
    folder = cache_dir()
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ResultError(f"cannot write to the cache folder {folder}: {error.strerror}; set OMNIEVAL_CACHE") from error
    # Two folders always have the same file, which is replaced whole: nobody who looks at it sees another's.
    folders = "\0".join(str(run.folder.resolve()) for run in (one, other))
    name = hashlib.blake2b(folders.encode("utf-8", "surrogateescape"), digest_size=6).hexdigest()
    path = record_pair(folder / f"side-by-side-{name}.rrd", one, other, agreed)
    earlier = sorted(folder.glob("side-by-side-*.rrd"), key=lambda file: file.stat().st_mtime, reverse=True)
    for file in earlier[_KEPT:]:
        with suppress(OSError):  # somebody else was faster
            file.unlink()
    return path
