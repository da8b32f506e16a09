"""What a recorder is told: about the run once, about every step, and how to record it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from omnieval.errors import ConfigError

from omnieval.mapping.interface import Method
from omnieval.mapping.step import Step


@dataclass(frozen=True)
class RecordingOptions:
    """How much to record, and who watches.

    Attributes
    ----------
    images
        Whether pictures are recorded.
    every
        Pictures and similarity curves are recorded every so many steps; numbers and words always are.
    spawn
        Start a viewer on this machine, reachable from this machine only, and show the replay in it.
    connect
        URL of a running viewer that shows the replay, e.g. ``rerun+http://127.0.0.1:9876/proxy``.

    Raises
    ------
    ConfigError
        If `every` is not positive, or both `spawn` and `connect` are asked for.
    """

    images: bool = True
    every: int = 1
    spawn: bool = False
    connect: str | None = None

    def __post_init__(self) -> None:
        if self.every < 1:
            raise ConfigError(f"a recording logs every k-th picture with k at least 1, got {self.every}")
        if self.spawn and self.connect is not None:
            raise ConfigError("a replay is shown in a new viewer or in a running one: choose spawn or connect")

    @property
    def live(self) -> bool:
        """Whether somebody watches while the replay runs."""
        return self.spawn or self.connect is not None


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
        (x min, y min, x max, y max) of the capture positions, metres; where the map view looks. None without poses.
    """

    name: str
    recording_id: str
    steps: int
    method: Method
    cells: int
    description: str
    properties: Mapping[str, str | float | int] = field(default_factory=dict)
    extent: tuple[float, float, float, float] | None = None


@dataclass(frozen=True)
class StepView:
    """A step and what only its surroundings know: where and when it was taken, what the map is worth so far.

    Attributes
    ----------
    step
        The mapper's evidence.
    milliseconds
        What the step cost.
    position
        Ground-truth (x, y), metres; None without pose.
    yaw
        Ground-truth heading, radians, counter-clockwise; None without pose.
    room
        Room label; None where there is none.
    time_ns
        Time of capture, nanoseconds since the epoch; None where unknown.
    silhouette
        Silhouette of the map so far; None where it cannot be computed.
    file
        Name of the image; empty where there is none.
    """

    step: Step
    milliseconds: float
    position: tuple[float, float] | None
    yaw: float | None
    room: str | None
    time_ns: int | None
    silhouette: float | None
    file: str = ""

    @property
    def capture(self) -> Capture:
        """What is known of the image besides its pixels."""
        x, y = self.position or (None, None)
        return Capture(self.step.frame, self.file, self.time_ns, x, y, self.yaw, self.room)


@dataclass(frozen=True)
class StepImages:
    """The pictures of a step, compressed to JPEG; `pictures.step_images` makes them.

    Attributes
    ----------
    panorama
        The new image, unwrapped.
    omnidirectional
        The new image as the camera took it; None for panoramic input.
    match
        Panorama of the most similar image of the map, turned to the new image's heading; None without a match.
    """

    panorama: bytes
    omnidirectional: bytes | None
    match: bytes | None
