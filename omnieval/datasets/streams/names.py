"""Which paths are videos or bags, as their names tell; no library is needed to say so."""

from __future__ import annotations

from pathlib import Path

from omnieval.datasets.scan import has_image_suffix, visible_names

VIDEOS = frozenset({".mp4", ".m4v", ".mov", ".avi", ".mkv", ".webm", ".mpg", ".mpeg", ".wmv", ".mts", ".ogv"})
BAG_OF_ROS1 = ".bag"
STORAGES = frozenset({".mcap", ".db3"})
"""Files of a ROS 2 bag."""
METADATA = "metadata.yaml"
"""What the folder of a ROS 2 bag holds beside them."""


def is_video(path: Path) -> bool:
    """Tell whether `path` is named like a video."""
    return path.suffix.casefold() in VIDEOS and not _is_folder(path)


def is_bag(path: Path) -> bool:
    """Tell whether `path` is named like a bag, or is a folder that holds one and no images."""
    if _is_folder(path):
        names = visible_names(path)
        held = any(STORAGES & set(Path(name.casefold()).suffixes) for name in names)  # .db3.zstd is one too
        return held and (METADATA in names or not any(map(has_image_suffix, names)))
    return path.suffix.casefold() in {BAG_OF_ROS1, *STORAGES}


def bag_files(path: Path) -> list[Path]:
    """Return the files that a bag consists of, in the order of their names; none where nothing can be listed."""
    try:
        if not path.is_dir():
            return [path]
        return sorted(file for file in path.iterdir() if file.is_file() and not file.name.startswith("."))
    except OSError:
        return []


def _is_folder(path: Path) -> bool:
    try:
        return path.is_dir()
    except OSError:  # a name that is too long
        return False
