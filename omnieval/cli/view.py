"""``omnieval view``: a run in the Rerun viewer."""

from __future__ import annotations

from omnieval.cli import options


def view(run: options.RunArgument) -> None:
    """Open the recording of a run in the Rerun viewer.

    Examples:

      omnieval view runs/synthetic-cloudy-hog
    """
    from omnieval.errors import ResultError
    from omnieval.recording.view import open_viewer
    from omnieval.results.run_folder import open_run

    recording = open_run(run).recording
    if not recording.exists():
        raise ResultError(f"{run} has no recording; make one with: omnieval render {run}")
    open_viewer([recording])
