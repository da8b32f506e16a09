"""Records a replay, step by step, for the Rerun viewer."""

from __future__ import annotations

from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from omnieval.explain.capture import Capture
from omnieval.explain.decision import Decision, best_match, decision
from omnieval.explain.revisit import Revisit, Revisits
from omnieval.explain.words import final_text
from omnieval.mapping.partition import Partition
from omnieval.mapping.step import FinalMap, Step
from omnieval.recording import layout
from omnieval.recording.blueprint import build_blueprint
from omnieval.recording.evidence import (
    curve_rows,
    decision_state,
    gate_rows,
    missed_rows,
    numbered,
    plot_rows,
    why_rows,
    word_rows,
)
from omnieval.recording.facts import ImageFacts
from omnieval.recording.overview import Overview
from omnieval.recording.records import RecordingInfo, RecordingOptions, StepImages, StepView
from omnieval.recording.rows import Picture, Row, State, Words
from omnieval.recording.stream import Stream
from omnieval.recording.styles import lane_state, room_states, styles
from omnieval.recording.view import check_viewer, start_viewer


class Recorder:
    """Turns Steps into a recording; a context manager.

    Whatever happens to the recording, the replay goes on: after the file or the viewer has failed, `log` does
    nothing more, and `failure` says what happened. A file grows as ``NAME.partial.rrd`` and gets its name from
    `close`.

    Parameters
    ----------
    path
        The file to write; None to show the replay in a viewer only.
    info
        What to say about the run.
    options
        How much to record, and who watches.

    Raises
    ------
    ResultError
        If the file cannot be written or the viewer cannot be reached.
    """

    def __init__(self, path: Path | None, info: RecordingInfo, options: RecordingOptions | None = None) -> None:
        self._info = info
        self._options = options or RecordingOptions()
        viewer = self._viewer()
        self._stream = Stream(
            path,
            recording_id=info.recording_id,
            blueprint=build_blueprint(info.steps, info.mapper.gamma, info.extent),
            viewer=viewer,
        )
        if viewer is not None:
            self._stream.follow(build_blueprint(info.steps, info.mapper.gamma, info.extent, play="following"))
        self._partition = Partition()
        self._overview = Overview()
        self._facts = ImageFacts(info.mapper.gamma)
        self._final_labels: NDArray[np.int64] | None = None
        self._lanes: dict[str, str] = {}
        self._rooms: list[str] = []
        self._captures: list[Capture] = []
        self._revisits = Revisits(info.mapper.n_new)
        self._log_header()

    @property
    def failure(self) -> str | None:
        """What made the recording incomplete, one line; None while all is well."""
        return self._stream.failure

    def wants_images(self, frame: int) -> bool:
        """Whether pictures of this frame would be recorded; the caller need not decode others."""
        return self._options.images and self._detailed(frame)

    def log(self, view: StepView, *, images: StepImages | None = None) -> None:
        """Record a step; steps come in order, each one once.

        Raises
        ------
        ValueError
            If the step is not the one that follows the last.
        """
        step, gamma = view.step, self._info.mapper.gamma
        revisit = self._revisits.find(view.capture, self._partition)
        self._captures.append(view.capture)
        self._partition.apply(step)
        if self._stream.ended:
            return
        self._stream.begin(step.frame, view.time_ns)
        decided = self._decided(step, revisit)
        self._facts.add(decided)
        rows = [*word_rows(step, gamma), *plot_rows(view, gamma, self._partition.unassigned), *self._lane_rows(decided)]
        rows += [*why_rows(decided, self._info.mapper), *missed_rows(decided)]
        rows += self._overview.rows(decided, self._partition)
        if self._detailed(step.frame):
            rows += [*gate_rows(step.gate), *curve_rows(step.match, gamma)]
        if images is not None and self.wants_images(step.frame):
            rows += _image_rows(images)
        self._stream.add(rows)

    def finish(self, final: FinalMap | None, description: str) -> None:
        """Record what the run has come to: the page with metrics and, unless it was cut short, the final map."""
        self._stream.static(layout.PAGE, rr.TextDocument(description, media_type=rr.MediaType.MARKDOWN))
        if final is None or self._stream.ended:
            return
        end = len(final.labels)
        self._stream.begin(end, None)
        rows = self._overview.final_rows(final.labels, final.active)
        self._final_labels = final.labels
        words = Words(numbered(end, final_text(final)), "FINAL", layout.EVENT_COLOR)
        self._stream.add([*rows, (layout.LOG_EVENT, words)])
        changes = np.flatnonzero(np.diff(final.labels, prepend=-1))
        for frame in changes.tolist():
            self._stream.begin(frame, None)
            self._stream.add([(layout.LANE_FINAL, State(lane_state(int(final.labels[frame]))))])

    def close(self) -> None:
        """Complete the recording. Calling it again does nothing."""
        if not self._stream.ended:
            self._log_facts()
        self._stream.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _detailed(self, frame: int) -> bool:
        return frame % self._options.every == 0 and not self._stream.ended

    def _viewer(self) -> str | None:
        if self._options.spawn:
            return start_viewer()
        if self._options.connect is not None:
            check_viewer(self._options.connect)
        return self._options.connect

    def _log_header(self) -> None:
        """Log what holds for the whole run: name, page, and how everything is drawn."""
        info, stream = self._info, self._stream
        stream.name(info.name, info.properties)
        stream.static(layout.PAGE, rr.TextDocument(info.description, media_type=rr.MediaType.MARKDOWN))
        for entity, value in styles(info.steps, info.extent):
            stream.static(entity, value)

    def _log_facts(self) -> None:
        """Log what is said of an image that is selected; there are two entities that draw images."""
        labels, stream = self._final_labels, self._stream
        facts = self._facts.all(labels)
        stream.facts(layout.MAP_IMAGES, facts.values)
        stream.flush()  # the rows of an entity that are sent together are of one kind
        for step, recent in self._facts.recent(self._overview.drawn, labels):
            stream.begin(step, self._captures[step].time_ns)
            stream.add([(layout.MAP_RECENT, recent)])

    def _lane_rows(self, decided: Decision) -> list[tuple[str, Row]]:
        """Return the lanes that change their state at this step."""
        room = decided.capture.room
        if room and room not in self._rooms:
            self._rooms.append(room)
            self._stream.static(layout.LANE_ROOM, lambda: room_states(self._rooms))
        states = {
            layout.LANE_DECISION: decision_state(decided),
            layout.LANE_NODE: lane_state(decided.node),
            layout.LANE_ROOM: room or "",
        }
        changed = {lane: state for lane, state in states.items() if self._lanes.get(lane, "") != state}
        self._lanes |= changed
        return [(lane, State(state)) for lane, state in changed.items()]

    def _decided(self, step: Step, revisit: Revisit | None) -> Decision:
        """Return the step with its surroundings."""
        here, match = self._captures[step.frame], step.match
        best = (
            best_match(match, here, self._captures[match.best_frame], self._info.cells) if match is not None else None
        )
        return decision(step, here, best, revisit)


def _image_rows(images: StepImages) -> list[tuple[str, Row]]:
    rows: list[tuple[str, Row]] = [(layout.PANORAMA, Picture(images.panorama))]
    if images.omnidirectional is not None:
        rows.append((layout.OMNIDIRECTIONAL, Picture(images.omnidirectional)))
    return [*rows, (layout.BEST_MATCH, Picture(images.match))]
