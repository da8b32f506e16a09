"""What a dataset reader finds in a folder: the frames, and every fault, so that a check can show them all."""

from __future__ import annotations

import math
import os
from collections.abc import Iterable
from collections.abc import Sequence as Frames
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

from omnieval.datasets.findings import ROOT, Finding, errors
from omnieval.datasets.sequence import Camera, Frame, Pose, Sequence
from omnieval.errors import DatasetError
from omnieval.wording import near_path, shown

if TYPE_CHECKING:
    from omnieval.datasets.cards import Card

IMAGE_SUFFIXES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".webp", ".pgm", ".ppm")
_UNREAD_SUFFIXES = (
    *(".gif", ".heic", ".heif", ".avif", ".jp2", ".jxl", ".jpe", ".jfif", ".tga", ".svg", ".pbm", ".pnm", ".pfm"),
    *(".exr", ".hdr", ".raw", ".dng", ".cr2", ".cr3", ".nef", ".arw", ".raf", ".orf", ".rw2", ".insp"),
)
"""Endings of images that are known, and not read."""
IMAGE_KINDS = ", ".join(suffix.removeprefix(".") for suffix in IMAGE_SUFFIXES)
"""The kinds of images that are read, as messages list them."""
FARTHEST_M = 3e7
"""No map of the Earth has larger coordinates, UTM included: one beyond is a slip, such as a time."""


@dataclass(frozen=True)
class Scan:
    """A sequence as far as names and labels tell, faults included. No image has been read.

    Attributes
    ----------
    name, source, root, camera, card
        As in `Sequence`.
    frames
        What could be understood, in the order in which the robot took it.
    findings
        What is wrong with it, or odd; with an error among them it cannot be loaded.
    unnamed
        Image files that are no frames because their names do not parse.
    card_sequence
        Path of the sequence on its data card, if it is one of those.
    own_card
        The card beside the data that stands in place of the packaged one, if any.
    """

    name: str
    source: str
    root: Path
    frames: tuple[Frame, ...] = ()
    camera: Camera = field(default_factory=Camera)
    findings: tuple[Finding, ...] = ()
    unnamed: tuple[Path, ...] = ()
    card: str | None = None
    card_sequence: str | None = None
    own_card: Card | None = None

    @property
    def known_card(self) -> Card | None:
        """The card that describes it, if any."""
        from omnieval.datasets.cards import card  # pydantic takes longer to load than many a folder to read

        return self.own_card or (card(self.card) if self.card else None)

    @property
    def expected_size(self) -> tuple[int, int] | None:
        """(width, height) of the images in pixels as its card says."""
        return self.known_card.image_size if self.known_card else None

    def sequence(self) -> Sequence:
        """Return the sequence.

        Raises
        ------
        DatasetError
            If there are errors; it names the first and counts the rest.
        """
        if faults := errors(self.findings):
            raise DatasetError(refusal(faults, root=str(self.root), source=self.source))
        return Sequence(
            name=self.name,
            source=self.source,
            root=self.root,
            frames=self.frames,
            camera=self.camera,
            card=self.card,
            findings=self.findings,
            expected_size=self.expected_size,
        )


def place_of(path: Path, root: Path) -> str:
    """Return where an image lies relative to the folder of its sequence; the whole path if it lies elsewhere."""
    return shown((path.relative_to(root) if path.is_relative_to(root) else path).as_posix())


def refusal(faults: tuple[Finding, ...], *, root: str, source: str) -> str:
    """Return the one line that refuses to load: the first fault, and how to see the others.

    `root` is put before places within the sequence, unless it is empty.
    """
    first, others = faults[0], len(faults) - 1
    elsewhere = first.where.startswith("/")
    place = first.where if elsewhere else "/".join(part for part in (root, first.where) if part not in ("", ROOT))
    line = f"{shown(place)}: {first.message}"
    if not others:
        return line
    return f"{line} (and {others} more: `omnieval dataset check {shown(source)}` shows all)"


def canonical_path(path: str | Path) -> Path:
    """Return `path` absolute, so that it means the same from any working directory.

    Symbolic links keep the name the user gave them: it names the sequence and finds its data card.

    Raises
    ------
    DatasetError
        If it cannot be made absolute (no home directory, links in a circle).
    """
    if "\0" in str(path):
        raise DatasetError(f"{shown(str(path))}: not a usable path (it holds a null character)")
    try:
        expanded = Path(path).expanduser()
        return expanded.resolve() if ".." in expanded.parts else expanded.absolute()
    except (OSError, RuntimeError) as error:
        raise DatasetError(f"{shown(str(path))}: not a usable path ({error})") from error


def exists(path: Path) -> bool:
    """Tell whether there is something at `path`; nothing is where a name is too long or may not be looked up."""
    try:
        return path.exists()
    except OSError:
        return False


