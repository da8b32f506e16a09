"""A stream as a sequence: its images in the cache, its name and faults those of the file."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from omnieval.datasets.cards import CAMERA_FILE, parse_camera
from omnieval.datasets.scan import ROOT, Finding, Scan, exists, read_text, time_remarks
from omnieval.datasets.source import Address
from omnieval.datasets.streams.store import Contents, decoded
from omnieval.errors import DatasetError
from omnieval.wording import safe_name


def scan_stream(address: Address, files: Sequence[Path], decode: Callable[[Path], Contents]) -> Scan:
    """Return the sequence in a stream, decoding it if need be; a ``camera.toml`` beside it tells its camera.

    Parameters
    ----------
    address
        The stream.
    files
        The files it consists of.
    decode
        See `store.decoded`. What it raises does not name the stream.
    """
    base = Scan(safe_name(address.path.stem), address.source, address.path)
    if not exists(address.path):
        return replace(base, faults=(Finding("error", "missing-file", ROOT, "no such file; check the path"),))
    try:
        folder, contents = decoded(address, files, decode)
        camera_file = address.path.parent / CAMERA_FILE
        camera = parse_camera(read_text(camera_file)) if exists(camera_file) else base.camera
    except DatasetError as error:
        return replace(base, faults=(Finding("error", "unreadable-stream", ROOT, str(error)),))
    remarks = (*contents.findings, *time_remarks(contents.frames))
    return replace(base, root=folder, frames=contents.frames, camera=camera, remarks=remarks)
