"""Folders of results as they are written: one writer at a time, a true status, and no files of others touched.

All that omnieval writes as a folder is written by `ResultFolder`: replays, baselines, ablations and reports. Folders of
results may lie inside others, a report in what it reports on, the best run in its ablation: when the outer one is
written again they go with it, because what they say would not be true any more.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from omnieval.errors import OmnievalError, ResultError
from omnieval.locks import Lock, lock
from omnieval.results.atomic import is_temporary, write_json
from omnieval.results.manifest import MANIFEST, expanded, read_manifest, status_of, this_process, with_article
from omnieval.results.schemas import SCHEMA_VERSION

REPORT = "report"
"""The kind of a report, and where it goes inside the first of what it reports on."""
PAGE = "index.html"
FIGURES = "figures"
_OF_REPORT = re.compile(rf"{re.escape(PAGE)}|{FIGURES}/\d{{2,}}-[\w-]+\.(svg|png|csv)")


class ResultFolder:
    """A folder of results that no other process can write while the block lasts; its status is always true.

    When the block is left before `complete`, the folder is closed as ``interrupted`` (Ctrl-C) or ``failed``, with the
    `reason`. Afterwards others can write it, whatever happened.

    Parameters
    ----------
    path
        Created, with its parents.
    kind
        The kind of what the folder holds, such as ``replay``.
    content
        What is known at the start. None holds the folder and leaves it as it is until `begin`.
    files
        Names, or patterns like ``parts/*.json``, of the files of an earlier folder that go, besides ``run.json`` and
        the report in it.
    overwrite
        Whether an earlier folder of the same kind may be replaced.
    resume
        Go on with an earlier folder of the same kind, which must be there; the report in it stays.

    Raises
    ------
    ResultError
        On entering: if the folder holds something already (or nothing to continue with), is being written, or cannot
        be.

    Examples
    --------
    >>> with ResultFolder("out", "baseline", {"frames": 9}, files=["baseline.parquet"]) as folder:  # doctest: +SKIP
    ...     folder.update({"half": "done"})
    ...     folder.complete({"metrics": {"nodes": 7}})
    """

    path: Path
    content: dict[str, Any]
    """What ``run.json`` says; empty until it is begun."""

    def __init__(
        self,
        path: str | Path,
        kind: str,
        content: dict[str, Any] | None = None,
        *,
        files: Iterable[str] = (),
        overwrite: bool = False,
        resume: bool = False,
    ) -> None:
        self.path = expanded(path)
        self.content = {}
        self._kind, self._first, self._files = kind, content, tuple(files)
        self._overwrite, self._resume = overwrite, resume
        self._earlier: dict[str, Any] | None = None
        self._made = False
        self._lock: Lock | None = None

    def __enter__(self) -> Self:
        if self._resume:
            read_manifest(self.path, self._kind)  # an error about the folder comes before one about its lock
        certain = self._hold()
        try:
            self._earlier = self._find_earlier(certain=certain)
            if self._first is not None:
                self.begin(self._first)
        except BaseException as error:
            self.__exit__(type(error), error, None)
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            if self.content.get("status") == "running":
                self._close_early(error)
        finally:
            if self._made and not self.content:
                with suppress(OSError):  # somebody has put something there
                    self.path.rmdir()
            if self._lock is not None:
                self._lock.release()
                self._lock = None

    def begin(self, content: dict[str, Any], files: Iterable[str] = ()) -> None:
        """Remove what an earlier folder left and say that it is being written; there is a ``run.json`` at every moment.

        `files` are names or patterns of more that is to go.

        Raises
        ------
        ResultError
            If the folder cannot be written, or a folder inside that is to be removed is being written.
        """
        inside = [] if self._resume else report_inside(self.path)
        began = {"started": _now()}
        if self._earlier is not None:
            # Whoever looks while its files go, or after we were killed there, finds what is true of the rest.
            replaced = {"status": "interrupted", "reason": "it is being written again", "metrics": {}}
            write_json(self._earlier | replaced, self.path / MANIFEST)
            if self._resume:
                began = {"started": self._earlier["started"], "resumed": _now()}
        _remove(self.path, (*self._files, *inside, *files))
        about = {"schema_version": SCHEMA_VERSION, "kind": self._kind, "status": "running", "process": this_process()}
        self.update({**about, "metrics": {}, **began, **content})

    def update(self, content: dict[str, Any]) -> None:
        """Add entries to ``run.json``, and write it."""
        together = self.content | content
        write_json(together, self.path / MANIFEST)
        self.content = together

    def complete(self, content: dict[str, Any] | None = None) -> None:
        """Mark the folder as complete; what happens in the block from now on does not change that."""
        self._close("complete", content or {})

    def _close(self, status: str, content: dict[str, Any]) -> None:
        self.update({**content, "status": status, "finished": _now()})

    def _close_early(self, error: BaseException | None) -> None:
        """Close a folder that was left early. An error here may be the one that ended it, which is reported."""
        sealed: dict[str, Any] = {}
        with suppress(Exception):
            sealed = self._seal()
        with suppress(ResultError):
            status = "interrupted" if isinstance(error, KeyboardInterrupt) else "failed"
            self._close(status, {"reason": reason_of(error), **sealed})

    def _seal(self) -> dict[str, Any]:
        """Finish the files of a folder that does not reach its end, and return what is known for ``run.json``."""
        return {}

    def _hold(self) -> bool:
        """Lock the folder, and return whether the lock is certain.

        It is a lock of the system, until this process ends, however it ends: none can stay behind, and no process id be
        mistaken. Where the file system has no locks, ``run.json`` alone says which process writes.
        """
        try:
            if not self._resume:
                self._made = not self.path.exists()
                self.path.mkdir(parents=True, exist_ok=True)
            self._lock = lock(self.path)
        except BlockingIOError as error:
            raise ResultError(f"{self.path} is being written by another process; {self._advice()}") from error
        except OSError as error:
            raise ResultError(f"cannot write to {self.path}: {error.strerror}; choose another --out") from error
        return self._lock.certain

    def _find_earlier(self, *, certain: bool) -> dict[str, Any] | None:
        """Return the manifest of the earlier folder that this one may replace or continue with; None if it is free."""
        if self._resume:
            earlier = read_manifest(self.path, self._kind)
        elif self._is_free():
            return None
        else:
            earlier = read_manifest(self.path, self._kind, oldest=1)  # to be replaced it need not be understood whole
        if not certain and status_of(earlier) == "running":
            writer = earlier["process"]
            by = f"process {writer.get('pid')} on {writer.get('host')}"
            raise ResultError(f"{self.path} is still being written by {by}; {self._advice()}")
        if not self._overwrite and not self._resume:
            raise ResultError(
                f"{self.path} holds {with_article(self._kind)} already; choose another --out or pass --overwrite"
            )
        return earlier

    def _is_free(self) -> bool:
        """Whether the folder is empty; files of a process that was killed before it wrote ``run.json`` do not count.

        Raises
        ------
        ResultError
            If it holds files that omnieval did not write.
        """
        try:
            present = list(self.path.iterdir())
            if all(is_temporary(path, of=MANIFEST) for path in present):
                return True
            if (self.path / MANIFEST).exists():
                return False
        except OSError as error:
            raise ResultError(f"cannot read {self.path}: {error.strerror}; choose another --out") from error
        raise ResultError(
            f"{self.path} holds files that are not {with_article(self._kind)} of omnieval; choose another --out"
        )

    def _advice(self) -> str:
        return "wait for it" if self._resume else "wait for it or choose another --out"


def hold_folder(folder: str | Path, kind: str = "replay") -> ResultFolder:
    """Return a context manager that keeps others from writing a folder, while something in it is written again.

    ``run.json`` stays as it is. Entering raises `ResultError` if it is no such folder, or another process writes it.

    Examples
    --------
    >>> with hold_folder("runs/house-hog"):  # doctest: +SKIP
    ...     write_the_recording_again()
    """
    return ResultFolder(folder, kind, resume=True)


def reason_of(error: BaseException | None) -> str:
    """Return in one line why something did not reach its end."""
    if error is None:
        return "it was left before its end"
    if isinstance(error, KeyboardInterrupt):
        return "interrupted by the user"
    said = " ".join(str(error).split())
    return said if isinstance(error, OmnievalError) else f"{type(error).__name__}: {said}".removesuffix(": ")


def report_files(folder: Path) -> list[str]:
    """Return the files that a report in the folder says it wrote, as far as they can be a report's."""
    try:
        files = json.loads((folder / MANIFEST).read_text("utf-8"))["files"]
    except (OSError, ValueError, KeyError, TypeError):
        return []
    if not isinstance(files, list):
        return []
    return [name for name in files if isinstance(name, str) and _OF_REPORT.fullmatch(name)]


def report_inside(folder: Path) -> list[str]:
    """Return all files of the report inside a folder of results, relative to it; see `results_inside`."""
    return results_inside(folder, REPORT, REPORT, report_files(folder / REPORT))


def results_inside(folder: Path, name: str, kind: str, files: Iterable[str]) -> list[str]:
    """Return all files of the results inside other results, relative to these; none if there are no such results.

    Parameters
    ----------
    folder
        The outer folder.
    name, kind
        Name of the inner folder, and which kind it must hold to count as one of omnieval's.
    files
        Names or patterns of all that it can hold besides ``run.json``.

    Raises
    ------
    ResultError
        If it is being written.
    """
    inner = folder / name
    try:
        read_manifest(inner, kind)
    except ResultError:
        return []
    if inner.is_symlink():  # it lies elsewhere, and may belong to something else
        return []
    with hold_folder(inner, kind):
        return [f"{name}/{file}" for file in (*files, MANIFEST)]


def _remove(folder: Path, files: Iterable[str]) -> None:
    """Remove files that omnieval wrote, the incomplete ones of killed processes, and the folders that become empty."""
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


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="seconds")
