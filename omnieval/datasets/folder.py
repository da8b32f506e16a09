"""Anyone's images: a folder of them, in natural order (file2 before file10).

The folder looks like this::

    my_panoramas/
      img_0001.png                   *.png, *.jpg, *.tif ..., upper or lower case
      ...
      poses.csv                      optional, or another file of poses, see `omnieval.datasets.trajectory`
      camera.toml                    optional, see `omnieval.datasets.cards.parse_camera`
      card.toml                      optional: a data card, whose [layout] says where else images and poses are

INNOVA, route 1 of Román et al., Appl. Sci. 2020, 10(18), 6480, doi 10.3390/app10186480, is such a folder. The original
files are not public and their layout is not known, so its packaged card takes what such a set plausibly is: images of
any name in the folder or below it, and one ``ground_truth.csv``, ``.txt`` or ``.mat`` with a row x,y,yaw an image. A
card beside the data (``innova.toml`` or ``card.toml``) says what differs.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from omnieval.datasets.camera_file import camera_beside
from omnieval.datasets.cards import Card, GroundTruth, Layout, card, overridden
from omnieval.datasets.findings import ROOT, Finding
from omnieval.datasets.names import natural_key, time_in_name, twins
from omnieval.datasets.poses import BY_HEADING, Capture, Table, file_key, scan_table
from omnieval.datasets.scan import (
    IMAGE_KINDS,
    Scan,
    called,
    canonical_path,
    exists,
    has_image_suffix,
    in_time,
    missing_folder,
    name_faults,
    pose_remarks,
    read_text,
    unread_remarks,
    visible_names,
)
from omnieval.datasets.sequence import Camera, Frame, Pose, wrapped
from omnieval.datasets.trajectory.load import posed_by_what_is_beside
from omnieval.datasets.trajectory.times import times_beside
from omnieval.errors import DatasetError
from omnieval.wording import safe_name, shown

OWN_CARD = "card.toml"
"""Name of a card beside the data."""
INNOVA = "innova"
INNOVA_CARD = "innova.toml"
"""Name of a card beside the images of INNOVA."""

_PLAIN = Card(name="folder", title="", get="", citation="", layout=Layout(images="*", ground_truth=BY_HEADING))
"""What is taken for granted where no card says otherwise."""


def scan_folder(path: str | Path) -> Scan:
    """Read as much of a folder of images as can be understood, and note every fault."""
    return _scan(canonical_path(path), "folder", _PLAIN, (OWN_CARD,))


def scan_innova(path: str | Path) -> Scan:
    """Read as much of an INNOVA sequence as can be understood, and note every fault."""
    return _scan(canonical_path(path), INNOVA, card(INNOVA), (INNOVA_CARD, OWN_CARD))


def _scan(root: Path, scheme: str, packaged: Card, own_cards: tuple[str, ...]) -> Scan:
    base = Scan(safe_name(root.name), f"{scheme}:{root}", root, card=None if packaged is _PLAIN else packaged.name)
    fault = missing_folder(root)
    if fault:
        return replace(base, findings=(fault,))
    try:
        known = _card(root, packaged, own_cards)
    except DatasetError as error:
        return replace(base, findings=(Finding("error", "bad-card", ROOT, str(error)),))
    layout = known.layout or Layout()
    camera, camera_faults = camera_beside(
        root, Camera("omnidirectional" if known.mirror else layout.kind, known.mirror)
    )
    matched = _matches(root, layout.images)
    if camera.mask is not None:
        matched = [name for name in matched if root / name != camera.mask]
    names = sorted(filter(has_image_suffix, matched), key=natural_key)
    if layout.ground_truth == BY_HEADING:
        times, remarks = times_beside(root, names)
        timed = _timed([Frame(root / name, name, times.get(name)) for name in names])
        posed, findings = posed_by_what_is_beside(root, timed)
        findings = [*remarks, *findings]
    else:
        captures, findings = _read_poses(root, names, layout.ground_truth)
        posed = _timed([_frame(root, name, captures.get(name)) for name in names])
    frames, time_findings = in_time(posed)
    faults = [*_name_faults(names, layout, own_cards[0]), *findings, *_spread_remarks(names), *unread_remarks(matched)]
    faults += [*_twin_remarks(names), *camera_faults]
    own = None if known is _PLAIN else known
    expected = known.sequence_at(root)
    return replace(
        base,
        frames=tuple(frames),
        camera=camera,
        findings=(*faults, *time_findings),
        card=own.name if own else None,
        card_sequence=expected.path if expected else None,
        own_card=own,
    )


def _card(root: Path, packaged: Card, own_cards: tuple[str, ...]) -> Card:
    """Return the packaged card, with what a card beside the data says in place of its own."""
    there = [file.name for name in own_cards if exists(file := called(root, name))]
    if len(there) > 1:
        raise DatasetError(f"both {there[0]} and {there[1]} are there; keep one")
    if not there:
        return packaged
    try:
        text = read_text(root / there[0])
    except DatasetError as error:
        raise DatasetError(f"data card {there[0]}: {error}") from error
    known = overridden(packaged, text, there[0])
    return known.model_copy(update={"name": there[0]}) if packaged is _PLAIN else known


def _matches(root: Path, pattern: str) -> list[str]:
    """Return what `pattern` matches, relative to `root`; nothing that is hidden."""
    if pattern == "*":
        return visible_names(root)
    try:
        relative = [path.relative_to(root) for path in root.glob(pattern)]
    except OSError:  # a name no file can have, for example one that is too long
        return []
    return sorted({path.as_posix() for path in relative if not any(part.startswith(".") for part in path.parts)})


def _name_faults(names: list[str], layout: Layout, own_card: str) -> list[Finding]:
    if names:
        return name_faults(names)
    plain = layout.images == "*"
    where = "in it" if plain else f"matches {shown(layout.images)}"
    what_to_do = "name the folder that holds them" if plain else f"set layout.images in {own_card}"
    return [Finding("error", "empty", ROOT, f"no image ({IMAGE_KINDS}) {where}; {what_to_do}")]


def _twin_remarks(names: list[str]) -> list[Finding]:
    return [
        Finding("warning", "twin", shown(name), f"is numbered like {shown(other)}; move masks, depth and so on away")
        for name, other in twins(names).items()
    ]


def _spread_remarks(names: list[str]) -> list[Finding]:
    folders = sorted({name.rpartition("/")[0] or "." for name in names})
    if len(folders) < 2:
        return []
    message = f"images lie in {len(folders)} folders ({', '.join(map(shown, folders[:3]))}); name one in layout.images"
    return [Finding("warning", "several-folders", ROOT, message)]


def _read_poses(root: Path, names: list[str], truth: GroundTruth | None) -> tuple[Mapping[str, Capture], list[Finding]]:
    """Return what is known of each image, by its name, and what is wrong with it."""
    if truth is None:
        message = "the card names no ground truth; position metrics will be null"
        return {}, [Finding("info", "no-poses", ROOT, message)]
    file = _poses_file(root, truth)
    if isinstance(file, Finding):
        return {}, [file]
    try:
        data = (root / file).read_bytes()
    except OSError as error:
        return {}, [Finding("error", "unreadable-poses", shown(file), f"cannot be read: {error.strerror or error}")]
    table, faults = scan_table(data, shown(file), truth)
    if table.columns is None:
        return {}, faults
    captures, findings = _matched(names, table)
    poses = ((f"{table.name}:{capture.line}", _with_yaw(capture.pose, table)) for capture in captures.values())
    return captures, [*faults, *findings, *pose_remarks(poses, largest_yaw=math.tau)]


def _poses_file(root: Path, truth: GroundTruth) -> str | Finding:
    """Return the name of the table of poses, or why there is none."""
    where = shown(truth.file)
    found = [
        name
        for name in _matches(root, truth.file)
        if name.casefold() not in (INNOVA_CARD, OWN_CARD) and not has_image_suffix(name)
    ]
    if len(found) == 1:
        return found[0]
    if found:
        message = f"matches {', '.join(map(shown, found[:3]))}; name one in layout.ground_truth.file"
        return Finding("error", "several-poses", where, message)
    if any(mark in truth.file for mark in "*?["):
        return Finding("info", "no-poses", where, "not there; position metrics will be null")
    return Finding("error", "missing-poses", where, "named in the card but not there; correct the card")


def _matched(names: list[str], table: Table) -> tuple[dict[str, Capture], list[Finding]]:
    """Return the captures by the images' names, and where images and rows do not agree."""
    if "file" in (table.columns or ()):
        captures, findings = _matched_by_name(names, table)
    elif len(names) != len(table.rows):
        message = f"{len(table.rows)} rows for {len(names)} images; one row per image, or a column for file, is needed"
        return {}, [Finding("error", "rows-differ", table.name, message)]
    else:
        paired = zip(names, table.rows, strict=True)
        captures, findings = {name: row.capture for name, row in paired if row.capture is not None}, []
    findings += [
        Finding("warning", "image-without-pose", shown(name), f"no pose in {table.name}")
        for name in names
        if name not in captures or captures[name].pose is None
    ]
    return captures, findings


