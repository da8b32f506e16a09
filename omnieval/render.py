"""The recording of a run again, from its tables and images.

The tables say what was decided. Only similarity curves, which they do not hold, are computed again, and what leads to
them is compared with the tables; where that cannot be done any more, the recording has none.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

from omnieval.errors import ResultError
from omnieval.mapping.step import Step
from omnieval.material.material import Material
from omnieval.material.reopened import reopened
from omnieval.material.source import archive_file
from omnieval.metrics.evaluation import Evaluation
from omnieval.recording import RecordingOptions
from omnieval.remap import remapped
from omnieval.results.atomic import is_temporary, named, replacing
from omnieval.results.folder import hold_folder
from omnieval.results.run_folder import PARTIAL_RECORDING, RECORDING, Run
from omnieval.results.tables import final_map, read_steps
from omnieval.sinks import RecordingSink


def render(
    run: Run,
    options: RecordingOptions | None = None,
    *,
    out: Path | None = None,
    progress: Callable[[int, int], None] | None = None,
    note: Callable[[str], None] | None = None,
) -> Path:
    """Write the recording of a run again and return where it is.

    One that is there stays as it is until the new one is whole; if that fails, it stays.

    Parameters
    ----------
    run
        A complete or interrupted run.
    options
        How to record.
    out
        The file to write; None for the recording in the folder of the run.
    progress
        Called with (steps done, steps in all).
    note
        Called with a sentence if curves have to be left out, because the mapper or the descriptor cannot be made again.

    Raises
    ------
    DatasetError
        If the sequence is no longer where the run found it, or an image of it cannot be read.
    ResultError
        If it has changed since, the run is still being written, or the recording cannot be written.
    """
    if out is not None:
        with replacing(out) as temporary:
            _render(run, temporary, options or RecordingOptions(), progress, note)
        return out
    with hold_folder(run.folder):
        with replacing(run.recording) as temporary:
            _render(run, temporary, options or RecordingOptions(), progress, note)
        # What killed processes left is in the whole one, and does no harm beside it.
        killed = [path for path in run.folder.glob(".*.tmp") if is_temporary(path, of=RECORDING)]
        for left in (run.folder / PARTIAL_RECORDING, *killed):
            with suppress(OSError):
                left.unlink()
    return run.recording


def _render(
    run: Run,
    path: Path,
    options: RecordingOptions,
    progress: Callable[[int, int], None] | None,
    note: Callable[[str], None] | None,
) -> None:
    lost = {kind: why for kind in ("descriptor", "mapper") if (why := _lost(run, kind))}
    if lost and note:
        note(f"the recording has no similarity curves: {'; '.join(lost.values())}")
    with reopened(run, describe="descriptor" not in lost) as material:
        sink = RecordingSink(path, material, run.method, options)
        try:
            _record(run, material, _recorded(run, material) if lost else remapped(run, material), sink, progress)
        finally:
            sink.close()
    if sink.lacking:
        raise sink.lacking
    if sink.failure:
        raise ResultError(f"the recording {named(path)} was not made: {sink.failure}")


def _record(
    run: Run,
    material: Material,
    steps: Iterator[Step],
    sink: RecordingSink,
    progress: Callable[[int, int], None] | None,
) -> None:
    milliseconds = run.steps["milliseconds"].to_list()
    # An interrupted run has fewer steps than the sequence has frames.
    for step, frame, cost in zip(steps, material.frames, milliseconds, strict=False):
        sink.step(step, frame, cost)
        if sink.failure:
            return
        if progress:
            progress(step.frame + 1, len(milliseconds))
    if run.status == "complete":
        sink.finish(final_map(run.steps, run.nodes), Evaluation(run.metrics, run.manifest["null_reasons"]))


def _lost(run: Run, kind: str) -> str | None:
    """Say why a component of a run cannot be made again; None if it can, or is not needed."""
    if kind == "descriptor" and archive_file(run.manifest["source"]) is not None:
        return None
    try:
        getattr(run.config, kind).again()
    except ResultError as error:
        return str(error)
    return None


def _recorded(run: Run, material: Material) -> Iterator[Step]:
    """Yield the steps of the tables, while the images are compared with the fingerprint of the run."""
    for (step, _), _ in zip(read_steps(run.steps, run.method.columns), material.described, strict=False):
        yield step
