"""The descriptions of a sequence where they are in the array store: what one process hands to another to read.

It is small, whatever the number of images: the arrays stay on disk, and their pages are shared by all who map them.
"""

from __future__ import annotations

import hashlib
import math
import secrets
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import islice
from pathlib import Path
from typing import Any, Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from omnieval.descriptors.cache import DescriptorCache
from omnieval.descriptors.description import DescribedFrame, Description, Place
from omnieval.descriptors.segments import Filler, Shape, mapped
from omnieval.errors import ConfigError, ResultError

Part = Literal["position", "orientation"]
_CHUNK = 64
OWN = "own-"
"""How the name of the segment begins that holds what no cache keeps."""
_NO_FILE = bytes(16)


class Descriptions(Protocol):
    """The descriptions of n images, in their order."""

    def array(self, part: Part) -> NDArray[np.float32]:
        """Return all of one part, shape (n, d) or (n, cells, bins), float32."""
        ...

    @property
    def orientation_values(self) -> int:
        """Values of one orientation descriptor, cells times bins."""
        ...

    def __iter__(self) -> Iterator[Description]:
        """Yield the description of one image after the other."""
        ...

    def __len__(self) -> int:
        """How many images there are."""
        ...


@dataclass(frozen=True, eq=False)
class HeldDescriptions:
    """Descriptions in memory: for a process that cannot read the store.

    Attributes
    ----------
    position, orientation
        Shapes (n, d) and (n, cells, bins), float32.
    """

    position: NDArray[np.float32]
    orientation: NDArray[np.float32]

    def array(self, part: Part) -> NDArray[np.float32]:
        """See `Descriptions`."""
        return self.position if part == "position" else self.orientation

    @property
    def orientation_values(self) -> int:
        """See `Descriptions`."""
        return math.prod(self.orientation.shape[1:])

    def __iter__(self) -> Iterator[Description]:
        """See `Descriptions`."""
        for position, orientation in zip(self.position, self.orientation, strict=True):
            yield Description(position, orientation)

    def __len__(self) -> int:
        """See `Descriptions`."""
        return len(self.position)


@dataclass(frozen=True, eq=False)
class StoredDescriptions:
    """Descriptions in segments of the store, which are held from the first look at them on.

    Attributes
    ----------
    segments
        Paths of segments, without ending.
    shape
        Of the descriptions.
    segment, row
        Of every image, its segment and the row there; shapes (n,), int64.
    digest
        Of all values. A process that finds others does not use them.
    """

    segments: tuple[str, ...]
    shape: Shape
    segment: NDArray[np.int64]
    row: NDArray[np.int64]
    digest: bytes

    def array(self, part: Part) -> NDArray[np.float32]:
        """See `Descriptions`; a view of the file where the images have rows one after the other, else a copy.

        Raises
        ------
        ResultError
            If they are not there any more, or have been damaged.
        """
        arrays = [one[part == "orientation"] for one in self._arrays]
        first, count = int(self.row[0]), len(self)
        if len(arrays) == 1 and np.array_equal(self.row, np.arange(first, first + count)):
            return arrays[0][first : first + count]
        gathered = np.empty((count, *arrays[0].shape[1:]), np.float32)
        for number, array in enumerate(arrays):
            of_it = self.segment == number
            gathered[of_it] = array[self.row[of_it]]
        return gathered

    @property
    def orientation_values(self) -> int:
        """See `Descriptions`."""
        return self.shape.cells * self.shape.bins

    def __iter__(self) -> Iterator[Description]:
        """See `Descriptions`; errors are those of `array`."""
        for position, orientation in _rows(self._arrays, self.segment, self.row):
            yield Description(np.array(position), np.array(orientation))

    def __len__(self) -> int:
        """See `Descriptions`."""
        return len(self.row)

    def __getstate__(self) -> dict[str, Any]:
        """Leave out what is mapped: another process maps it for itself."""
        return {name: value for name, value in vars(self).items() if name != "_arrays"}

    def hold(self) -> None:
        """Map the segments, and keep them from being removed as long as this object lives; errors are as of `array`."""
        assert self._arrays

    def held(self) -> HeldDescriptions:
        """Return the same in memory; errors are those of `array`."""
        return HeldDescriptions(np.array(self.array("position")), np.array(self.array("orientation")))

    @cached_property
    def _arrays(self) -> tuple[tuple[NDArray[np.float32], NDArray[np.float32]], ...]:
        """All rows of each segment."""
        what = f"the descriptors of {len(self)} images in {Path(self.segments[0]).parent}"
        try:
            arrays = tuple(mapped(Path(segment), self.shape) for segment in self.segments)
            content = hashlib.blake2b(digest_size=16)
            for position, orientation in _rows(arrays, self.segment, self.row):
                _add(content, position, orientation)
        except (OSError, IndexError) as error:
            reason = getattr(error, "strerror", None) or "rows are missing"
            raise ResultError(f"{what} cannot be read: {reason}; run it again") from error
        if content.digest() != self.digest:
            raise ResultError(f"{what} are not what was written; run it again")
        return arrays


def kept(described: Iterable[DescribedFrame], cache: DescriptorCache | None, folder: Path) -> StoredDescriptions:
    """Return where the descriptions of images are kept, in their order: in the cache, or else in a folder.

    Parameters
    ----------
    described
        The images, at least one.
    cache
        What keeps those that have a place; None if nothing does.
    folder
        Where the others are written to; it is made if there are any.

    Raises
    ------
    ConfigError
        If the descriptions are of several shapes.
    ResultError
        If they cannot be written or read.
    """
    places: list[Place] = []
    content = hashlib.blake2b(digest_size=16)
    shape: Shape | None = None
    own: Filler | None = None
    images = iter(described)
    try:
        while chunk := list(islice(images, _CHUNK)):
            if cache is not None:
                cache.save()
            for one in chunk:
                found = Shape.of(one.description)
                if found is None or shape not in {None, found}:
                    raise ConfigError(
                        "the descriptor must give descriptions of one shape, with values, to all images; position "
                        f"{one.description.position.shape} and orientation {one.description.orientation.shape} differ"
                    )
                shape = found
                _add(content, one.description.position, one.description.orientation)
                if cache is not None and one.place is not None and cache.holds(one.place):
                    places.append(one.place)
                    continue
                own = own or Filler(folder / f"{OWN}{secrets.token_hex(4)}", "", shape)
                places.append(own.add(_NO_FILE, bytes.fromhex(one.digest), one.description))
            if own is not None:
                own.flush()
    except OSError as error:
        raise ResultError(f"cannot write {folder}: {error.strerror or error}; choose another --out") from error
    finally:
        if own is not None:
            own.close()
    assert shape is not None
    segments = {place.segment: None for place in places}
    number = {segment: index for index, segment in enumerate(segments)}
    stored = StoredDescriptions(
        tuple(segments),
        shape,
        np.array([number[place.segment] for place in places], np.int64),
        np.array([place.row for place in places], np.int64),
        content.digest(),
    )
    stored.hold()
    return stored


def _rows(
    arrays: tuple[tuple[NDArray[np.float32], NDArray[np.float32]], ...],
    segment: NDArray[np.int64],
    row: NDArray[np.int64],
) -> Iterator[tuple[NDArray[np.float32], NDArray[np.float32]]]:
    for number, index in zip(segment.tolist(), row.tolist(), strict=True):
        position, orientation = arrays[number]
        yield position[index], orientation[index]


def _add(content: hashlib.blake2b, position: NDArray[np.float32], orientation: NDArray[np.float32]) -> None:
    for values in (position, orientation):
        content.update(np.ascontiguousarray(values, "<f4").data)
