"""How the images of each node are spread over rooms, in words."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

NO_LABEL = "no label"


class Rooms:
    """The room of every image, as they come."""

    def __init__(self) -> None:
        self._names: list[str] = []
        self._codes = np.zeros(64, np.int64)
        self._count = 0

    def add(self, room: str | None) -> None:
        """Take in the room of the next image; None where it is unknown."""
        name = room or NO_LABEL
        if name not in self._names:
            self._names.append(name)
        if self._count == len(self._codes):
            self._codes = np.concatenate([self._codes, np.zeros_like(self._codes)])
        self._codes[self._count] = self._names.index(name)
        self._count += 1

    def shares(self, labels: NDArray[np.int64], nodes: NDArray[np.int64]) -> list[str]:
        """Return for each node in which rooms its images lie, the commonest first, e.g. ``KT 61 %, LR 39 %``.

        Parameters
        ----------
        labels
            Node of every image so far, shape (n,).
        nodes
            The nodes that are asked for.
        """
        names = tuple(self._names)
        pairs = labels * len(names) + self._codes[: len(labels)]
        counts = np.bincount(pairs, minlength=(int(labels.max()) + 1) * len(names)).reshape(-1, len(names))
        return [_in_words(names, tuple(row)) for row in counts[nodes].tolist()]


@lru_cache(maxsize=256)
def _in_words(names: tuple[str, ...], counts: tuple[int, ...]) -> str:
    """Write shares; a step changes those of one node, if any, so most have been written before."""
    total = sum(counts)
    order = sorted(range(len(names)), key=lambda index: -counts[index])
    return ", ".join(f"{names[index]} {100 * counts[index] / total:.0f} %" for index in order if counts[index])
