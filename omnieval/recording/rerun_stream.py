"""The stream into Rerun: rows gathered into columns, and a sink whose failure never blocks the process."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from omnieval.errors import ResultError
from omnieval.recording import entities
from omnieval.recording.pipe import PipedFile
from omnieval.recording.rows import Row
from omnieval.results.atomic import named

Content = rr.AsComponents | list[rr.DescribedComponentBatch]

FLUSH_STEPS = 50
"""Steps gathered before they are sent; a killed process loses at most these."""
LIVE_FLUSH_STEPS = 10
"""Steps gathered before they are sent while a viewer shows them live."""

_FLUSH_SECONDS = 10.0


class Stream:
    """Takes rows step by step and sends them as columns to a file, a viewer, or both.

    Errors of the sink never leave this class once it is open: the first one is remembered in `failure`. A lost
    viewer leaves the file going on; without a file, or when the file itself fails, the stream ends there.

    Parameters
    ----------
    path
        Where the file goes; None for a viewer alone.
    application_id
        What kind of recording it is: those of one kind are shown alike.
    recording_id
        Unique to the run.
    blueprint
        How the recording is shown.
    viewer
        URL of a viewer that shows it live.

    Raises
    ------
    ResultError
        If neither file nor viewer is given, or either cannot be opened.
    """

    def __init__(
        self,
        path: Path | None,
        *,
        application_id: str,
        recording_id: str,
        blueprint: rrb.Blueprint,
        viewer: str | None = None,
    ) -> None:
        if path is None and viewer is None:
            raise ResultError("a recording needs somewhere to go: name a file, or show it in a viewer")
        self.failure: str | None = None
        self._ended = self._closed = False
        self._application_id = application_id
        self._viewer = viewer
        self._flush_steps = FLUSH_STEPS if viewer is None else LIVE_FLUSH_STEPS
        self._times: list[tuple[int, int | None]] = []
        self._rows: dict[str, list[tuple[int, Row]]] = {}
        self._rerun = _new_recording(application_id, recording_id)
        self._file = PipedFile(path) if path is not None else None
        try:
            with _strict():
                self._rerun.set_sinks(*self._sinks(), default_blueprint=blueprint)
        except (RuntimeError, ValueError, TypeError) as error:
            if self._file is not None:
                self._file.close(keep=False)
                self._file.partial.unlink(missing_ok=True)
            raise ResultError(
                f"cannot open the recording {named(path) if path else viewer}: {_one_line(error)}"
            ) from error
        if self._file is not None:
            self._file.opened()

    @property
    def ended(self) -> bool:
        """Whether anything more would be recorded."""
        return self._ended

    def follow(self, blueprint: rrb.Blueprint) -> None:
        """Show the viewer a blueprint of its own; the file keeps the one it was opened with."""
        self._do(lambda: blueprint.connect_grpc(self._application_id, url=self._viewer, make_default=False))

    def name(self, name: str, properties: Mapping[str, object]) -> None:
        """Say what distinguishes this recording from others.

        Values become text: Rerun wants one type a name for the whole process, whatever run it belongs to.
        """
        self._do(lambda: self._rerun.send_recording_name(name))
        values = {key: str(value) for key, value in properties.items()}
        if values:
            self._do(lambda: self._rerun.send_property("run", rr.AnyValues(drop_untyped_nones=True, **values)))

    def static(self, entity: str, value: Content | Callable[[], Content]) -> None:
        """Log what holds at all times; what was said before is replaced.

        What is made of a dataset's own words is given as a function: Rerun may refuse it.
        """
        self._do(lambda: self._rerun.log(entity, value() if callable(value) else value, static=True))

    def facts(self, entity: str, values: Mapping[str, Sequence[str]]) -> None:
        """Log by name what holds at all times of each point of an entity."""
        lists: dict[str, Any] = {name: list(value) for name, value in values.items()}
        if lists:
            self._do(lambda: self._rerun.log(entity, rr.AnyValues(**lists), static=True))

    def begin(self, step: int, time_ns: int | None) -> None:
        """Let a step begin; rows belong to it from now on."""
        timed_so_far = bool(self._times) and self._times[-1][1] is not None
        if len(self._times) >= self._flush_steps or (self._times and timed_so_far != (time_ns is not None)):
            self.flush()
        self._times.append((step, time_ns))

    def add(self, rows: list[tuple[str, Row]]) -> None:
        """Add rows of the current step, each with the entity that shows it; an entity's are all of one kind."""
        at = len(self._times) - 1
        for entity, row in rows:
            self._rows.setdefault(entity, []).append((at, row))

    def flush(self) -> None:
        """Send what was gathered."""
        times, gathered = self._times, self._rows
        self._times, self._rows = [], {}

        def send() -> None:
            for entity, rows in gathered.items():
                at = _time_columns([times[index] for index, _ in rows])
                self._rerun.send_columns(entity, at, type(rows[0][1]).columns([row for _, row in rows]))

        self._do(send)
        self._push()

    def close(self) -> None:
        """Send the rest and complete the file. Calling it again does nothing."""
        if self._closed:
            return
        self._closed = True
        self.flush()
        try:
            self._rerun.disconnect()
        except RuntimeError as error:
            self._fail(error, ended=True)
        if self._file is not None:
            self._file.close(keep=not self._ended)
            self._note_file_error(self._file)
        self._ended = True

    def _push(self) -> None:
        """Get what was sent out of the process; notice what has failed."""
        if self._ended or (self._viewer is not None and self.failure is not None):
            return
        try:
            self._rerun.flush(timeout_sec=_FLUSH_SECONDS)
        except RuntimeError as error:
            self._fail(error, ended=self._file is None)
        if self._file is not None:
            self._file.settle()
            self._note_file_error(self._file)

    def _note_file_error(self, file: PipedFile) -> None:
        if file.error is not None and not self._ended:
            reason = file.error.strerror or str(file.error)
            self.failure = f"recording stopped: cannot write {named(file.partial)}: {reason}"
            self._ended = True

    def _fail(self, error: Exception, *, ended: bool) -> None:
        where = "the viewer was lost" if self._viewer is not None and not ended else "recording stopped"
        self.failure = self.failure or f"{where}: {_one_line(error)}"
        self._ended = self._ended or ended

    def _do(self, action: Callable[[], None]) -> None:
        """Call Rerun, and remember its errors instead of raising them."""
        if self._ended:
            return
        try:
            with _strict():
                action()
        except (RuntimeError, ValueError, TypeError) as error:
            self._fail(error, ended=True)

    def _sinks(self) -> list[rr.FileSink | rr.GrpcSink]:
        sinks: list[rr.FileSink | rr.GrpcSink] = []
        if self._file is not None:
            sinks.append(rr.FileSink(self._file.address))
        if self._viewer is not None:
            sinks.append(rr.GrpcSink(self._viewer))
        return sinks


