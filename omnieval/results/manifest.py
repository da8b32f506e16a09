"""``run.json``: what a folder of results holds, where it comes from, how far it came, and which process writes it.

Every folder that omnieval writes has one, whatever its kind; `results.folder` writes it.
"""

from __future__ import annotations

import json
import os
import platform
from pathlib import Path
from typing import Any

from omnieval.errors import ResultError
from omnieval.results.schemas import SCHEMA_VERSION
from omnieval.wording import near_path

MANIFEST = "run.json"
_ALWAYS = {"status": str, "process": dict, "started": str, "metrics": dict}
"""The keys that every manifest has."""
_PROC = Path("/proc")
"""Where Linux shows its processes."""
_POSIX = os.name == "posix"
_ENDED = "ended"


def expanded(folder: str | Path) -> Path:
    """Return the path of a folder as it was given, with ``~`` for what it stands for.

    Raises
    ------
    ResultError
        If there is no such home folder.
    """
    try:
        return Path(folder).expanduser()
    except RuntimeError as error:
        raise ResultError(f"{folder}: there is no such home folder; write the path without ~") from error


def read_manifest(folder: Path, kind: str, *, oldest: int = SCHEMA_VERSION) -> dict[str, Any]:
    """Return the manifest of a folder, of a schema not older than `oldest`.

    Raises
    ------
    ResultError
        If it has none, or one of another kind or of a schema this version does not know.
    """
    path = folder / MANIFEST
    try:
        content = json.loads(path.read_text("utf-8"))
    except (FileNotFoundError, NotADirectoryError) as error:
        reason = f"it has no {MANIFEST}" if folder.is_dir() else f"there is no such folder; {near_path(folder)}"
        if folder.is_file():
            reason = f"it is a file; name the folder, {folder.parent}"
        raise ResultError(f"{folder} is not {_folder_of(kind)}: {reason}") from error
    except (OSError, ValueError) as error:
        raise ResultError(f"cannot read {path}: {error}; run it again") from error
    found = content.get("schema_version") if isinstance(content, dict) else None
    if type(found) is not int or not oldest <= found <= SCHEMA_VERSION:
        raise ResultError(
            f"{path} has schema version {found}, this omnieval reads {SCHEMA_VERSION}; "
            "run it again or use the version that wrote it"
        )
    if (other := content.get("kind")) != kind:
        word = with_article(other) if isinstance(other, str) and other else "of an unknown kind"
        raise ResultError(f"{folder} is {word}, not {with_article(kind)}; name the folder of {with_article(kind)}")
    if lacking := [name for name, type_ in _ALWAYS.items() if not isinstance(content.get(name), type_)]:
        raise ResultError(f"{path} is damaged: it has no {', '.join(lacking)}; run it again")
    return dict(content)


def kind_of(folder: str | Path) -> str | None:
    """Return the kind of results that a folder holds, such as ``replay``; None if it says no such thing."""
    try:
        content = json.loads((expanded(folder) / MANIFEST).read_text("utf-8"))
    except (OSError, ValueError):
        return None
    kind = content.get("kind") if isinstance(content, dict) else None
    return kind if isinstance(kind, str) and kind else None


def status_of(content: dict[str, Any]) -> str:
    """Return the status that a manifest of `read_manifest` gives; a process that is dead does not run."""
    status: str = content["status"]
    return "interrupted" if status == "running" and not is_alive(content["process"]) else status


def this_process() -> dict[str, Any]:
    """Return what tells this process from every other: its id, its machine, and when it was born."""
    return {"pid": os.getpid(), "host": platform.node(), "born": _born(os.getpid())}


def is_alive(process: dict[str, Any]) -> bool:
    """Whether a process of `this_process` still exists, as far as this machine can tell; if it cannot, it does."""
    pid = process.get("pid")
    if process.get("host") != platform.node() or not isinstance(pid, int) or pid < 1:
        return True
    try:
        if _POSIX:  # elsewhere this would end the process
            os.kill(pid, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except PermissionError:
        pass  # exists, of another user
    now, then = _born(pid), process.get("born")
    return now != _ENDED and (now is None or then is None or now == then)


def with_article(kind: str) -> str:
    """Return the kind of a folder with its article."""
    return f"{'an' if kind[0] in 'aeiou' else 'a'} {kind}"


def _folder_of(kind: str) -> str:
    return "a run folder" if kind == "replay" else f"{with_article(kind)} folder"


def _born(pid: int) -> str | None:
    """Return the boot and the tick at which a process was born, which no later one with its id shares.

    None where the system does not say; `_ENDED` if it has ended and only waits for its parent to notice.
    """
    if not _PROC.is_dir():
        return _born_elsewhere(pid)
    try:
        boot = (_PROC / "sys/kernel/random/boot_id").read_text("ascii").strip()
        fields = (_PROC / str(pid) / "stat").read_text("utf-8", "replace").rpartition(")")[2].split()
    except OSError:
        return None
    state, ticks = fields[0], fields[19]
    return _ENDED if state in {"Z", "X"} else f"{boot}/{ticks}"


def _born_elsewhere(pid: int) -> str | None:
    """Return when a process was born, on systems other than Linux; see `_born`."""
    import psutil

    try:
        process = psutil.Process(pid)
        return _ENDED if process.status() == psutil.STATUS_ZOMBIE else f"{process.create_time():.2f}"
    except (psutil.NoSuchProcess, OverflowError):
        return _ENDED
    except psutil.Error:
        return None
