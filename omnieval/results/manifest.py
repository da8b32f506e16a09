"""``run.json``: what a folder of results holds, where it comes from, and how far it came.

Every folder that omnieval writes has one, whatever its kind; nothing is ever written into a folder that has something
else in it.
"""

from __future__ import annotations

import json
import os
import platform
from collections.abc import Iterable
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from omnieval.errors import ResultError
from omnieval.results.atomic import write_json
from omnieval.results.schemas import SCHEMA_VERSION

MANIFEST = "run.json"


class Manifest:
    """The manifest of a folder that is being written; its status is always true.

    Parameters
    ----------
    folder
        Created, with its parents.
    kind
        What the folder holds, in a word.
    content
        What is known at the start.
    files
        Names of all other files that a folder of this kind can hold; of an earlier one only these are removed.
    overwrite
        Whether an earlier folder of the same kind may be replaced.

    Raises
    ------
    ResultError
        If the folder holds something already or cannot be written.
    """

    def __init__(
        self, folder: Path, kind: str, content: dict[str, Any], *, files: Iterable[str], overwrite: bool
    ) -> None:
        _claim(folder, kind, files, overwrite=overwrite)
        self._path = folder / MANIFEST
        self.content: dict[str, Any] = {
            "schema_version": SCHEMA_VERSION,
            "kind": kind,
            "status": "running",
            "started": _now(),
            "process": {"pid": os.getpid(), "host": platform.node()},
            "metrics": {},
            **content,
        }
        write_json(self.content, self._path)

    def update(self, content: dict[str, Any]) -> None:
        """Say more."""
        self.content |= content
        write_json(self.content, self._path)

    def close(self, status: str, content: dict[str, Any]) -> None:
        """Say how it ended: ``complete``, ``interrupted`` or ``failed``."""
        self.update({**content, "status": status, "finished": _now()})


def read_manifest(folder: Path, kind: str) -> dict[str, Any]:
    """Return the manifest of a folder.

    Raises
    ------
    ResultError
        If it has none, or one of another kind or of a schema this version does not know.
    """
    path = folder / MANIFEST
    try:
        content = json.loads(path.read_text("utf-8"))
    except FileNotFoundError as error:
        raise ResultError(f"{folder} is not a run folder: it has no {MANIFEST}") from error
    except (OSError, ValueError) as error:
        raise ResultError(f"cannot read {path}: {error}; run it again") from error
    found = content.get("schema_version") if isinstance(content, dict) else None
    if found != SCHEMA_VERSION:
        raise ResultError(
            f"{path} has schema version {found}, this omnieval reads {SCHEMA_VERSION}; "
            "run it again or use the version that wrote it"
        )
    if content["kind"] != kind:
        raise ResultError(f"{folder} is a {content['kind']}, not a {kind}; name the folder of a {kind}")
    return dict(content)


def status_of(content: dict[str, Any]) -> str:
    """Return the status a manifest gives; a process that is dead does not run."""
    status: str = content["status"]
    return "interrupted" if status == "running" and not _alive(content["process"]) else status


def _claim(folder: Path, kind: str, files: Iterable[str], *, overwrite: bool) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        occupied = any(folder.iterdir())
    except OSError as error:
        raise ResultError(f"cannot write to {folder}: {error.strerror}; choose another --out") from error
    if not occupied:
        return
    if not (folder / MANIFEST).exists():
        raise ResultError(f"{folder} holds files that are not a {kind} of omnieval; choose another --out")
    read_manifest(folder, kind)
    if not overwrite:
        raise ResultError(f"{folder} holds a {kind} already; choose another --out or pass --overwrite")
    for name in (MANIFEST, *files):
        (folder / name).unlink(missing_ok=True)


def _alive(process: dict[str, Any]) -> bool:
    """Whether the process that writes a folder still exists, as far as this machine can tell."""
    if os.name != "posix" or process["host"] != platform.node():
        return True
    try:
        os.kill(process["pid"], 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        return True
    return True


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="seconds")