def _matched_by_name(names: list[str], table: Table) -> tuple[dict[str, Capture], list[Finding]]:
    spellings = _spellings(names)
    captures: dict[str, Capture] = {}
    findings: list[Finding] = []
    for row in table.rows:
        if row.file is None or row.capture is None:
            continue
        where = f"{table.name}:{row.capture.line}"
        images = spellings.get(row.file, [])
        if not images:
            findings.append(Finding("warning", "missing-image", shown(row.file), f"named in {where} but not there"))
        elif len(images) > 1:
            message = f"{shown(row.file)} may be {shown(images[0])} or {shown(images[1])}; give the path"
            findings.append(Finding("error", "ambiguous-image", where, message))
        elif images[0] in captures:
            findings.append(Finding("error", "bad-pose-row", where, f"{shown(images[0])} has two rows; keep one"))
        else:
            captures[images[0]] = row.capture
    return captures, findings


def _spellings(names: list[str]) -> Mapping[str, list[str]]:
    """Return the images by every way to name them: path, name, and both without the ending; a path is the surest."""
    spellings: defaultdict[str, list[str]] = defaultdict(list)
    for name in names:
        path = Path(name)
        for spelling in {path.name, path.stem, path.with_suffix("").as_posix()}:
            spellings[file_key(spelling)].append(name)
    return {**spellings, **{file_key(name): [name] for name in names}}


def _with_yaw(pose: Pose | None, table: Table) -> Pose | None:
    """Return a pose that lacks no yaw only because no column tells it."""
    return pose if pose is None or "yaw" in (table.columns or ()) else replace(pose, yaw=0.0)


def _frame(root: Path, name: str, capture: Capture | None) -> Frame:
    if capture is None:
        return Frame(root / name, name)
    pose = capture.pose
    if pose is not None:
        pose = Pose(pose.x, pose.y, wrapped(pose.yaw))
    return Frame(root / name, name, capture.time_ns, pose, capture.room)


def _timed(frames: list[Frame]) -> list[Frame]:
    """Return frames with the times in their names, if each name holds one and no table told any."""
    if any(frame.time_ns is not None for frame in frames):
        return frames
    timed = []
    for frame in frames:
        time = time_in_name(frame.path.stem)
        if time is None:
            return frames
        timed.append(replace(frame, time_ns=time))
    return timed
