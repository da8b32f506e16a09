"""What a dataset hands on: a `Sequence` of `Frame`, of which only names are known until one is read."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from omnieval.datasets.findings import Finding
from omnieval.errors import DatasetError

_Cut = tuple[int, int, int | None]


@dataclass(frozen=True, slots=True)
class Pose:
    """Ground-truth pose of a capture, in the dataset's own frame.

    x and y in metres, yaw in radians, counter-clockwise, in (-pi, pi], NaN where unknown.
    """

    x: float
    y: float
    yaw: float


@dataclass(frozen=True, slots=True)
class Mirror:
    """Where the mirror lies in an omnidirectional image, in pixels (x right, y down).

    The annulus between `r_in` (edge of the camera's own reflection) and `r_out` (mirror rim) is what
    the robot sees.
    """

    cx: float
    cy: float
    r_in: float
    r_out: float


@dataclass(frozen=True, slots=True)
class Disturbance:
    """What a camera is off by; see `datasets.perturbation`.

    `offset` is by how much the mirror's centre is believed to lie elsewhere, pixels (right, down); `noise` the standard
    deviation of noise in every pixel, grey levels; `gain` what grey levels are multiplied by; `seed` that of the noise.
    """

    offset: tuple[float, float] = (0.0, 0.0)
    noise: float = 0.0
    gain: float = 1.0
    seed: int = 0

    @property
    def of_pixels(self) -> dict[str, float | int] | None:
        """What determines how pixels are changed, as plain values; None if they are not."""
        if not self.noise and self.gain == 1.0:
            return None
        return {"noise": self.noise, "gain": self.gain, **({"seed": self.seed} if self.noise else {})}


@dataclass(frozen=True, slots=True)
class Camera:
    """What a dataset knows about its images before one is read.

    `auto` means that the images themselves decide; `mirror` None means that it has to be estimated from the
    images. `belt` are the rows of panoramas to use (`datasets.belt`), `mask` an image file that is white where the
    scene is seen (`imaging.mask`), `told_by` the file that says so, in words, `disturbance` what it is off by.
    """

    kind: Literal["omnidirectional", "panoramic", "auto"] = "auto"
    mirror: Mirror | None = None
    belt: str | None = None
    mask: Path | None = None
    told_by: str = field(default="", compare=False)
    disturbance: Disturbance | None = None


@dataclass(frozen=True, slots=True)
class Frame:
    """One capture: an image file and what its name and labels say about it.

    `file` is the name results are recorded under (relative to the sequence, ``/`` as separator), `time_ns`
    nanoseconds since the epoch. `bits` is how many of 16 bits a channel the images of the
    sequence use, None where that is not known or they have fewer.
    """

    path: Path
    file: str
    time_ns: int | None = None
    pose: Pose | None = None
    room: str | None = None
    bits: int | None = None

    def read(self) -> bytes:
        """Return the bytes of the image file.

        Raises
        ------
        DatasetError
            If the file cannot be read.
        """
        try:
            return self.path.read_bytes()
        except OSError as error:
            raise DatasetError(f"cannot read image {self.path}: {error.strerror or error}") from error


@dataclass(frozen=True)
class Sequence:
    """Frames in the order in which the robot took them.

    Attributes
    ----------
    name
        Short name for run folders and tables, e.g. ``seq2_cloudy3``; a plain file name, never a path.
    source
        The source that loads this sequence again, e.g. ``cold:/data/seq2_cloudy3``.
    root
        The folder the frames come from.
    frames
        The frames to replay.
    camera
        What is known of the camera.
    calibration
        Frames of the whole sequence, whatever the cut, from which the camera is estimated: the first `FIRST_FRAMES`,
        and if there are more, as many spread evenly over all of it, for a robot that stands still at first.
    card
        Name of the data card that describes the sequence's family, if any.
    findings
        What is odd about it (an error among them would have forbidden to load it), whatever the cut.
    expected_size
        (width, height) of its images in pixels, as the data card says; None if it does not.
    cut_from
        (start, stride, limit) that cut this sequence out of the whole one at once, (0, 1, None) for the whole.
    perturbation
        What was changed of it (`datasets.perturbation`), as its source says it; empty if nothing was.
    """

    name: str
    source: str
    root: Path
    frames: tuple[Frame, ...]
    camera: Camera = Camera()
    calibration: tuple[Frame, ...] = ()
    card: str | None = None
    findings: tuple[Finding, ...] = ()
    expected_size: tuple[int, int] | None = None
    cut_from: _Cut = (0, 1, None)
    perturbation: str = ""

    FIRST_FRAMES = 64

    def __post_init__(self) -> None:
        if not self.calibration:
            object.__setattr__(self, "calibration", (*self.frames[: self.FIRST_FRAMES], *self._spread()))

    def __len__(self) -> int:
        return len(self.frames)

    def cut(self, *, start: int = 0, stride: int = 1, limit: int | None = None) -> Sequence:
        """Return every `stride`-th frame from `start` on (negative: from the end), at most `limit` of them.

        Raises
        ------
        DatasetError
            If nothing is left, or `stride` or `limit` is negative.
        """
        if (start, stride, limit) == (0, 1, None):
            return self
        start = max(0, len(self) + start) if start < 0 else start
        wanted = stride > 0 and (limit is None or limit > 0)
        frames = self.frames[start::stride][:limit] if wanted else ()
        if not frames:
            raise DatasetError(
                f"{self.source}: start {start}, stride {stride}, limit {limit} leave none of its {len(self)} frames"
            )
        return dataclasses.replace(self, frames=frames, cut_from=_composed(self.cut_from, (start, stride, limit)))

    @property
    def positions(self) -> NDArray[np.float64] | None:
        """Capture positions, shape (n, 2), metres; NaN where unknown, None where none is known."""
        return positions_of(self.frames)

    @property
    def yaws(self) -> NDArray[np.float64] | None:
        """Headings, shape (n,), radians; NaN where unknown, None where none is known."""
        poses = (frame.pose for frame in self.frames)
        yaws = np.array([math.nan if pose is None else pose.yaw for pose in poses])
        return yaws if np.isfinite(yaws).any() else None

    @property
    def rooms(self) -> tuple[str | None, ...]:
        """Room label of every frame, None where there is none."""
        return tuple(frame.room for frame in self.frames)

    def _spread(self) -> tuple[Frame, ...]:
        """Return frames spread evenly over a sequence that has more than the first ones."""
        first, count = self.FIRST_FRAMES, len(self.frames)
        if count <= first:
            return ()
        return tuple(self.frames[index * (count - 1) // (first - 1)] for index in range(first))


def positions_of(frames: Iterable[Frame]) -> NDArray[np.float64] | None:
    """Return capture positions, shape (n, 2), metres, NaN where unknown or not finite; None where none is known."""
    poses = (frame.pose for frame in frames)
    values = np.array([(math.nan, math.nan) if pose is None else (pose.x, pose.y) for pose in poses])
    known = np.isfinite(values).all(axis=-1)
    if not known.any():
        return None
    values[~known] = math.nan
    return values


def wrapped(yaw: float) -> float:
    """Return `yaw` in (-pi, pi], radians; a value that is not finite unchanged."""
    if not math.isfinite(yaw) or -math.pi < yaw <= math.pi:
        return yaw
    turned = math.remainder(yaw, math.tau)
    return math.pi if turned <= -math.pi else turned


def _composed(first: _Cut, then: _Cut) -> _Cut:
    """Return the one cut that leaves what `then` leaves of what `first` left."""
    limits = [] if then[2] is None else [then[2]]
    if first[2] is not None:
        limits.append(len(range(then[0], first[2], then[1])))
    return first[0] + then[0] * first[1], first[1] * then[1], min(limits, default=None)