def leave_behind() -> None:
    """Let this process end although a recording is not complete: Rerun would wait for it once more when Python ends."""
    rr.unregister_shutdown()


def _new_recording(application_id: str, recording_id: str) -> rr.RecordingStream:
    """Return a stream that cuts no chunk by the clock and logs no wall-clock time."""
    recording = rr.RecordingStream(
        application_id,
        recording_id=recording_id,
        send_properties=False,
        batcher_config=rr.ChunkBatcherConfig(flush_tick=3600.0),
    )
    if not rr.is_enabled(recording):
        raise ResultError("Rerun is switched off by the environment variable RERUN; unset it to record")
    recording.set_log_time_enabled(False)
    return recording


def _time_columns(times: list[tuple[int, int | None]]) -> list[rr.TimeColumn]:
    columns = [rr.TimeColumn(entities.STEP, sequence=[step for step, _ in times])]
    stamps = [stamp for _, stamp in times if stamp is not None]
    if len(stamps) == len(times):
        columns.append(rr.TimeColumn(entities.CAPTURE, timestamp=np.array(stamps, "datetime64[ns]")))
    return columns


@contextlib.contextmanager
def _strict() -> Iterator[None]:
    """Make Rerun raise what it otherwise only warns of, and leave the rest of the process as it was."""
    before = rr.strict_mode()
    rr.set_strict_mode(True)
    try:
        yield
    finally:
        rr.set_strict_mode(before)


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split())
