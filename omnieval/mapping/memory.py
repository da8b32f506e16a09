"""The images the mapper has seen: their descriptors, growing, addressed by frame number."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from omnieval.descriptors.description import Description
from omnieval.descriptors.distance import DescriptionStore, Distances
from omnieval.errors import ConfigError


class ImageMemory:
    """Descriptors of every image so far; memory grows linearly."""

    def __init__(self) -> None:
        self._count = 0
        self._positions: NDArray[np.float64] = np.empty((0, 0))
        self._store = DescriptionStore()
        self._shapes: tuple[tuple[int, ...], tuple[int, ...]] | None = None

    def __len__(self) -> int:
        return self._count

    def append(self, description: Description) -> int:
        """Keep a description and return its frame number.

        Raises
        ------
        ConfigError
            If its arrays are not finite or not shaped like the ones before.
        """
        position = self._checked(description)
        if self._count == len(self._positions):
            grown = np.empty((max(64, 2 * self._count), position.size))
            grown[: self._count] = self._positions[: self._count].reshape(self._count, position.size)
            self._positions = grown
        self._positions[self._count] = position
        self._store.append(description)
        self._count += 1
        return self._count - 1

    def positions(self, frames: NDArray[np.int64]) -> NDArray[np.float64]:
        """Position descriptors of some images, shape (m, d)."""
        return self._positions[frames]

    def position(self, frame: int) -> NDArray[np.float64]:
        """Position descriptor of one image, shape (d,)."""
        position: NDArray[np.float64] = self._positions[frame]
        return position

    def compare(self, frame: int, frames: NDArray[np.int64]) -> Distances:
        """Compare an image with others, shape (m,)."""
        return self._store.compare(frame, frames)

    def anticipate(self, frames: Iterable[int], *, later: bool = False) -> None:
        """Compare some images with all others ahead of time; see `DescriptionStore.anticipate`."""
        self._store.anticipate(frames, later=later)

    def _checked(self, description: Description) -> NDArray[np.float64]:
        position, orientation = description.position, description.orientation
        where = f"image {self._count}"
        if position.ndim != 1 or orientation.ndim != 2:
            raise ConfigError(
                f"{where}: position and orientation descriptors must have 1 and 2 dimensions, "
                f"got shapes {position.shape} and {orientation.shape}"
            )
        shapes = position.shape, orientation.shape
        if self._shapes is not None and shapes != self._shapes:
            raise ConfigError(
                f"{where}: its position and orientation descriptors have shapes {shapes[0]} and {shapes[1]}, "
                f"earlier ones {self._shapes[0]} and {self._shapes[1]}"
            )
        if not (np.isfinite(position).all() and np.isfinite(orientation).all()):
            raise ConfigError(f"{where}: its descriptor has NaN or infinite values")
        self._shapes = shapes
        return position.astype(np.float64)
