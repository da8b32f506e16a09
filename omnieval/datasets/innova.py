"""INNOVA, route 1 of Román et al., Appl. Sci. 2020, 10(18), 6480, doi 10.3390/app10186480, Table 1.

The original files are not public and their layout is not known. This reader therefore takes what such a set
plausibly is, images and one file of ground truth, and leaves the particulars to the data card: whoever has the
original edits a card, not code. As the packaged card has it, a sequence is a folder like this::

    innova/route_1/
      image_1.png ...                images of any name, in subfolders or not, in natural order
      ground_truth.csv               optional; or .txt (white space) or .mat: x,y,yaw, one row an image
      innova.toml                    optional: a card (also ``card.toml``) with what differs

The card's ``[layout]`` is described in `omnieval.datasets.layout`.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from omnieval.datasets.cards import Card, card, overridden
from omnieval.datasets.folder import natural_key
from omnieval.datasets.ground_truth import Row, scan_ground_truth
from omnieval.datasets.layout import GroundTruth, Layout
from omnieval.datasets.poses import Capture, file_key, wrapped
from omnieval.datasets.scan import (
    ROOT,
    Finding,
    Scan,
    canonical_path,
    has_image_suffix,
    missing_folder,
    name_faults,
    pose_remark,
    time_remarks,
)
from omnieval.datasets.sequence import Camera, Frame, Pose, Sequence
from omnieval.errors import DatasetError
from omnieval.wording import safe_name, shown

CARD = "innova"
OWN_CARDS = ("innova.toml", "card.toml")
"""Names of a card beside the data."""

_FORBIDDING = frozenset(
    {"bad-pose-row", "unreadable-poses", "missing-poses", "several-poses", "rows-differ", "ambiguous-image"}
)
"""Findings on the ground truth after which no pose can be trusted to be that of its image."""


@dataclass(frozen=True, slots=True)
class _Truth:
    """The ground truth file that was read: its name, its rows, and whether they name their images."""

    name: str
    rows: list[Row]
    names_images: bool
    has_yaw: bool


def read_innova(path: str | Path) -> Sequence:
    """Read the sequence in folder `path` as its card describes it; no image is read.

    Raises
    ------
    DatasetError
        If there is no image, the card is wrong, or images and ground truth do not belong together.
    """
    return scan_innova(path).sequence()


def is_innova(path: Path) -> bool:
    """Tell whether `path` is a folder with a card of its own."""
    return any((path / name).is_file() for name in OWN_CARDS)


def scan_innova(path: str | Path) -> Scan:
    """Read as much of the sequence as can be understood, and note every fault."""
    root = canonical_path(path)
    base = Scan(safe_name(root.name), f"innova:{root}", root, card=CARD)
    fault = missing_folder(root)
    if fault:
        return replace(base, faults=(fault,))
    try:
        known = _card(root)
    except DatasetError as error:
        return replace(base, faults=(Finding("error", "bad-card", ROOT, str(error)),))
    layout = known.layout or Layout()
    names = _image_names(root, layout.images)
    faults = name_faults(names)
    if not names:
        message = f"no image (png, jpg, jpeg, bmp) matches {shown(layout.images)}; set layout.images in {OWN_CARDS[0]}"
        faults.append(Finding("error", "empty", ROOT, message))
    remarks = _spread_remarks(names)
    truth, truth_findings = _read_truth(root, layout.ground_truth)
    captures: Mapping[str, Capture] = {}
    if truth is not None:
        captures, match_findings = _matched(names, truth)
        truth_findings = truth_findings + match_findings + _pose_remarks(captures, truth)
    frames = tuple(_frame(root, name, captures.get(name)) for name in names)
    faults += [finding for finding in truth_findings if finding.code in _FORBIDDING]
    remarks += [finding for finding in truth_findings if finding.code not in _FORBIDDING] + time_remarks(frames)
    return replace(
        base,
        frames=frames,
        camera=_camera(known, layout),
        faults=tuple(faults),
        remarks=tuple(remarks),
        card_sequence=expected.path if (expected := known.sequence_at(root)) else None,
        own_card=known,
    )


def _card(root: Path) -> Card:
    """Return the packaged card, with what a card beside the data says in place of its own."""
    known = card(CARD)
    own = [name for name in OWN_CARDS if (root / name).exists()]
    if len(own) > 1:
        raise DatasetError(f"both {own[0]} and {own[1]} are there; keep one")
    return overridden(known, _read_text(root / own[0]), own[0]) if own else known


def _read_text(path: Path) -> str:
    try:
        return path.read_bytes().decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise DatasetError(f"data card {path.name} is not UTF-8 text; save it as UTF-8") from error
    except OSError as error:
        raise DatasetError(f"data card {path.name} cannot be read: {error.strerror or error}") from error


def _camera(known: Card, layout: Layout) -> Camera:
    """Return what the card says of the images; a mirror makes them omnidirectional."""
    kind = "omnidirectional" if known.mirror is not None else layout.kind
    return Camera(kind, known.mirror)


def _image_names(root: Path, pattern: str) -> list[str]:
    """Return the images that `pattern` matches, relative to `root`, in natural order; nothing that is hidden."""
    return sorted(filter(has_image_suffix, _matches(root, pattern)), key=natural_key)


def _matches(root: Path, pattern: str) -> list[str]:
    try:
        relative = [path.relative_to(root) for path in root.glob(pattern) if not _is_folder(path)]
    except OSError:  # a name no file can have, for example one that is too long
        return []
    return sorted({path.as_posix() for path in relative if not any(part.startswith(".") for part in path.parts)})


def _is_folder(path: Path) -> bool:
    try:
        return path.is_dir()
    except OSError:  # it may not even be looked at; reading it will say so
        return False


def _spread_remarks(names: list[str]) -> list[Finding]:
    folders = sorted({str(Path(name).parent) for name in names})
    if len(folders) < 2:
        return []
    message = f"images lie in {len(folders)} folders ({', '.join(map(shown, folders[:3]))}); name one in layout.images"
    return [Finding("warning", "several-folders", ROOT, message)]


def _read_truth(root: Path, truth: GroundTruth | None) -> tuple[_Truth | None, list[Finding]]:
    """Return the ground truth (None without a readable file) and what is wrong with it."""
    if truth is None:
        return None, [
            Finding("info", "no-poses", ROOT, "the card names no ground truth; position metrics will be null")
        ]
    found = [name for name in _matches(root, truth.file) if name not in OWN_CARDS and not has_image_suffix(name)]
    where = shown(truth.file)
    if len(found) > 1:
        message = f"matches {', '.join(map(shown, found[:3]))}; name one in layout.ground_truth.file"
        return None, [Finding("error", "several-poses", where, message)]
    if not found:
        if any(mark in truth.file for mark in "*?["):
            return None, [Finding("info", "no-poses", where, "not there; position metrics will be null")]
        return None, [Finding("error", "missing-poses", where, "named in the card but not there; correct the card")]
    try:
        data = (root / found[0]).read_bytes()
    except OSError as error:
        message = f"cannot be read: {error.strerror or error}"
        return None, [Finding("error", "unreadable-poses", shown(found[0]), message)]
    rows, faults = scan_ground_truth(data, shown(found[0]), truth)
    readable = all(fault.code != "unreadable-poses" for fault in faults)
    read = _Truth(shown(found[0]), rows, names_images="file" in truth.columns, has_yaw="yaw" in truth.columns)
    return (read if readable else None), faults


def _matched(names: list[str], truth: _Truth) -> tuple[dict[str, Capture], list[Finding]]:
    """Return what is known of each image, by its name, and where images and rows do not agree."""
    if truth.names_images:
        return _matched_by_name(names, truth)
    if len(names) != len(truth.rows):
        message = f"{len(truth.rows)} rows for {len(names)} images; one row an image, or a column for file, is needed"
        return {}, [Finding("error", "rows-differ", truth.name, message)]
    paired = zip(names, truth.rows, strict=True)
    captures = {name: row.capture for name, row in paired if row.capture is not None}
    return captures, _poseless_remarks(names, captures, truth)


def _matched_by_name(names: list[str], truth: _Truth) -> tuple[dict[str, Capture], list[Finding]]:
    spellings = _spellings(names)
    captures: dict[str, Capture] = {}
    findings: list[Finding] = []
    for row in truth.rows:
        if row.file is None or row.capture is None:
            continue
        where = f"{truth.name}:{row.capture.line}"
        images = spellings.get(row.file, [])
        if not images:
            findings.append(Finding("error", "missing-image", shown(row.file), f"named in {where} but not there"))
        elif len(images) > 1:
            message = f"{shown(row.file)} may be {shown(images[0])} or {shown(images[1])}; give the path"
            findings.append(Finding("error", "ambiguous-image", where, message))
        elif images[0] in captures:
            message = f"{shown(images[0])} has two rows; keep one"
            findings.append(Finding("error", "bad-pose-row", where, message))
        else:
            captures[images[0]] = row.capture
    return captures, findings + _poseless_remarks(names, captures, truth)


def _spellings(names: list[str]) -> Mapping[str, list[str]]:
    """Return the images by every way to name them: path, name, and both without the ending; a path is the surest."""
    spellings: defaultdict[str, list[str]] = defaultdict(list)
    for name in names:
        path = Path(name)
        for spelling in {path.name, path.stem, path.with_suffix("").as_posix()}:
            spellings[file_key(spelling)].append(name)
    return {**spellings, **{file_key(name): [name] for name in names}}


def _poseless_remarks(names: list[str], captures: Mapping[str, Capture], truth: _Truth) -> list[Finding]:
    return [
        Finding("warning", "image-without-pose", shown(name), f"no pose in {truth.name}")
        for name in names
        if name not in captures or captures[name].pose is None
    ]


def _pose_remarks(captures: Mapping[str, Capture], truth: _Truth) -> list[Finding]:
    remarks: list[Finding | None] = []
    for capture in captures.values():
        if capture.pose is not None:
            pose = capture.pose if truth.has_yaw else replace(capture.pose, yaw=0.0)
            remarks.append(pose_remark(pose, f"{truth.name}:{capture.line}", largest_yaw=math.tau))
    return [remark for remark in remarks if remark is not None]


def _frame(root: Path, name: str, capture: Capture | None) -> Frame:
    if capture is None:
        return Frame(root / name, name)
    pose = capture.pose
    if pose is not None:
        pose = Pose(pose.x, pose.y, wrapped(pose.yaw))
    return Frame(root / name, name, capture.time_ns, pose, capture.room)
