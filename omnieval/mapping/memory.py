"""The images the mapper has seen: their descriptors, growing, addressed by frame number."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import takewhile
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from omnieval.descriptors.description import Description
from omnieval.descriptors.distance import DescriptionStore, Distances, Selection
from omnieval.descriptors.screened_store import Bounds, ScreenedStore
from omnieval.errors import ConfigError

T = TypeVar("T")

AHEAD = 32
"""Images to know of ahead of their step, and so to compare together."""


def blocks(items: Iterable[T], size: int) -> Iterator[list[T]]:
    """Yield items in blocks, the last of which may be shorter; what comes before an error is yielded before it."""
    block: list[T] = []
    try:
        for item in items:
            block.append(item)
            if len(block) == size:
                yield block
                block = []
    except Exception:
        yield block
        raise
    if block:
        yield block


class ImageMemory:
    """Descriptors of every image so far; memory grows linearly.

    Parameters
    ----------
    threads
        To compare with, where several images are compared at once.
    screening
        Whether images are screened before they are compared (`bounds`): for a mapper that can decide by that, and keeps
        no evidence.
    """

    def __init__(self, threads: int = 1, *, screening: bool = False) -> None:
        self._count = 0
        self._positions: NDArray[np.float64] = np.empty((0, 0))
        self._store: DescriptionStore | ScreenedStore = (
            ScreenedStore(threads) if screening else DescriptionStore(threads)
        )
        self.screening = screening
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

    @property
    def cells(self) -> int:
        """Cells of the orientation descriptors; 0 before the first image."""
        return 0 if self._shapes is None else self._shapes[1][0]

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

    def position_distances(self, frame: int, frames: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return Euclidean distances of an image's position descriptor from others, shape (m,)."""
        return self._store.position_distances(frame, frames)

    def bounds(self, frame: int, frames: NDArray[np.int64]) -> Bounds:
        """Screen an image against others, shape (m,); only where that was asked for."""
        assert isinstance(self._store, ScreenedStore)
        return self._store.bounds(frame, frames)

    def glance(self, frame: int, frames: NDArray[np.int64]) -> Bounds:
        """Bound the distances of an image from others, cheaply and widely, shape (m,); only where it is screened."""
        assert isinstance(self._store, ScreenedStore)
        return self._store.glance(frame, frames)

    def narrow(self, frame: int, frames: NDArray[np.int64]) -> Bounds:
        """Bound the distances of an image from a few others narrowly, shape (m,); only where it is screened."""
        assert isinstance(self._store, ScreenedStore)
        return self._store.narrow(frame, frames)

    def foresee(self, frame: int, frames: NDArray[np.int64]) -> None:
        """Say with which others an image that was expected will be screened; see `ScreenedStore.foresee`."""
        assert isinstance(self._store, ScreenedStore)
        self._store.foresee(frame, frames)

    def select(self, frame: int, selection: Selection) -> None:
        """Add an image to a selection, which images are compared with at once by `compare_selected`."""
        assert isinstance(self._store, DescriptionStore)  # those that select compare exactly
        self._store.select(frame, selection)

    def compare_selected(self, frame: int, selection: Selection) -> Distances:
        """Compare an image with all of a selection, in its order, shape (m,)."""
        assert isinstance(self._store, DescriptionStore)
        return self._store.compare_selected(frame, selection)

    def expect(self, descriptions: Sequence[Description]) -> None:
        """Prepare for the descriptions that come next, which is faster all at once; see `DescriptionStore.expect`."""
        self._store.expect(list(takewhile(lambda description: self._fault(description) is None, descriptions)))

    def anticipate(self, frames: Iterable[int]) -> None:
        """Compare some images with all others at once; see `DescriptionStore.anticipate`."""
        self._store.anticipate(frames)

    def _checked(self, description: Description) -> NDArray[np.float64]:
        if fault := self._fault(description):
            raise ConfigError(f"image {self._count}: {fault}")
        self._shapes = description.position.shape, description.orientation.shape
        return description.position.astype(np.float64)

    def _fault(self, description: Description) -> str | None:
        """Return what is wrong with a description."""
        position, orientation = description.position, description.orientation
        if position.ndim != 1 or orientation.ndim != 2:
            return (
                "position and orientation descriptors must have 1 and 2 dimensions, "
                f"got shapes {position.shape} and {orientation.shape}"
            )
        shapes = position.shape, orientation.shape
        if self._shapes is not None and shapes != self._shapes:
            return (
                f"its position and orientation descriptors have shapes {shapes[0]} and {shapes[1]}, "
                f"earlier ones {self._shapes[0]} and {self._shapes[1]}"
            )
        if not (np.isfinite(position).all() and np.isfinite(orientation).all()):
            return "its descriptor has NaN or infinite values"
        return None
