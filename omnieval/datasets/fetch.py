"""Sequences from the web: an archive is downloaded with pooch (continued where it stopped), checked and unpacked.

The part that an interrupted download has got is ``.NAME.tar.part``; the SHA-256 of an archive that could be unpacked is
kept beside its sequence in ``NAME.tar.sha256``, and every later download must have the same. The only file that imports
pooch.
"""

from __future__ import annotations

import json
import shutil
import tarfile
import tempfile
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

from omnieval.datasets.cards import Card, all_cards
from omnieval.datasets.scan import canonical_path
from omnieval.errors import ConfigError, DatasetError
from omnieval.locks import Lock, lock
from omnieval.wording import did_you_mean, shown

Progress = Callable[[int, int], None]
"""Called with the bytes that are there and those of the whole archive, 0 where that is not known."""

_PATIENCE = 3
"""Attempts in a row that bring nothing, after which the server is given up."""
_PIECE = 1 << 13
"""Bytes that are read at once, and lost where a connection breaks off."""
_TIMEOUT = (10, 60)
"""Seconds to wait for a connection, and for its next bytes."""
_COMPLETE, _PARTIAL, _NOT_FOUND, _BEYOND = 200, 206, 404, 416


def fetch(
    name: str, to: str | Path = "datasets", *, base_url: str | None = None, progress: Progress | None = None
) -> Path:
    """Download a sequence of a known family and return its folder; nothing is done if it is there.

    Parameters
    ----------
    name
        Card and path of the sequence, e.g. ``cold-freiburg/part_a/seq2_cloudy3``.
    to
        The folder to put it below, under that name. It appears there when it is complete.
    base_url
        Where archives lie if not where the card says: that of ``NAME`` at ``BASE_URL/NAME.tar``.
    progress
        Told how far the download is.

    Raises
    ------
    ConfigError
        If the name is not a sequence of a family that can be downloaded.
    DatasetError
        If the archive is not there, is not the one it was, or cannot be unpacked.
    """
    known, path = _named(name)
    base = base_url or known.archives
    if base is None:
        raise ConfigError(f"where {known.name} can be downloaded is not known; omnieval dataset info {known.name}")
    if not base.startswith(("http://", "https://")):
        raise ConfigError(f"--base-url {shown(base)} is not an address; it begins with https:// or http://")
    folder = canonical_path(to) / known.name / path
    if folder.is_dir():
        return folder
    archive = folder.with_name(f"{folder.name}.tar")
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        recorded = archive.with_name(f"{archive.name}.sha256")
        digest = _download(f"{base.rstrip('/')}/{known.name}/{path}.tar", archive, recorded, known, progress)
        _unpack(archive, folder)
        recorded.write_text(f"{digest}  {archive.name}\n", encoding="utf-8")
        archive.unlink()
    except OSError as error:
        raise DatasetError(
            f"cannot write to {folder.parent}: {error.strerror or error}; choose another --to"
        ) from error
    return folder


def _named(name: str) -> tuple[Card, str]:
    """Return the card and the path of a sequence within its family."""
    family, _, path = name.strip("/").partition("/")
    cards = {known.name: known for known in all_cards()}
    if family not in cards:
        raise ConfigError(f"no data card '{shown(family)}'; {did_you_mean(family, cards)}")
    known = cards[family]
    parts = path.split("/")
    if not path or {"", ".", ".."} & set(parts) or "\\" in path or not path.isprintable():
        example = known.sequences[0].path if known.sequences else "part_a/seq1_cloudy1"
        raise ConfigError(f"'{shown(name)}' names no sequence; write for example {known.name}/{example}")
    return known, path


def _download(url: str, archive: Path, recorded: Path, known: Card, progress: Progress | None) -> str:
    """Download an archive, if it is not there, and return its SHA-256."""
    import pooch

    expected = recorded.read_text("utf-8").split() if recorded.exists() else []
    pooch.get_logger().setLevel("WARNING")
    try:
        pooch.retrieve(
            url,
            known_hash=f"sha256:{expected[0]}" if expected else None,
            fname=archive.name,
            path=archive.parent,
            downloader=_Resuming(archive.with_name(f".{archive.name}.part"), known, progress or _ignore),
        )
    except ValueError as error:  # the checksum
        raise DatasetError(
            f"{url} is not the archive that was downloaded before: its SHA-256 is not that in {recorded}; remove that "
            "file if a change is expected, else use another --base-url"
        ) from error
    digest: str = pooch.file_hash(str(archive), alg="sha256")
    return digest


def _ignore(done: int, total: int) -> None:
    del done, total


