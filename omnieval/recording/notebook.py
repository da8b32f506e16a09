"""A run in the viewer of a notebook, and how far one has come."""

from __future__ import annotations

import html
import time
from collections.abc import Callable
from importlib import import_module
from typing import Any, Literal
from weakref import WeakKeyDictionary

import rerun as rr
import rerun.notebook
from rerun.chunk import RrdReader

from omnieval.errors import OmnievalError, ResultError
from omnieval.recording import entities
from omnieval.recording.blueprint import build_blueprint
from omnieval.recording.viewer import check_recording
from omnieval.recording.viewport import around, extent_of, origin_of
from omnieval.results.run_folder import Run

_SECONDS_BETWEEN = 0.2
"""A bar is drawn no more often: each time is a message to the browser."""

_SHOWN: WeakKeyDictionary[rerun.notebook.Viewer, rr.RecordingStream] = WeakKeyDictionary()
"""A file is sent when the notebook is ready for it, so the recording has to live as long as its viewer."""


def show(run: Run, *, size: tuple[int, int] | None = None) -> rerun.notebook.Viewer:
    """Return the recording of a run as a viewer, which a notebook shows if it is the last value of a cell.

    Parameters
    ----------
    run
        A run with a recording.
    size
        Width and height of the viewer, pixels; None for the width of the cell at 16:9.

    Raises
    ------
    ResultError
        If the run has no recording, or it cannot be read.
    OmnievalError
        If the viewer for notebooks is not installed.
    """
    if not rerun.notebook.HAS_NOTEBOOK:
        raise OmnievalError("the viewer for notebooks is not installed: pip install 'rerun-sdk[notebook]'")
    if not run.recording.exists():
        raise ResultError(f"{run.folder} has no recording; make one with: omnieval render {run.folder}")
    steps = check_recording(run.recording)
    (shown,) = RrdReader(run.recording).recordings()
    # With the id of the file, what the file brings goes into this recording, not into another one beside it.
    recording = rr.RecordingStream(
        entities.application_id(run.method), recording_id=shown.recording_id, send_properties=False
    )
    whole = extent_of(run.steps.select("x", "y").to_numpy())
    extent = around(whole, origin_of(whole))
    # A viewer in a notebook leaves the blueprint of a file aside.
    blueprint = build_blueprint(run.method, steps, extent)
    width: int | Literal["auto"]
    height: int | Literal["auto"]
    width, height = size or ("auto", "auto")
    # The colours are made for a dark ground; a notebook may be bright.
    viewer = rerun.notebook.Viewer(width=width, height=height, recording=recording, blueprint=blueprint, theme="dark")
    recording.log_file_from_path(run.recording)
    _SHOWN[viewer] = recording
    return viewer


def progress(title: str = "images") -> Callable[[int, int], None]:
    """Return a bar below the cell, for `progress` of `omnieval.replay`, `localize`, `ablate` and `baseline`.

    Parameters
    ----------
    title
        What is counted.

    Returns
    -------
    Callable[[int, int], None]
        To be called with how many are done, and of how many.

    Raises
    ------
    OmnievalError
        If this is not a notebook.
    """
    try:
        notebook: Any = import_module("IPython.display")
    except ImportError as error:
        raise OmnievalError("there is no notebook here: IPython is not installed; leave progress out") from error
    handle = notebook.display(notebook.HTML(""), display_id=True)
    if handle is None:
        raise OmnievalError("there is no notebook here to show a bar in; leave progress out")
    drawn = -_SECONDS_BETWEEN

    def show_done(done: int, total: int) -> None:
        nonlocal drawn
        if done < total and time.monotonic() - drawn < _SECONDS_BETWEEN:
            return
        drawn = time.monotonic()
        words = f"{html.escape(title)} {done:,} of {total:,}"
        handle.update(notebook.HTML(f'<progress value="{done}" max="{max(total, 1)}"></progress> {words}'))

    return show_done
