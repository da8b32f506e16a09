"""Small results that are kept between processes, a file each: moved into place when whole, and read without locks."""

from __future__ import annotations

import hashlib
import json
import os
from contextlib import suppress
from pathlib import Path
from typing import Any


class Notes:
    """Plain values by key, in a folder that need not exist.

    Parameters
    ----------
    folder
        Where the files are.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def recall(self, key: str) -> dict[str, Any] | None:
        """Return what was noted; None if nothing was, or it is damaged."""
        try:
            note = json.loads(self._file(key).read_bytes())
            value = note["value"]
            whole = note["checksum"] == _checksum(key, value)
        except (OSError, ValueError, KeyError, TypeError):
            return None
        return value if whole and isinstance(value, dict) else None

    def remember(self, key: str, value: dict[str, Any]) -> None:
        """Note plain values.

        Raises
        ------
        OSError
            If they cannot be written.
        """
        file = self._file(key)
        self._folder.mkdir(parents=True, exist_ok=True)
        beside = file.with_name(f".{file.stem}.{os.getpid()}.tmp")
        try:
            beside.write_text(json.dumps({"value": value, "checksum": _checksum(key, value)}), "utf-8")
            beside.replace(file)
        finally:
            with suppress(OSError):
                beside.unlink(missing_ok=True)

    def _file(self, key: str) -> Path:
        return self._folder / f"{hashlib.blake2b(key.encode(), digest_size=16).hexdigest()}.json"


def _checksum(key: str, value: object) -> str:
    return hashlib.blake2b(json.dumps([key, value], sort_keys=True).encode(), digest_size=8).hexdigest()
