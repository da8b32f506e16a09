"""Which file beside the images holds their poses, if the user names none."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from omnieval.datasets.findings import Finding
from omnieval.datasets.scan import visible_names
from omnieval.wording import shown

USUAL = "poses.csv"
"""What is taken whatever else is there."""
_STEMS = frozenset(
    [
        "poses",
        "pose",
        "groundtruth",
        "ground_truth",
        "gt",
        "trajectory",
        "traj",
        "cameratrajectory",
        "keyframetrajectory",
        "stamped_groundtruth",
        "stamped_traj_estimate",
        "odometry",
        "odom",
    ]
)
_ENDINGS = frozenset(("csv", "tsv", "txt"))
_OWN_ENDINGS = frozenset(("tum", "kitti"))
"""Endings that only files of poses have."""
_OTHER_ENDINGS = frozenset(
    ("json", "yaml", "yml", "xml", "mat", "npy", "pkl", "xlsx", "ods", "h5", "bin", "g2o", "parquet")
)
"""Of tables that are not read."""
_EUROC = ("state_groundtruth_estimate0/data.csv", "mav0/state_groundtruth_estimate0/data.csv")


def poses_beside(root: Path) -> tuple[Path | None, list[Finding]]:
    """Return the file of poses in a folder of images or, of well-known layouts, above it; and what to know of it.

    ``poses.csv`` in any case is taken first; of several other files none.
    """
    found = [root / name for name in visible_names(root) if _may_hold_poses(name)]
    found += [root / name for name in _EUROC if (root / name).is_file()]
    found = found or _above(root)
    usual = [path for path in found if path.name.casefold() == USUAL]
    chosen = usual or found
    if len(chosen) == 1:
        others = [path for path in found if path != chosen[0]]
        return chosen[0], [_ignored(chosen[0], others)] if others else []
    if chosen:
        names = ", ".join(shown(_relative(path, root)) for path in chosen[:4])
        message = f"{names} may all hold the poses; name one with --poses FILE, or a card.toml"
        return None, [Finding("error", "several-poses", shown(_relative(chosen[0], root)), message)]
    return None, [
        *_unread(root),
        Finding("info", "no-poses", USUAL, "not there; position metrics will be null"),
    ]


def _unread(root: Path) -> list[Finding]:
    """Return a finding for each file whose name says that it holds poses, in a form that is not read."""
    parts = ((name, *name.casefold().rpartition(".")[::2]) for name in visible_names(root))
    return [
        Finding("warning", "unread-poses", shown(name), "is not read; save it as CSV (file,x,y,yaw) or in TUM's form")
        for name, stem, ending in parts
        if stem in _STEMS and ending in _OTHER_ENDINGS
    ]


def _above(root: Path) -> list[Path]:
    """Return the poses of layouts with a folder for images alone: TUM's ``rgb``, EuRoC's ``cam0/data``."""
    if root.name == "data":
        return [path for name in _EUROC if (path := root.parent.parent / name).is_file()]
    if root.name.casefold() in {"rgb", "images", "image", "imgs"}:
        groundtruth = root.parent / "groundtruth.txt"
        return [groundtruth] if groundtruth.is_file() else []
    return []


def _may_hold_poses(name: str) -> bool:
    stem, _, ending = name.casefold().rpartition(".")
    return ending in _OWN_ENDINGS or (ending in _ENDINGS and stem in _STEMS)


def _ignored(chosen: Path, others: Sequence[Path]) -> Finding:
    names = ", ".join(shown(path.name) for path in others[:3])
    message = f"taken for the poses, not {names}; --poses FILE takes another"
    return Finding("warning", "other-poses", shown(chosen.name), message)


def _relative(path: Path, root: Path) -> str:
    return path.relative_to(root).as_posix() if path.is_relative_to(root) else path.as_posix()
