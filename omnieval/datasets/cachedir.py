"""Where what can be computed again is kept."""

from __future__ import annotations

import os
from pathlib import Path

import platformdirs


def cache_dir() -> Path:
    """Return the cache folder: ``OMNIEVAL_CACHE`` if set, else the user's cache folder. It may not exist yet."""
    override = os.environ.get("OMNIEVAL_CACHE")
    return Path(override) if override else Path(platformdirs.user_cache_dir("omnieval", appauthor=False))
