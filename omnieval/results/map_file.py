"""A map on disk: ``map.npz`` (arrays, uncompressed, nothing that executes when loaded) and ``map.json`` beside it.

Orientation descriptors are nearly all of it, 16 kB per image of 256 cells x 16 bins.
"""

from __future__ import annotations

import contextlib
import json
import tempfile
import zipfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from types import TracebackType
from typing import IO, Any, Self

import numpy as np
import polars as pl
from numpy.typing import NDArray

from omnieval.descriptors.description import Description
from omnieval.errors import ResultError
from omnieval.mapping.map import ARRAYS, StreamedArray, TopologicalMap, arrays_of, digest_of
from omnieval.mapping.step import FinalMap
from omnieval.results.atomic import replacing, write_json

MAP_FILE = "map.npz"
MAP_ABOUT = "map.json"
MAP_VERSION = 1
"""Version of the format of a map."""
UNTIMED = np.iinfo(np.int64).min
"""Stands for a time that is not known."""
_CHUNK = 1 << 22
"""Bytes to copy at once."""


class MapWriter:
    """Gathers the descriptions of a sequence while it is mapped, and writes its map at the end.

    Orientation descriptors wait in a file without a name, which is gone when the writer is left, as a context.

    Parameters
    ----------
    folder
        Where `MAP_FILE` and `MAP_ABOUT` go.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._positions: list[NDArray[np.float32]] = []
        self._shape: tuple[int, ...] = ()
        self._orientations: IO[bytes] | None = None
        self._error: OSError | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._orientations is not None:
            with contextlib.suppress(OSError):  # what could not be written is not wanted any more
                self._orientations.close()

    def add(self, description: Description) -> None:
        """Add the next image; if it cannot be kept, that is said at the end, so that no step is lost to it."""
        orientation = np.ascontiguousarray(description.orientation, np.float32)
        self._positions.append(np.asarray(description.position, np.float32))
        if self._error is not None:
            return
        try:
            if self._orientations is None:
                self._orientations = tempfile.TemporaryFile(dir=self._folder)  # noqa: SIM115
                self._shape = orientation.shape
            self._orientations.write(orientation.data)
        except OSError as error:
            self._error = error

    def finish(self, final: FinalMap, steps: pl.DataFrame, about: dict[str, Any]) -> None:
        """Write the map.

        Parameters
        ----------
        final
            The final map.
        steps
            The table of the run.
        about
            `TopologicalMap.about`.

        Raises
        ------
        ResultError
            If it cannot be written.
        """
        orientations = StreamedArray(np.dtype(np.float32), (len(self._positions), *self._shape), self._chunks)
        arrays: dict[str, NDArray[Any] | StreamedArray]
        arrays = {"orientations": orientations, **_arrays(final, steps, np.stack(self._positions))}
        try:
            if self._error is not None:
                raise self._error
            digest = digest_of(arrays)
        except OSError as error:
            raise _unwritten(self._folder / MAP_FILE, error) from error
        with replacing(self._folder / MAP_FILE) as path, zipfile.ZipFile(path, "w", allowZip64=True) as file:
            for name, array in arrays.items():
                with file.open(f"{name}.npy", "w", force_zip64=True) as stream:
                    _write_array(stream, array)
        write_json({"map_version": MAP_VERSION, "digest": digest, **about}, self._folder / MAP_ABOUT)

    def _chunks(self) -> Iterator[bytes]:
        if self._orientations is not None:
            self._orientations.seek(0)
            while chunk := self._orientations.read(_CHUNK):
                yield chunk


def _write_array(stream: IO[bytes], array: NDArray[Any] | StreamedArray) -> None:
    """Write an array as NumPy does."""
    if not isinstance(array, StreamedArray):
        np.lib.format.write_array(stream, array, allow_pickle=False)
        return
    about = {"descr": array.dtype.str, "fortran_order": False, "shape": array.shape}
    np.lib.format.write_array_header_1_0(stream, about)
    for chunk in array.chunks():
        stream.write(chunk)


def _unwritten(path: Path, error: OSError) -> ResultError:
    return ResultError(f"cannot write {path}: {error.strerror or error}; choose another --out")


def _arrays(final: FinalMap, steps: pl.DataFrame, positions: NDArray[np.float32]) -> dict[str, NDArray[Any]]:
    """Return all arrays of a map but the orientation descriptors."""
    return {
        "files": _text(steps["file"].to_list()),
        "times": steps["time"].cast(pl.Int64).fill_null(UNTIMED).to_numpy(),
        "xy": steps.select("x", "y").cast(pl.Float64).fill_null(np.nan).to_numpy(),
        "yaws": steps["yaw"].fill_null(np.nan).to_numpy(),
        "rooms": _text([room or "" for room in steps["room"].to_list()]),
        **arrays_of(final, positions),
    }


def load_map(folder: Path) -> TopologicalMap:
    """Return the map in a run folder.

    Raises
    ------
    ResultError
        If there is none, or it is damaged.
    """
    if not (folder / MAP_FILE).exists():
        raise ResultError(f"{folder} has no map: it was left out (--no-map) or the run did not end; replay it again")
    try:
        about = json.loads((folder / MAP_ABOUT).read_text("utf-8"))
        with (folder / MAP_FILE).open("rb") as file, np.load(file, allow_pickle=False) as arrays:
            loaded = TopologicalMap(
                **{name: arrays[name] for name in ARRAYS},
                about={name: value for name, value in about.items() if name not in {"map_version", "digest"}},
            )
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile) as error:
        raise ResultError(f"cannot read {folder / MAP_FILE}: {error}; replay the sequence again") from error
    if about.get("map_version") != MAP_VERSION:
        raise ResultError(
            f"{folder / MAP_ABOUT} has map version {about.get('map_version')}, this omnieval reads {MAP_VERSION}; "
            "replay the sequence again"
        )
    if loaded.digest != about.get("digest"):
        raise ResultError(
            f"{folder / MAP_FILE} is damaged or was changed since it was written; replay the sequence again"
        )
    return loaded


def _text(values: Sequence[str]) -> NDArray[np.str_]:
    return np.array(values, dtype=np.str_)
