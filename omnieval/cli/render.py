"""``omnieval render``: the recording again, from the tables and images of a run."""

from __future__ import annotations

from omnieval.cli import options


def render(
    run: options.RunArgument,
    no_images: options.NoImages = False,
    every: options.Every = 1,
) -> None:
    """Rebuild the recording of a run from its tables and images.

    Recordings are readable by neighbouring versions of the viewer only; the tables are the record.

    Examples:

      omnieval render runs/synthetic-cloudy-hog
    """
    from omnieval.cli.console import note, progress
    from omnieval.recording import RecordingOptions
    from omnieval.render import render as rebuild
    from omnieval.results.run_folder import open_run

    with progress("rendering") as report:
        path = rebuild(open_run(run), RecordingOptions(images=not no_images, every=every), progress=report, note=note)
    print(path)
