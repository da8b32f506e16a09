"""From a source to its sequence: ``synthetic[:LIGHT[:N]]``, a scheme and a path such as ``cold:PATH``, or a path alone.

Options of videos and bags are part of the source; see `omnieval.datasets.source`.
"""

from __future__ import annotations

import pkgutil
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import cast

from omnieval.datasets.card_findings import card_findings
from omnieval.datasets.cold_folders import KNOWN_LAYOUTS, ImageFolders, find_images
from omnieval.datasets.findings import ROOT, Finding
from omnieval.datasets.perturbation import OPTIONS as OF_PERTURBATION
from omnieval.datasets.perturbation import perturbation_apart
from omnieval.datasets.scan import (
    IMAGE_KINDS,
    Scan,
    canonical_path,
    exists,
    has_image_suffix,
    missing_folder,
    visible_names,
)
from omnieval.datasets.sequence import Sequence
from omnieval.datasets.source import STREAMS, apart, parse, split, together, written
from omnieval.datasets.trajectory.load import OPTIONS, PoseOptions, with_poses
from omnieval.errors import DatasetError
from omnieval.wording import did_you_mean, near_path, safe_name, shown

DEFAULT_SOURCE = "synthetic"

_SCANNERS = {
    "synthetic": "omnieval.datasets.cold:scan_rendered",
    "cold": "omnieval.datasets.cold:scan_cold",
    "innova": "omnieval.datasets.folder:scan_innova",
    "folder": "omnieval.datasets.folder:scan_folder",
    "video": "omnieval.datasets.streams.video:scan_video",
    "bag": "omnieval.datasets.streams.bag:scan_bag",
}
"""Reader of each scheme, by its place, so that a reader is imported only when it is used."""

RESULTS_MANIFEST = "run.json"
"""What a folder of results holds, which is not a sequence."""

_WITHOUT_PATH = frozenset({"synthetic"})
_OF_ARCHIVES, _ENDING_OF_ARCHIVES = "npz:", ".npz"
"""What archives of descriptors are called, which are sources of the commands that need no images."""


def load(
    source: str | Path = DEFAULT_SOURCE,
    *,
    poses: str | Path | None = None,
    poses_tolerance: float | None = None,
    poses_interpolate: float | None = None,
) -> Sequence:
    """Load the sequence that `source` names. No image is read.

    Parameters
    ----------
    source
        As on the command line.
    poses, poses_tolerance, poses_interpolate
        A file of poses to take, and how; see `posed_source`.

    Raises
    ------
    DatasetError
        If the source is unknown, or the sequence is missing or faulty.
    """
    asked = posed_source(source, poses, poses_tolerance, poses_interpolate)
    found = scan(asked)
    sequence = replace(found, findings=(*found.findings, *card_findings(found))).sequence()
    perturbation = perturbation_apart(asked)[1] if isinstance(asked, str) else None
    return perturbation.applied(sequence) if perturbation and perturbation.written else sequence


def scan(source: str | Path) -> Scan:
    """Read as much of the sequence as can be understood, and note every fault; see `load`.

    What the source says of a perturbation is passed over: the images are looked at as they lie there.

    Raises
    ------
    DatasetError
        If the source is unknown, or has no path.
    """
    if isinstance(source, str):
        source, _ = perturbation_apart(source)
        bare, options = _options_of_poses(source)
        if options is not None:
            found = with_poses(scan(bare), options)
            return replace(found, source=together(found.source, options.written))
    if str(source).startswith(_OF_ARCHIVES) or str(source).casefold().endswith(_ENDING_OF_ARCHIVES):
        raise DatasetError(
            f"{shown(str(source))} holds descriptors and no images; `omnieval map` and `replay` check it"
        )
    scheme, rest = split_source(source)
    if scheme is None:
        return _scan_bare(rest)
    if not rest and scheme not in _WITHOUT_PATH:
        raise DatasetError(f"{scheme}: names no place; write {scheme}:PATH")
    return _scanner(scheme)(rest)


def split_source(source: str | Path) -> tuple[str | None, str]:
    """Return scheme (None for a bare path) and the rest of a source.

    Raises
    ------
    DatasetError
        If there is a scheme, and it is unknown.
    """
    if isinstance(source, Path):
        return None, str(source)
    scheme, colon, rest = source.partition(":")
    if scheme in _SCANNERS and (colon or scheme in _WITHOUT_PATH):
        return scheme, rest
    looks_like_scheme = colon and len(scheme) > 1 and scheme.isidentifier()
    if looks_like_scheme and not exists(canonical_path(source)):
        raise DatasetError(f"unknown source '{shown(source)}'; {did_you_mean(scheme, _SCANNERS)}")
    return None, source


def stream_scheme(rest: str) -> str | None:
    """Return the scheme of a bare path to a video or bag, with or without options; None if it names neither."""
    from omnieval.datasets.streams.names import is_bag, is_video

    path = canonical_path(split(rest)[0])
    return "video" if is_video(path) else "bag" if is_bag(path) else None


def with_options(source: str, options: Mapping[str, str]) -> str:
    """Return the source of a stream with options set, in place of those it has of the same names.

    Raises
    ------
    KeyError
        If the source has no option of a name; it is the error's argument.
    """
    scheme, rest = split_source(source)
    scheme = scheme or stream_scheme(rest)
    path, given = split(rest)
    known = STREAMS.get(scheme or "", ())
    for name in options:
        if name not in known:
            raise KeyError(name)
    return f"{scheme}:{written(path, {**given, **options})}"


