"""Records a replay, step by step, for the Rerun viewer."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from omnieval.datasets.sequence import Frame
from omnieval.explain.revisit import Revisits
from omnieval.explain.scene import Scene
from omnieval.explain.words import map_text
from omnieval.mapping.interface import Method
from omnieval.mapping.partition import Partition
from omnieval.mapping.step import FinalMap, Step
from omnieval.recording import RecordingOptions, entities
from omnieval.recording.blueprint import build_blueprint
from omnieval.recording.charts import Charts
from omnieval.recording.compression import StepImages
from omnieval.recording.overview import Overview
from omnieval.recording.pages import ImageFacts, numbered, why_row, word_rows
from omnieval.recording.rerun_stream import Stream
from omnieval.recording.rows import Picture, Row, State, Words
from omnieval.recording.styles import EVENT_COLOR, lane_state, room_states, styles
from omnieval.recording.viewer import check_viewer, start_viewer
from omnieval.recording.viewport import Extent, around, origin_of


@dataclass(frozen=True)
class RecordingInfo:
    """What a recording says about its run as a whole.

    Attributes
    ----------
    name
        Shown in the viewer's list of recordings, e.g. ``seq1_cloudy1 - hog``.
    recording_id
        Unique to the run: two files with one id are one recording to the viewer.
    steps
        Number of images of the sequence.
    method
        The mapper: its parameters and the words of its evidence.
    cells
        Cells of the orientation descriptor: the unit of shifts.
    description
        Markdown page shown until `Recorder.finish` brings the one with metrics.
    properties
        What else distinguishes the run: parameters, dataset, descriptor.
    extent
        Extent of the capture positions, where the map view looks; None without poses.
    """

    name: str
    recording_id: str
    steps: int
    method: Method
    cells: int
    description: str
    properties: Mapping[str, object] = field(default_factory=dict)
    extent: Extent | None = None


class Recorder:
    """Turns Steps into a recording; a context manager.

    Whatever happens to the recording, the replay continues: after the file or the viewer has failed, `log` does
    nothing more, and `failure` says what happened. A file grows as ``NAME.partial.rrd`` and gets its name from
    `close`.

    Parameters
    ----------
    path
        The file to write; None to show the replay in a viewer only.
    info
        What to say about the run.
    options
        How much to record, and which viewer shows it live.

    Raises
    ------
    ResultError
        If the file cannot be written or the viewer cannot be reached.
    """

    def __init__(self, path: Path | None, info: RecordingInfo, options: RecordingOptions | None = None) -> None:
        self._info = info
        self._options = options or RecordingOptions()
        viewer = self._viewer()
        origin = origin_of(info.extent)
        self._extent = around(info.extent, origin)
        self._stream = Stream(
            path,
            application_id=entities.application_id(info.method),
            recording_id=info.recording_id,
            blueprint=build_blueprint(info.method, info.steps, self._extent),
            viewer=viewer,
        )
        if viewer is not None:
            self._stream.follow(build_blueprint(info.method, info.steps, self._extent, play="following"))
        self._partition = Partition()
        self._overview = Overview(origin, self._extent)
        self._charts = Charts(info.method)
        self._facts = ImageFacts(info.method)
        self._final_labels: NDArray[np.int64] | None = None
        self._lanes: dict[str, str] = {}
        self._rooms: list[str] = []
        self._images: list[Frame] = []
        self._revisits = Revisits()
        self._log_header()

    @property
    def failure(self) -> str | None:
        """What made the recording incomplete, one line; None while all is well."""
        return self._stream.failure

    def wants_images(self, frame: int) -> bool:
        """Whether pictures of this frame would be recorded; the caller need not decode others."""
        return self._options.images and self._detailed(frame)

    def log(
        self,
        step: Step,
        image: Frame,
        milliseconds: float,
        *,
        silhouette: float | None = None,
        pictures: StepImages | None = None,
    ) -> None:
        """Record a step; steps come in order, each one once.

        Parameters
        ----------
        step, image
            What was decided, of which image.
        milliseconds
            What the step cost.
        silhouette
            Silhouette of the map so far; None where it cannot be computed.
        pictures
            To be shown beside it.

        Raises
        ------
        ValueError
            If the step is not the one that follows the last.
        """
        revisit = self._revisits.find(image, self._partition)
        self._images.append(image)
        self._partition.apply(step)
        if self._stream.ended:
            return
        self._stream.begin(step.frame, image.time_ns)
        best = None if step.match is None else self._images[step.match.frame]
        scene = Scene(step, image, best, revisit, self._info.cells)
        self._facts.add(scene)
        rows: list[tuple[str, Row]] = [*word_rows(step, self._info.method), why_row(scene, self._info.method)]
        rows += self._charts.plot_rows(step, self._partition, milliseconds, silhouette)
        rows += [*self._charts.missed_rows(scene), *self._lane_rows(scene)]
        rows += self._overview.rows(scene, self._partition)
        if self._detailed(step.frame):
            rows += self._charts.step_rows(step)
        if pictures is not None and self.wants_images(step.frame):
            rows += _picture_rows(pictures)
        self._stream.add(rows)

    def finish(self, final: FinalMap | None, description: str) -> None:
        """Record the results: the page with metrics and, unless it was cut short, the final map."""
        self._stream.static(entities.PAGE, rr.TextDocument(description, media_type=rr.MediaType.MARKDOWN))
        if final is None or self._stream.ended:
            return
        end = len(final.labels)
        self._stream.begin(end, None)
        rows = self._overview.final_rows(final.labels, final.active)
        self._final_labels = final.labels
        words = Words(numbered(end, map_text(final)), "FINAL", EVENT_COLOR)
        self._stream.add([*rows, (entities.LOG_EVENT, words)])
        changes = np.flatnonzero(np.diff(final.labels, prepend=-1))
        for frame in changes.tolist():
            self._stream.begin(frame, None)
            self._stream.add([(entities.LANE_FINAL, State(lane_state(int(final.labels[frame]))))])

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
        stream.static(entities.PAGE, rr.TextDocument(info.description, media_type=rr.MediaType.MARKDOWN))
        for entity, value in styles(info.method, info.steps, self._extent):
            stream.static(entity, value)

    def _log_facts(self) -> None:
        """Log what is said of an image that is selected; there are two entities that draw images."""
        labels, stream = self._final_labels, self._stream
        facts = self._facts.all(labels)
        stream.facts(entities.MAP_IMAGES, facts.values)
        stream.flush()  # the rows of an entity that are sent together are of one kind
        for step, recent in self._facts.recent(self._overview.drawn, labels):
            stream.begin(step, self._images[step].time_ns)
            stream.add([(entities.MAP_RECENT, recent)])

    def _lane_rows(self, scene: Scene) -> list[tuple[str, Row]]:
        """Return the lanes that change their state at this step."""
        room = scene.image.room
        if room and room not in self._rooms:
            self._rooms.append(room)
            self._stream.static(entities.LANE_ROOM, lambda: room_states(self._rooms))
        states = {
            entities.LANE_DECISION: scene.outcome,
            entities.LANE_NODE: lane_state(scene.step.node),
            entities.LANE_ROOM: room or "",
        }
        changed = {lane: state for lane, state in states.items() if self._lanes.get(lane, "") != state}
        self._lanes |= changed
        return [(lane, State(state)) for lane, state in changed.items()]


def _picture_rows(pictures: StepImages) -> list[tuple[str, Row]]:
    rows: list[tuple[str, Row]] = [(entities.PANORAMA, Picture(pictures.panorama))]
    if pictures.omnidirectional is not None:
        rows.append((entities.OMNIDIRECTIONAL, Picture(pictures.omnidirectional)))
    return [*rows, (entities.BEST_MATCH, Picture(pictures.match))]
