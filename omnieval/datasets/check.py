"""`omnieval dataset check`: everything that is wrong with a sequence on disk, all at once.

===================== ======== =====================================================================
code                  severity meaning
===================== ======== =====================================================================
missing-folder        error    the path does not exist
not-a-folder          error    the path is a file
unreadable-folder     error    the folder cannot be listed
not-a-sequence        error    neither COLD nor images in it
several-sequences     error    holds more than one COLD sequence
missing-omni-cam      error    no ``omni_cam`` folder
empty                 error    no image at all
bad-name              error    an image's name does not parse
bad-label             error    a line of ``places.lst`` does not parse
conflicting-label     error    an image has two different labels
unreadable-labels     error    ``places.lst`` cannot be read
bad-pose-row          error    the heading or a row of a table of poses is wrong
bad-rotations         error    the rotations of a table of poses are none, or of another order
unclear-times         error    the times of a table of poses are too large for seconds, and have no unit
unreadable-poses      error    the file of poses cannot be read
poses-match-nothing   error    no row of a table of poses is of an image, by name or time
bad-card              error    the data card beside the data is wrong
missing-poses         error    the ground truth that the data card names is not there
labels-match-nothing  error    no label names an image that is there, or one of nearly the same time
several-poses         error    more than one file may hold the poses
rows-differ           error    poses without names and times are not one for each image
ambiguous-image       error    a row of a table of poses may mean several images
bad-camera            error    ``camera.toml`` is wrong
unreadable-image      error    the file cannot be read
empty-image           error    the file has no bytes
truncated-image       error    the file ends early
damaged-image         error    a checksum within the file is wrong (PNG), or a part was overwritten (JPEG)
not-an-image          error    the file cannot be decoded
not-a-picture         error    the file holds other numbers than grey levels
wrong-size            error    the image's size differs from the others'
missing-file          error    there is no such video or bag
unreadable-stream     error    a video or bag cannot be decoded, or has not what is asked of it
ends-early            warning  a video holds fewer frames than it announces
times-from-rate       warning  a video does not say when its frames were taken, only how many there are a second
no-times              warning  a video does not say even that
missing-image         warning  a label or pose names an image that is not there
bad-pose              warning  a pose is not finite, or no position in metres: the image counts as one without
duplicate-time        warning  two images were taken at the same time
names-not-in-order    warning  by its name an image comes after one that was taken later; the times decide
yaw-out-of-range      warning  a yaw that is probably not in radians
yaw-in-degrees        warning  a yaw without unit was taken for degrees
yaw-against-path      warning  the robot turns the other way than it drives: columns swapped, or yaw clockwise
unread-poses          warning  a file that is called like one of poses, of a form that is not read
poses-not-interpolated warning images without a pose have no time, either
bad-rotation          warning  a rotation is none: the image counts as one without heading
odd-rotations         warning  the rotations do not tell which way is up
other-poses           warning  another file beside the images might hold poses, too
image-without-label   warning  an image that ``places.lst`` does not name
image-without-pose    warning  an image without a pose where others have one
unread-times          warning  a table of the images' times that does not fit them, or several
image-without-time    warning  images that a table of times does not name
label-by-time         warning  a label that names an image of nearly the same time, and not this one
mixed-kinds           warning  an image of another kind than most: format, colours, or bits a channel
mixed-orientation     warning  an image that its EXIF orientation turns otherwise than most
turned-image          warning  an image that its EXIF orientation turns
few-bits              warning  an image of 16 bits a channel that uses fewer
no-contrast           warning  an image whose grey levels hardly differ
no-end-marker         warning  a JPEG without its last bytes, but with all of its pixels
twin                  warning  an image whose name differs from another's in words only, as a mask's does
unread-image          warning  an image of a kind that is not read
several-folders       warning  images lie in more than one folder
stray-file            warning  something else among the images
size-differs          warning  the images' size differs from the data card
count-differs         warning  the number of images differs from the data card
length-differs        warning  the path's length differs from the data card
no-labels             info     there is no ``places.lst``
no-poses              info     there is no file of poses, or no topic of poses was named
poses-read            info     what a file of poses was taken for, and how it was joined to the images
poses-interpolated    info     images between two poses
times-read            info     what a table of the images' times was taken for, and how it was joined to them
times-of-recording    info     images of a bag have no time of their own
===================== ======== =====================================================================

A BMP that was overwritten somewhere in its middle is not found: see `omnieval.datasets.images`.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from omnieval.cores import allotted
from omnieval.datasets.card_findings import card_findings, path_length, size_findings
from omnieval.datasets.findings import Finding, in_order
from omnieval.datasets.image_findings import image_findings
from omnieval.datasets.images import ImageReport, inspect_image, usual_size
from omnieval.datasets.registry import scan
from omnieval.datasets.sequence import Frame

Progress = Callable[[int, int], None]
"""Called with the number of images read and to read."""

_BATCH = 256


@dataclass(frozen=True)
class CheckReport:
    """What is there, and what is wrong with it.

    Attributes
    ----------
    source, name, root
        The sequence; `root` is the folder it lies in.
    card
        Name of its data card, if any.
    frames
        Number of frames.
    length_m
        Length of the driven path in metres, None unless every frame has a finite position.
    duration_s
        Seconds from the first frame to the last, None unless every frame has a time.
    spacing_m
        Mean distance of successive frames in metres, None without a length or with a single frame.
    image_size
        (width, height) in pixels of most images, None if none can be decoded.
    rooms
        Number of frames of each room, by name.
    findings
        All findings: errors, then warnings, then infos.
    """

    source: str
    name: str
    root: str
    card: str | None
    frames: int
    length_m: float | None
    duration_s: float | None
    spacing_m: float | None
    image_size: tuple[int, int] | None
    rooms: dict[str, int]
    findings: tuple[Finding, ...]

    @property
    def ok(self) -> bool:
        """Whether there is no error."""
        return all(finding.severity != "error" for finding in self.findings)


def check(source: str | Path, *, progress: Progress | None = None) -> CheckReport:
    """Check the sequence that `source` names: names, labels, poses, times, and every image.

    Raises
    ------
    DatasetError
        If `source` is of no known kind; whatever is wrong with the sequence itself is a finding.
    """
    found = scan(source)
    paths = [frame.path for frame in found.frames] + list(found.unnamed)
    reports = dict(zip(paths, _inspect_all(paths, progress), strict=True))
    size = usual_size(reports.values())
    length = path_length(found.frames)
    findings = [
        *found.findings,
        *image_findings(reports, found.root),
        *card_findings(found),
        *size_findings(size, found.expected_size),
    ]
    return CheckReport(
        source=found.source,
        name=found.name,
        root=str(found.root),
        card=found.card,
        frames=len(found.frames),
        length_m=length,
        duration_s=duration(found.frames),
        spacing_m=length / (len(found.frames) - 1) if length is not None and len(found.frames) > 1 else None,
        image_size=size,
        rooms=dict(sorted(Counter(frame.room for frame in found.frames if frame.room is not None).items())),
        findings=in_order(findings),
    )


def duration(frames: tuple[Frame, ...]) -> float | None:
    """Return the seconds between the first and the last frame; None unless every frame has a time."""
    times = [frame.time_ns for frame in frames if frame.time_ns is not None]
    if not frames or len(times) < len(frames):
        return None
    return (max(times) - min(times)) / 1e9


def _inspect_all(paths: list[Path], progress: Progress | None) -> Iterator[ImageReport]:
    """Inspect every image, in order; each thread holds one in memory."""
    done = 0
    with ThreadPoolExecutor(max_workers=allotted()) as pool:
        for start in range(0, len(paths), _BATCH):
            for report in pool.map(inspect_image, paths[start : start + _BATCH]):
                done += 1
                if progress is not None:
                    progress(done, len(paths))
                yield report
