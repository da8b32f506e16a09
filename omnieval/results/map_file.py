"""A map on disk: ``map.npz`` (arrays, uncompressed, nothing that executes when loaded) and ``map.json`` beside it.

Orientation descriptors are nearly all of it, 16 kB an image of 256 cells x 16 bins: they go to the file as they come.
"""

from __future__ import annotations

import json
import zipfile
from collections.abc import Sequence
from contextlib import ExitStack, suppress
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
import polars as pl
from numpy.lib import format as npy
from numpy.typing import NDArray

from omnieval.descriptors.description import Description
from omnieval.errors import ResultError
from omnieval.mapping.map import ARRAYS, TopologicalMap, array_digest, arrays_of, begun_digest, digest_of_arrays
from omnieval.mapping.step import FinalMap
from omnieval.results.atomic import replacing, write_json

MAP_FILE = "map.npz"
MAP_ABOUT = "map.json"
MAP_VERSION = 1
"""Version of the format of a map."""
UNTIMED = np.iinfo(np.int64).min
"""Stands for a time that is not known."""


class MapWriter:
    """Writes a map while its sequence is mapped; if it is left before `finish`, nothing stays behind.

    Parameters
    ----------
    folder
        Where `MAP_FILE` and `MAP_ABOUT` go.
    images
        How many images there will be.
    """

    def __init__(self, folder: Path, images: int) -> None:
        self._folder, self._images = folder, images
        self._positions: list[NDArray[np.float32]] = []
        self._open = ExitStack()

    def __enter__(self) -> Self:
        self._archive = zipfile.ZipFile(self._open.enter_context(replacing(self._folder / MAP_FILE)), "w")
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._archive.fp is not None:  # left before its end
            with suppress(OSError):
                if self._positions:
                    self._member.close()
                self._archive.close()
        self._open.__exit__(kind, error, trace)

    def add(self, description: Description) -> None:
        """Add the next image."""
        orientation = np.ascontiguousarray(description.orientation, np.float32)
        if not self._positions:
            self._begin(orientation.shape)
        self._member.write(orientation.data)
        self._digest.update(orientation.data)
        self._positions.append(np.asarray(description.position, np.float32))

    def finish(self, final: FinalMap, steps: pl.DataFrame, about: dict[str, Any]) -> None:
        """Write the rest and put the files in their place.

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
        self._member.close()
        digests = {"orientations": self._digest.hexdigest()}
        for name, array in _arrays(final, steps, np.stack(self._positions)).items():
            digests[name] = array_digest(array)
            with self._archive.open(f"{name}.npy", "w", force_zip64=True) as member:
                npy.write_array(member, array, allow_pickle=False)
        self._archive.close()
        self._open.close()
        write_json({"map_version": MAP_VERSION, "digest": digest_of_arrays(digests), **about}, self._folder / MAP_ABOUT)

    def _begin(self, shape: tuple[int, ...]) -> None:
        self._member = self._archive.open("orientations.npy", "w", force_zip64=True)
        whole, kind = (self._images, *shape), np.dtype(np.float32)
        header = {"descr": npy.dtype_to_descr(kind), "fortran_order": False, "shape": whole}
        npy.write_array_header_2_0(self._member, header)
        self._digest = begun_digest(kind, whole)


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
