"""The recording as a sink of steps: gives the recorder what a step alone does not know.

Where and when the image was taken, the pictures, the silhouette so far, the pages in words.
"""

from __future__ import annotations

import threading
import uuid
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from queue import SimpleQueue
from typing import Any

from omnieval.datasets.sequence import Frame
from omnieval.errors import DatasetError
from omnieval.mapping.interface import Method
from omnieval.mapping.step import FinalMap, Step
from omnieval.material.material import Material
from omnieval.metrics.evaluation import Evaluation
from omnieval.metrics.running import SilhouetteSoFar
from omnieval.recording import RecordingOptions
from omnieval.recording.compression import StepImages, step_images
from omnieval.recording.recorder import Recorder, RecordingInfo
from omnieval.recording.rerun_stream import leave_behind
from omnieval.recording.viewport import Extent, extent_of, origin_of
from omnieval.results.summary import configuration_page, metrics_page

_Call = tuple[Future[Any], Callable[..., Any], tuple[Any, ...]]

_MOST_WAITING = 16
"""Steps that wait to be recorded at a time; bounds the memory, and what a viewer lags behind."""
_PATIENCE_S = 30.0
"""How long a viewer may not respond before the replay continues without the recording: a frozen one never responds."""


class RecordingSink:
    """Follows a replay into a Rerun recording.

    Nothing that goes wrong here changes a result: `failure` says what did.

    Parameters
    ----------
    path
        The recording to write; None to show it in a viewer only.
    material
        What is replayed.
    method
        The mapper: its parameters and the words of its evidence.
    options
        How much to record, and which viewer shows it live.

    Attributes
    ----------
    lacking
        Why a picture is missing; None while none is.

    Raises
    ------
    ResultError
        If the recording cannot be opened.
    """

    def __init__(self, path: Path | None, material: Material, method: Method, options: RecordingOptions) -> None:
        self.lacking: DatasetError | None = None
        self._pictures = material.pictures if options.images else None
        self._silhouette = SilhouetteSoFar(material.positions) if material.positions is not None else None
        said = _parameters(material, method) | _far_away(material)
        self._page = configuration_page(material.name, material.source, said, material.camera_about)
        self._cells = material.cells
        self._recorder = Recorder(path, _info(material, method, self._page), options)
        self._patience = _PATIENCE_S if options.spawn or options.connect else None
        self._left: str | None = None
        self._closed = False
        self._aside = _Aside("recorder")
        self._painter = ThreadPoolExecutor(1, thread_name_prefix="painter")
        self._waiting: deque[Future[None]] = deque()

    @property
    def failure(self) -> str | None:
        """What went wrong first, None if nothing did."""
        return self._left or self._recorder.failure or (str(self.lacking) if self.lacking else None)

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
            self._left = f"the viewer has not responded for {self._patience:g} s; `omnieval render` makes the recording"

    def _record(self, step: Step, frame: Frame, milliseconds: float, images: Future[StepImages | None]) -> None:
        silhouette = self._silhouette.apply(step) if self._silhouette else None
        self._recorder.log(step, frame, milliseconds, silhouette=silhouette, pictures=images.result())

    def _images(self, step: Step) -> StepImages | None:
        if self._pictures is None or not self._recorder.wants_images(step.frame):
            return None
        try:
            return step_images(
                self._pictures.panorama(step.frame),
                self._pictures.omnidirectional(step.frame),
                self._pictures.panorama(step.match.frame) if step.match else None,
                shift=step.match.shift if step.match else 0,
                cells=self._cells,
            )
        except DatasetError as error:
            # Descriptions come from the cache, so that an image can have gone since; the results do not need it.
            self.lacking = self.lacking or error
            return None


class _Aside:
    """Makes calls one after another in a thread of its own.

    Unlike the threads of `concurrent.futures`, it does not keep the process from ending when a call never returns.
    """

    def __init__(self, name: str) -> None:
        self._calls: SimpleQueue[_Call | None] = SimpleQueue()
        self._thread = threading.Thread(target=self._work, name=name, daemon=True)
        self._thread.start()

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Future[Any]:
        """Have a call made, after all that were submitted before."""
        future: Future[Any] = Future()
        self._calls.put((future, function, arguments))
        return future

    def end(self) -> None:
        """Let the thread end when it has made all calls, without waiting for that."""
        self._calls.put(None)

    def _work(self) -> None:
        while (call := self._calls.get()) is not None:
            future, function, arguments = call
            try:
                future.set_result(function(*arguments))
            except BaseException as error:  # whoever waits for the call gets it
                future.set_exception(error)


def _info(material: Material, method: Method, page: str) -> RecordingInfo:
    return RecordingInfo(
        name=f"{material.name} - {material.descriptor.name} - {method.name}",
        recording_id=str(uuid.uuid4()),
        steps=len(material.frames),
        method=method,
        cells=material.cells,
        description=page,
        properties={"source": material.source, **_parameters(material, method)},
        extent=_extent(material),
    )


def _extent(material: Material) -> Extent | None:
    return None if material.positions is None else extent_of(material.positions)


def _far_away(material: Material) -> dict[str, object]:
    """Return, as a parameter, what is subtracted from positions before they are drawn; nothing if that is nothing."""
    x, y = origin_of(_extent(material))
    return {"(0, 0) of the drawn map": f"({x:.0f}, {y:.0f}) m"} if x or y else {}


def _parameters(material: Material, method: Method) -> dict[str, object]:
    """Return what distinguishes a run from others over the same images."""
    return {"mapper": method.name, **method.settings, "descriptor": material.descriptor.name}
