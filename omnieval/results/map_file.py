"""A map on disk: ``map.npz`` (arrays, uncompressed, nothing that executes when loaded) and ``map.json`` beside it.

Orientation descriptors are nearly all of it, 16 kB per image of 256 cells x 16 bins.
"""

from __future__ import annotations

import json
import zipfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

from omnieval.descriptors.description import Description
from omnieval.errors import ResultError
from omnieval.mapping.map import ARRAYS, TopologicalMap, arrays_of
from omnieval.mapping.step import FinalMap
from omnieval.results.atomic import replacing, write_json

MAP_FILE = "map.npz"
MAP_ABOUT = "map.json"
MAP_VERSION = 1
"""Version of the format of a map."""
UNTIMED = np.iinfo(np.int64).min
"""Stands for a time that is not known."""


class MapWriter:
    """Gathers the descriptions of a sequence while it is mapped, and writes its map at the end.

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
        self._orientations = np.empty((0, 0, 0), np.float32)

    def add(self, description: Description) -> None:
        """Add the next image."""
        if not self._positions:
            self._orientations = np.empty((self._images, *description.orientation.shape), np.float32)
        self._orientations[len(self._positions)] = description.orientation
        self._positions.append(np.asarray(description.position, np.float32))

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
        arrays = {"orientations": self._orientations, **_arrays(final, steps, np.stack(self._positions))}
        digest = TopologicalMap(**arrays, about=about).digest
        with replacing(self._folder / MAP_FILE) as path, path.open("wb") as file:
            np.savez(file, allow_pickle=False, **arrays)
        write_json({"map_version": MAP_VERSION, "digest": digest, **about}, self._folder / MAP_ABOUT)


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
