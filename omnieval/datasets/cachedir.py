"""Where what can be computed again is kept."""

from __future__ import annotations

import os
from pathlib import Path

import platformdirs

from omnieval.datasets.scan import canonical_path


def cache_dir() -> Path:
    """Return the cache folder: ``OMNIEVAL_CACHE`` if set, else the user's cache folder. It may not exist yet."""
    override = os.environ.get("OMNIEVAL_CACHE")
    return canonical_path(override or platformdirs.user_cache_dir("omnieval", appauthor=False))


def stream_folder(cache: Path) -> Path:
    """Return the folder within a cache that holds the images of videos and bags."""
    return cache / "streams"