def posed_source(
    source: str | Path,
    poses: str | Path | None = None,
    poses_tolerance: float | None = None,
    poses_interpolate: float | None = None,
) -> str | Path:
    """Return a source with the poses that are to be taken written into it, in place of those it names.

    Parameters
    ----------
    source
        As on the command line.
    poses
        A file of poses: TUM, KITTI, EuRoC, or a table with a heading (`omnieval.datasets.trajectory.read`).
    poses_tolerance
        How far an image may be from its pose in time, seconds; default half the median interval between images.
    poses_interpolate
        Interpolate between poses that are at most this many seconds apart.

    Examples
    --------
    >>> posed_source("folder:/data/tour", "/data/tour.tum")
    'folder:/data/tour#poses=/data/tour.tum'
    """
    values = {"poses": poses, "poses-tolerance": poses_tolerance, "poses-interpolate": poses_interpolate}
    given = {name: str(value) for name, value in values.items() if value is not None}
    return together(str(source), given) if given else source


def _options_of_poses(source: str) -> tuple[str, PoseOptions | None]:
    """Return a source without its options about poses, and these; None if it has none, or names a topic."""
    bare, given = apart(source, OPTIONS)
    if given and "poses" not in given and "pose-topic" in split(bare)[1]:
        return source, None
    return (bare, PoseOptions.of(given, source)) if given else (source, None)


def canonical(source: str) -> str:
    """Return a source as sequences record it, so that two names of one sequence are equal. No image is read.

    Raises
    ------
    DatasetError
        If the source is unknown, or a bare path holds no sequence.
    """
    source, perturbation = perturbation_apart(source)
    if perturbation.written:
        return together(canonical(source), perturbation.written)
    bare, options = _options_of_poses(source)
    if options is not None:
        return together(canonical(bare), options.written)
    scheme, rest = split_source(source)
    if scheme is None:
        scheme = stream_scheme(rest)
        return load(source).source if scheme is None else parse(scheme, rest).source
    if scheme in STREAMS:
        return parse(scheme, rest).source
    if scheme in _WITHOUT_PATH:  # asking for it would render the building
        from omnieval.datasets.synthetic import rendered

        return rendered(rest).source
    return f"{scheme}:{canonical_path(rest)}"


def place_of(source: str) -> Path | None:
    """Return where a canonical source lies; None for one that lies nowhere."""
    scheme, _, rest = apart(source, (*OPTIONS, *OF_PERTURBATION))[0].partition(":")
    return None if scheme in _WITHOUT_PATH else Path(split(rest)[0] if scheme in STREAMS else rest)


def _scanner(scheme: str) -> Callable[[str], Scan]:
    return cast("Callable[[str], Scan]", pkgutil.resolve_name(_SCANNERS[scheme]))


def _scan_bare(path: str) -> Scan:
    """Read what a path without a scheme names, by its content."""
    if not path:
        raise DatasetError(f"the source is empty; {did_you_mean('', _SCANNERS)}")
    if (stream := stream_scheme(path)) is not None:
        return _scanner(stream)(path)
    root = canonical_path(path)
    scheme = missing_folder(root) or _scheme_of(root)
    if isinstance(scheme, Finding):
        if scheme.code == "missing-folder":
            scheme = replace(scheme, message=_no_source(path))
        return Scan(safe_name(root.name), str(root), root, findings=(scheme,))
    return _scanner(scheme)(path)


def _scheme_of(root: Path) -> str | Finding:
    """Return which reader a folder is for: a card or poses beside the images decide, else names as in COLD."""
    from omnieval.datasets.cards import CAMERA_FILE
    from omnieval.datasets.folder import INNOVA_CARD, OWN_CARD
    from omnieval.datasets.poses import POSES_FILE

    names, cold = [name.casefold() for name in visible_names(root)], find_images(root)
    has_images = any(map(has_image_suffix, names))
    published = isinstance(cold, ImageFolders) and cold.layout == "published"
    if published or INNOVA_CARD in names:
        return "cold" if published else "innova"
    has_own = OWN_CARD in names or (has_images and {POSES_FILE, CAMERA_FILE} & set(names))
    if has_own:
        return "folder"
    if isinstance(cold, ImageFolders):
        return "cold"
    if has_images:
        return "folder"
    return cold if cold.code == "several-sequences" else _no_sequence(root, names)


def _no_sequence(root: Path, names: list[str]) -> Finding:
    """Return what to say of a folder without images."""
    message = f"neither a COLD sequence nor images ({IMAGE_KINDS}) in it; {KNOWN_LAYOUTS}"
    if RESULTS_MANIFEST in names:
        message = f"a folder of results, not of images; `omnieval view {shown(str(root))}` shows a run"
    return Finding("error", "not-a-sequence", ROOT, message)


def _no_source(path: str) -> str:
    """Return what to say of a path that is not there, but perhaps begins with the name of a data card."""
    from omnieval.datasets.cards import all_cards

    cards = {known.name: known for known in all_cards()}
    family, within, _ = path.partition("/")
    known = cards.get(family)
    if known is not None and known.archives and within:
        return f"no such folder; `omnieval dataset fetch {shown(path)}` downloads it and prints the folder"
    if known is not None and not within:
        example = known.sequences[0].path if known.sequences else "part_a/seq1_cloudy1"
        fetching = f", `omnieval dataset fetch {family}/{example}` downloads a sequence" if known.archives else ""
        return f"a data card, not a folder of images; `omnieval dataset info {family}` says where to get them{fetching}"
    if within:
        return f"no such folder; {near_path(Path(path))}"
    return f"no such folder, and not a source; {did_you_mean(path, [*_SCANNERS, *cards])}"