@dataclass(frozen=True)
class _Resuming:
    """A downloader for pooch that continues where the last one stopped.

    Attributes
    ----------
    part
        What has been downloaded so far.
    known
        The card, for what to do where nothing can be downloaded.
    progress
        Told how far it is.
    """

    part: Path
    known: Card
    progress: Progress

    def __call__(self, url: str, output_file: str, pooch: Any, *, check_only: bool = False) -> None:
        """Download `url` to `output_file`."""
        import requests

        del pooch, check_only
        with self.part.open("ab") as written, self._alone():
            left = _PATIENCE
            while True:
                before = written.tell()
                try:
                    self._go_on(url, written)
                    break
                except requests.RequestException as error:
                    left = left - 1 if written.tell() <= before else _PATIENCE
                    if not left:
                        kept = written.tell()
                        hint = (
                            f"{kept} bytes are kept, so run the command again to go on"
                            if kept
                            else "check address and network"
                        )
                        raise DatasetError(f"{url} cannot be downloaded ({_reason(error)}); {hint}") from error
        shutil.move(self.part, output_file)
        self._version.unlink(missing_ok=True)

    @property
    def _version(self) -> Path:
        """What the server called the archive of which `part` is the beginning."""
        return self.part.with_name(f"{self.part.name}.json")

    def _alone(self) -> Lock:
        """Refuse to write where another process does."""
        try:
            return lock(self.part)
        except BlockingIOError as error:
            raise DatasetError(f"{self.part} is being written by another process; let it finish") from error

    def _go_on(self, url: str, written: IO[bytes]) -> None:
        """Download what is missing."""
        import requests

        headers = {"Accept-Encoding": "identity"}
        there = written.seek(0, 2)
        version = self._read_version() if there else None
        if version:
            headers |= {"Range": f"bytes={there}-", "If-Range": version}
        with requests.get(url, headers=headers, stream=True, timeout=_TIMEOUT) as answer:
            if answer.status_code == _BEYOND or (there and answer.status_code == _COMPLETE):
                written.truncate(there := written.seek(0))  # it is another archive now, or the server cannot go on
            if answer.status_code == _BEYOND:
                raise requests.ConnectionError("the archive has changed")
            if answer.status_code not in {_COMPLETE, _PARTIAL}:
                raise DatasetError(self._refusal(url, answer.status_code))
            if answer.status_code == _PARTIAL and f"bytes {there}-" not in answer.headers.get("Content-Range", ""):
                raise DatasetError(
                    f"{url} cannot be continued where it stopped; remove {self.part} and run the command again"
                )
            self._write_version(answer.headers)
            length = int(answer.headers.get("Content-Length") or 0)
            total = there + length if length else 0
            for piece in answer.iter_content(_PIECE):
                written.write(piece)
                self.progress(written.tell(), total)
            written.flush()
            if written.tell() < total:
                raise requests.ConnectionError("the connection was lost")

    def _refusal(self, url: str, status: int) -> str:
        if status != _NOT_FOUND:
            return (
                f"{url} cannot be downloaded: the server answers {status}; try again later, or use another --base-url"
            )
        homepage = self.known.homepage or f"omnieval dataset info {self.known.name}"
        return f"there is no {url}; look for the sequence at {homepage}, or name a mirror with --base-url"

    def _read_version(self) -> str | None:
        try:
            version = json.loads(self._version.read_text("utf-8"))
        except (OSError, ValueError):
            return None
        return version if isinstance(version, str) else None

    def _write_version(self, headers: Any) -> None:
        """Keep what If-Range takes: a strong ETag, else when the archive was changed."""
        tag = headers.get("ETag")
        version = tag if tag and not tag.startswith("W/") else headers.get("Last-Modified")
        self._version.write_text(json.dumps(version), encoding="utf-8")


def _reason(error: Exception) -> str:
    """Return the message of the innermost error, which is the shortest."""
    while isinstance(error.args[0] if error.args else None, Exception):
        error = error.args[0]
    reason = getattr(error, "reason", error)
    words = next((part for part in reason.args if isinstance(part, str)), str(reason))
    return shown(words) or type(error).__name__


def _unpack(archive: Path, folder: Path) -> None:
    """Unpack an archive into `folder`, which appears when it is complete; a folder that is all it holds is left out."""
    if not hasattr(tarfile, "data_filter"):
        raise ConfigError("this Python unpacks no archive safely; use 3.11.4 or newer")
    with tempfile.TemporaryDirectory(prefix=f".{folder.name}-", dir=folder.parent) as scratch:
        draft = Path(scratch) / "archive"
        draft.mkdir()
        try:
            with tarfile.open(archive) as opened:
                opened.extractall(draft, filter="data")
        except tarfile.FilterError as error:
            archive.unlink()
            raise DatasetError(
                f"the archive of {folder.name} is not safe and was removed: {shown(str(error))}"
            ) from error
        except (tarfile.TarError, EOFError) as error:
            archive.unlink()
            raise DatasetError(
                f"what was downloaded for {folder.name} is not a sound archive and was removed ({shown(str(error))}); "
                "use another --base-url"
            ) from error
        root = draft
        while len(inner := list(root.iterdir())) == 1 and inner[0].is_dir() and _only_wraps(inner[0]):
            root = inner[0]
        with suppress(FileExistsError):
            root.rename(folder)


def _only_wraps(folder: Path) -> bool:
    """Tell whether a folder that is alone in its archive is the sequence or holds it, and is not a part of it."""
    return folder.name not in {"omni_cam", "std_cam", "localization", "odom_scans"}
