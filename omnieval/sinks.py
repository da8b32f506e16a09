"""The recording as a sink of steps: gives the recorder what a step alone does not know.

Where and when the image was taken, the pictures, the silhouette so far, the pages in words.
"""

from __future__ import annotations

import uuid
from collections import deque
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

import numpy as np

from omnieval.config import Config
from omnieval.datasets.sequence import Frame
from omnieval.errors import DatasetError
from omnieval.mapping.step import FinalMap, Step
from omnieval.material import Material
from omnieval.metrics.evaluation import Evaluation
from omnieval.metrics.running import SilhouetteSoFar
from omnieval.recording.aside import Aside, leave_behind
from omnieval.recording.pictures import step_images
from omnieval.recording.recorder import Recorder
from omnieval.recording.records import RecordingInfo, RecordingOptions, StepImages, StepView
from omnieval.results.summary import configuration_page, metrics_page

_MOST_WAITING = 16
"""Steps that wait to be recorded at a time; bounds the memory, and what a viewer lags behind."""
_PATIENCE_S = 30.0
"""How long a viewer may take nothing before the replay goes on without the recording: a frozen one never would."""


class RecordingSink:
    """Follows a replay into a Rerun recording.

    Nothing that goes wrong here changes a result: `failure` says what did.

    Parameters
    ----------
    path
        The recording to write; None to show it in a viewer only.
    material
        What is replayed.
    config
        With which parameters.
    options
        How much to record, and who watches.

    Raises
    ------
    ResultError
        If the recording cannot be opened.
    """

    def __init__(self, path: Path | None, material: Material, config: Config, options: RecordingOptions) -> None:
        self._pictures = material.pictures if options.images else None
        self._silhouette = SilhouetteSoFar(material.positions) if material.positions is not None else None
        self._page = configuration_page(material.name, material.source, config.mapper.model_dump(mode="json"))
        self._cells = material.cells
        self._picture_failure: str | None = None
        self._recorder = Recorder(path, _info(material, config, self._page), options)
        self._patience = _PATIENCE_S if options.spawn or options.connect is not None else None
        self._left: str | None = None
        self._closed = False
        self._aside = Aside("recorder")
        self._painter = ThreadPoolExecutor(1, thread_name_prefix="painter")
        self._waiting: deque[Future[None]] = deque()

    @property
    def failure(self) -> str | None:
        """What went wrong first, None if nothing did."""
        return self._left or self._recorder.failure or self._picture_failure

    def step(self, step: Step, frame: Frame, milliseconds: float) -> None:
        """Record a step, soon: pictures take longer than decisions, and a core may be idle."""
        if self._left:
            return
        images = self._painter.submit(self._images, step)
        self._waiting.append(self._aside.submit(self._record, step, frame, milliseconds, images))
        if len(self._waiting) > _MOST_WAITING:
            self._wait(self._waiting.popleft())

    def finish(self, final: FinalMap, evaluation: Evaluation) -> None:
        """Record the final map and what it is worth."""
        self._settle()
        self._wait(self._aside.submit(self._recorder.finish, final, self._page + metrics_page(evaluation)))

    def close(self) -> None:
        """Complete the recording as far as it came. Calling it again does nothing."""
        if self._closed:
            return
        self._closed = True
        try:
            self._settle()
        finally:
            self._painter.shutdown()
            self._wait(self._aside.submit(self._recorder.close))
            self._aside.end()

    def _settle(self) -> None:
        """Wait until every step is recorded."""
        while self._waiting:
            self._wait(self._waiting.popleft())

    def _wait(self, call: Future[None]) -> None:
        """Wait for what is done aside, unless a viewer has it wait for too long."""
        if self._left:
            return
        try:
            call.result(self._patience)
        except TimeoutError:
            if call.done():  # what it came to, and not our patience
                raise
            leave_behind()
            self._left = (
                f"the viewer is frozen, it took nothing for {self._patience:g} s; `omnieval render` makes the recording"
            )

    def _record(self, step: Step, frame: Frame, milliseconds: float, images: Future[StepImages | None]) -> None:
        pose = frame.pose
        view = StepView(
            step=step,
            milliseconds=milliseconds,
            position=(pose.x, pose.y) if pose else None,
            yaw=pose.yaw if pose and np.isfinite(pose.yaw) else None,
            room=frame.room,
            file=frame.file,
            time_ns=frame.time_ns,
            silhouette=self._silhouette.apply(step) if self._silhouette else None,
        )
        self._recorder.log(view, images=images.result())

    def _images(self, step: Step) -> StepImages | None:
        if self._pictures is None or not self._recorder.wants_images(step.frame):
            return None
        try:
            return step_images(
                self._pictures.panorama(step.frame),
                self._pictures.omnidirectional(step.frame),
                self._pictures.panorama(step.match.best_frame) if step.match else None,
                shift=step.match.shift if step.match else 0,
                cells=self._cells,
            )
        except DatasetError as error:
            # Descriptions come from the cache, so that an image can have gone since; the results do not need it.
            self._picture_failure = self._picture_failure or str(error)
            return None


def _info(material: Material, config: Config, page: str) -> RecordingInfo:
    positions = material.positions
    extent = None
    if positions is not None:
        (x_min, y_min), (x_max, y_max) = positions.min(axis=0).tolist(), positions.max(axis=0).tolist()
        extent = (x_min, y_min, x_max, y_max)
    return RecordingInfo(
        name=f"{material.name} - {material.descriptor}",
        recording_id=str(uuid.uuid4()),
        steps=len(material.frames),
        mapper=config.mapper,
        cells=material.cells,
        description=page,
        properties={"source": material.source, **config.mapper.model_dump(mode="json")},
        extent=extent,
    )