def missing_folder(path: Path) -> Finding | None:
    """Return what is wrong with `path` as a folder to read, None if it can be listed."""
    if not exists(path):
        hint = "a shell expands * only in a path without a scheme" if "*" in str(path) else near_path(path)
        return Finding("error", "missing-folder", ROOT, f"no such folder; {hint}")
    if not path.is_dir():
        return Finding("error", "not-a-folder", ROOT, "not a folder; name the folder that holds the sequence")
    try:
        next(path.iterdir(), None)
    except OSError as error:
        return Finding("error", "unreadable-folder", ROOT, f"cannot be listed: {error.strerror or error}")
    return None


def visible_names(folder: Path) -> list[str]:
    """Return the names in `folder` that are not hidden, sorted; empty if it is not a folder one may list."""
    try:
        with os.scandir(folder) as entries:  # iterdir makes a path of each, which takes longer than all the rest
            return sorted(entry.name for entry in entries if not entry.name.startswith("."))
    except OSError:
        return []


def called(folder: Path, name: str) -> Path:
    """Return the file of a name in a folder, or the one whose name differs in upper and lower case only.

    Raises
    ------
    DatasetError
        If there are several of the latter.
    """
    alike = [one for one in visible_names(folder) if one.casefold() == name.casefold()]
    if name in alike or not alike:
        return folder / name
    if len(alike) > 1:
        raise DatasetError(f"both {shown(alike[0])} and {shown(alike[1])} are there; keep one")
    return folder / alike[0]


def read_text(path: Path) -> str:
    """Return the text in `path`.

    Raises
    ------
    DatasetError
        If it cannot be read; the message does not name the file.
    """
    try:
        return path.read_text(encoding="utf-8-sig")
    except ValueError as error:
        raise DatasetError("not UTF-8 text; save it as UTF-8") from error
    except OSError as error:
        raise DatasetError(f"cannot be read: {error.strerror or error}") from error


def has_image_suffix(name: str) -> bool:
    """Tell whether `name` ends like an image file, in upper or lower case."""
    return name.casefold().endswith(IMAGE_SUFFIXES)


def unread_remarks(names: Iterable[str]) -> list[Finding]:
    """Return a finding for each image of a kind that is not read."""
    return [
        Finding("warning", "unread-image", shown(name), f"is not read; convert it to one of {IMAGE_KINDS}")
        for name in names
        if name.casefold().endswith(_UNREAD_SUFFIXES)
    ]


def pose_remarks(poses: Iterable[tuple[str, Pose | None]], *, largest_yaw: float = math.pi) -> list[Finding]:
    """Return what is odd about poses and the places they were found at.

    A yaw may be unknown, NaN; up to `largest_yaw` radians are expected.
    """
    remarks: list[Finding] = []
    for where, pose in poses:
        if pose is None:
            continue
        if not (math.isfinite(pose.x) and math.isfinite(pose.y)) or math.isinf(pose.yaw):
            message = "the pose is not finite and left out; correct or remove it"
            remarks.append(Finding("warning", "bad-pose", where, message))
        elif max(abs(pose.x), abs(pose.y)) > FARTHEST_M:
            message = f"({pose.x:g}, {pose.y:g}) is not a position in metres and left out; correct it"
            remarks.append(Finding("warning", "bad-pose", where, message))
        elif abs(pose.yaw) > largest_yaw:
            message = f"yaw {pose.yaw:g} is beyond {largest_yaw:.6g}; expected radians"
            remarks.append(Finding("warning", "yaw-out-of-range", where, message))
    return remarks


def name_faults(names: list[str]) -> list[Finding]:
    """Return a finding for every file name that is not valid Unicode."""
    message = "the name is not valid Unicode, so no table can hold it; rename the file"
    return [
        Finding("error", "bad-name", shown(name), message)
        for name in names
        if not name.isascii() and any("\ud800" <= letter <= "\udfff" for letter in name)
    ]


def in_time(frames: Frames[Frame], *, below: str = "") -> tuple[list[Frame], list[Finding]]:
    """Return frames in the order of their times, and what is odd about these.

    Parameters
    ----------
    frames
        In the order of their names. One without a time stays behind the one it follows.
    below
        Put before the frames' files.
    """
    times = _filled([frame.time_ns for frame in frames])
    order = sorted(range(len(frames)), key=lambda index: (times[index], index))
    timed = [frame for frame in frames if frame.time_ns is not None]
    findings = [
        Finding(
            "warning",
            "names-not-in-order",
            f"{below}{shown(later.file)}",
            f"comes after {shown(earlier.file)} by name, but was taken before it; the order of times is taken",
        )
        for earlier, later in pairwise(timed)
        if (later.time_ns or 0) < (earlier.time_ns or 0)
    ]
    findings += [
        Finding("warning", "duplicate-time", f"{below}{shown(b.file)}", f"taken at the same time as {shown(a.file)}")
        for a, b in pairwise(sorted(timed, key=lambda frame: frame.time_ns or 0))
        if a.time_ns == b.time_ns
    ]
    return [frames[index] for index in order], findings


def _filled(times: Frames[int | None]) -> list[int]:
    """Return times without gaps: that of the one before, or at the beginning of the first that is known."""
    last = next((time for time in times if time is not None), 0)
    filled = []
    for time in times:
        last = last if time is None else time
        filled.append(last)
    return filled
