"""``run.json``: what a folder of results holds, where it comes from, and how far it came.

Every folder that omnieval writes has one, whatever its kind; nothing is ever written into a folder that has something
else in it, or that another process writes.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Self

from omnieval.errors import ResultError
from omnieval.results.atomic import is_temporary, write_json
from omnieval.results.ownership import FolderTakenError, Hold, is_alive, this_process
from omnieval.results.schemas import SCHEMA_VERSION

MANIFEST = "run.json"
_ALWAYS = {"status": str, "process": dict, "started": str, "metrics": dict}
"""What every manifest has."""


class Manifest:
    """The manifest of a folder that is being written; its status is always true.

    Parameters
    ----------
    folder
        Created, with its parents. Nobody else can write it until `release`, or until it is closed as anything but
        ``complete``.
    kind
        What the folder holds, in a word.
    content
        What is known at the start.
    files
        Names, or patterns like ``parts/*.json``, of all other files that a folder of this kind can hold; of an earlier
        one only these are removed.
    overwrite
        Whether an earlier folder of the same kind may be replaced.

    Raises
    ------
    ResultError
        If the folder holds something already, is being written, or cannot be written.
    """

    content: dict[str, Any]
    _path: Path
    _hold: Hold

    def __init__(
        self, folder: Path, kind: str, content: dict[str, Any], *, files: Iterable[str], overwrite: bool
    ) -> None:
        self._path = folder / MANIFEST
        self._hold = _entered(folder)
        try:
            _clear(folder, kind, files, overwrite=overwrite, hold=self._hold)
            self._begin(kind, {"started": _now(), **content})
        except BaseException:
            self._hold.release()
            raise

    @classmethod
    def reopen(cls, folder: Path, kind: str, content: dict[str, Any], *, files: Iterable[str]) -> Self:
        """Go on with a folder that was closed or whose process has died; there is a ``run.json`` at every moment.

        Parameters
        ----------
        folder, kind, content
            As above; when it was first started is kept.
        files
            Names of files that are not true any more, to be removed.

        Raises
        ------
        ResultError
            If there is no such folder, it is being written, or it cannot be written.
        """
        read_manifest(folder, kind)  # an error about the folder comes before one about its lock
        manifest = cls.__new__(cls)
        manifest._path = folder / MANIFEST
        manifest._hold = _entered(folder)
        try:
            earlier = read_manifest(folder, kind)
            _refuse_running(folder, earlier, manifest._hold)
            manifest._begin(kind, {"started": earlier["started"], "resumed": _now(), **content})
            _remove(folder, files)
        except BaseException:
            manifest._hold.release()
            raise
        return manifest

    def update(self, content: dict[str, Any]) -> None:
        """Say more."""
        together = self.content | content
        write_json(together, self._path)
        self.content = together

    def close(self, status: str, content: dict[str, Any]) -> None:
        """Say how it ended: ``complete``, ``interrupted`` or ``failed``."""
        try:
            self.update({**content, "status": status, "finished": _now()})
        finally:
            if status != "complete":
                self.release()

    @contextmanager
    def closing(self) -> Iterator[None]:
        """Say how the block ended, however it ends, and let others write the folder."""
        status = "failed"
        try:
            yield
            status = "complete"
        except KeyboardInterrupt:
            status = "interrupted"
            raise
        finally:
            try:
                self.close(status, {})
            finally:
                self.release()

    def release(self) -> None:
        """Let others write the folder."""
        self._hold.release()

    def _begin(self, kind: str, content: dict[str, Any]) -> None:
        self.content = {
            "schema_version": SCHEMA_VERSION,
            "kind": kind,
            "status": "running",
            "process": this_process(),
            "metrics": {},
            **content,
        }
        write_json(self.content, self._path)


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
        reason = f"it has no {MANIFEST}" if folder.is_dir() else "there is no such folder"
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
        word = _a(other) if isinstance(other, str) and other else "nothing we know"
        raise ResultError(f"{folder} is {word}, not {_a(kind)}; name the folder of {_a(kind)}")
    if lacking := [name for name, type_ in _ALWAYS.items() if not isinstance(content.get(name), type_)]:
        raise ResultError(f"{path} is damaged: it has no {', '.join(lacking)}; run it again")
    return dict(content)


def kind_of(folder: Path) -> str | None:
    """Return what a folder of results says it holds, in a word; None if it says no such thing."""
    try:
        content = json.loads((folder / MANIFEST).read_text("utf-8"))
    except (OSError, ValueError):
        return None
    kind = content.get("kind") if isinstance(content, dict) else None
    return kind if isinstance(kind, str) and kind else None


def status_of(content: dict[str, Any]) -> str:
    """Return the status that a manifest of `read_manifest` gives; a process that is dead does not run."""
    status: str = content["status"]
    return "interrupted" if status == "running" and not is_alive(content["process"]) else status


def refuse_running(folder: Path, content: dict[str, Any]) -> None:
    """See that nobody writes a folder, of which `content` is the manifest.

    Raises
    ------
    ResultError
        If somebody does.
    """
    hold = _entered(folder)
    try:
        _refuse_running(folder, content, hold)
    finally:
        hold.release()


def _entered(folder: Path) -> Hold:
    """Create a folder and hold it."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        return Hold(folder)
    except FolderTakenError as error:
        raise ResultError(
            f"{folder} is being written by another process; wait for it or choose another --out"
        ) from error
    except OSError as error:
        raise ResultError(f"cannot write to {folder}: {error.strerror}; choose another --out") from error


def _clear(folder: Path, kind: str, files: Iterable[str], *, overwrite: bool, hold: Hold) -> None:
    """See that the folder is free to be written, and remove an earlier one of the same kind if that is wanted."""
    try:
        present = list(folder.iterdir())
    except OSError as error:
        raise ResultError(f"cannot read {folder}: {error.strerror}; choose another --out") from error
    if all(is_temporary(path, of=MANIFEST) for path in present):  # whoever began here was killed before the first word
        _remove(folder, ())
        return
    if not (folder / MANIFEST).exists():
        raise ResultError(f"{folder} holds files that are not {_a(kind)} of omnieval; choose another --out")
    earlier = read_manifest(folder, kind, oldest=1)  # to be replaced it need not be understood whole
    _refuse_running(folder, earlier, hold)
    if not overwrite:
        raise ResultError(f"{folder} holds {_a(kind)} already; choose another --out or pass --overwrite")
    # Whoever looks while its files go, or after we were killed there, finds what is true of the rest.
    replaced = {"status": "interrupted", "reason": "it is being replaced by another run", "metrics": {}}
    write_json(earlier | replaced, folder / MANIFEST)
    _remove(folder, files)


def _remove(folder: Path, files: Iterable[str]) -> None:
    """Remove files of our own, the folders that become empty by it, and what killed processes left half-written."""
    try:
        ours = [path for pattern in files for path in folder.glob(pattern)]
        left = [path for pattern in (".*.tmp", "*/.*.tmp") for path in folder.glob(pattern) if is_temporary(path)]
        for path in (*ours, *left):
            path.unlink(missing_ok=True)
    except OSError as error:
        raise ResultError(f"cannot write to {folder}: {error.strerror}; choose another --out") from error
    within = {parent for path in ours for parent in path.parents if folder in parent.parents}
    for parent in sorted(within, key=lambda parent: len(parent.parts), reverse=True):
        with suppress(OSError):  # somebody else has something in it
            parent.rmdir()


def _refuse_running(folder: Path, content: dict[str, Any], hold: Hold) -> None:
    if not hold.certain and status_of(content) == "running":
        writer = content["process"]
        raise ResultError(
            f"{folder} is still being written by process {writer.get('pid')} on {writer.get('host')}; wait for it or "
            "choose another --out"
        )


def _a(kind: str) -> str:
    return f"{'an' if kind[0] in 'aeiou' else 'a'} {kind}"


def _folder_of(kind: str) -> str:
    return "a run folder" if kind == "replay" else f"{_a(kind)} folder"


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="seconds")
