"""From frames to descriptions: read, decode, unwrap, describe, each image at most once."""

from __future__ import annotations

from collections import deque
from collections.abc import Generator, Iterable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from functools import lru_cache
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from omnieval.components import Component
from omnieval.datasets.sequence import Frame
from omnieval.descriptors.cache import DescriptorCache, description_key, image_digest
from omnieval.descriptors.description import (
    BatchDescriptor,
    DescribedFrame,
    Description,
    Descriptor,
    MaskedDescriptor,
)
from omnieval.errors import ConfigError, OmnievalError
from omnieval.imaging.camera import CameraModel
from omnieval.imaging.decode import decode_colour, decode_grey
from omnieval.imaging.disturb import disturbed
from omnieval.imaging.glance import file_state

_WORKERS = 2
_AHEAD = 16
"""Frames under way at once; bounds the memory."""


_New = tuple[str | None, DescribedFrame]
"""A description, and the state of its file before that was read."""


@dataclass(frozen=True)
class _Read:
    """A panorama, the digest of what it was made from, and the state of its file before that was read."""

    state: str | None
    digest: str
    panorama: NDArray[np.uint8]


class Describer:
    """Describes the frames of one sequence.

    Parameters
    ----------
    camera
        Turns images into panoramas.
    descriptor
        Describes panoramas.
    cache
        Where descriptions are looked up and kept.

    Raises
    ------
    ConfigError
        If the descriptor cannot be made.
    """

    def __init__(self, camera: CameraModel, descriptor: Component, cache: DescriptorCache) -> None:
        self._camera = camera
        self._descriptor: Descriptor = descriptor.make()
        self._cache = cache
        self._decode = decode_colour if getattr(self._descriptor, "colour", False) else decode_grey
        self._batch = self._descriptor.batch if isinstance(self._descriptor, BatchDescriptor) else 1
        self._name = descriptor.name
        self._key = lru_cache(None)(lambda bits: description_key(camera.settings, descriptor.identity, bits))

    def describe_frames(self, frames: Iterable[Frame]) -> Generator[DescribedFrame, None, None]:
        """Describe frames in order, a few ahead of the caller.

        Raises
        ------
        DatasetError
            When it comes to an image that cannot be read.
        """
        with ThreadPoolExecutor(_WORKERS) as pool:
            under_way: deque[Iterator[DescribedFrame]] = deque()
            ahead = max(1, _AHEAD // self._batch)
            coming = iter(frames)
            try:
                while group := list(islice(coming, self._batch)):
                    known = [self._cache.lookup(frame.path, self._key(frame.bits)) for frame in group]
                    new = [frame for frame, one in zip(group, known, strict=True) if one is None]
                    under_way.append(self._take(group, known, pool.submit(self._describe, new) if new else None))
                    if len(under_way) > ahead:
                        yield from under_way.popleft()
                while under_way:
                    yield from under_way.popleft()
            finally:
                pool.shutdown(cancel_futures=True)

    def _describe(self, frames: Sequence[Frame]) -> list[_New | OmnievalError]:
        """Describe frames together; in the place of one that cannot be read is the error."""
        read: list[_Read | _New | OmnievalError] = []
        for frame in frames:
            try:
                read.append(self._read(frame))
            except OmnievalError as error:
                read.append(error)
        readable = [one for one in read if isinstance(one, _Read)]
        where = " to ".join(dict.fromkeys(str(frames[place].path) for place in (0, -1)))
        descriptions = iter(self._describe_seen([one.panorama for one in readable], where) if readable else ())
        return [
            (one.state, DescribedFrame(next(descriptions), one.digest)) if isinstance(one, _Read) else one
            for one in read
        ]

    def _read(self, frame: Frame) -> _Read | _New:
        """Return the panorama of an image or, where its bytes are known already, their description."""
        where = str(frame.path)
        try:
            state = file_state(frame.path)
        except OSError:
            state = None  # whoever reads it says what is wrong
        data = frame.read()
        digest = image_digest(data)
        if known := self._cache.find(digest, self._key(frame.bits)):
            return state, known
        image = disturbed(self._decode(data, where, frame.bits), self._camera.disturbance, digest)
        return _Read(state, digest, self._camera.panorama(image, where=where))

    def _describe_seen(self, panoramas: Sequence[NDArray[np.uint8]], where: str) -> Sequence[Description]:
        mask = self._camera.panorama_mask
        if mask is not None:
            panoramas = [mask.filled(panorama) for panorama in panoramas]
        try:
            if mask is not None and isinstance(self._descriptor, MaskedDescriptor):
                return [self._descriptor.describe_masked(panorama, mask.seen) for panorama in panoramas]
            if isinstance(self._descriptor, BatchDescriptor):
                described = self._descriptor.describe_batch(panoramas)
            else:
                described = [self._descriptor.describe(panorama) for panorama in panoramas]
        except OmnievalError:
            raise
        except Exception as error:  # whatever the code of others raises
            fault = " ".join(f"{type(error).__name__}: {error}".split())
            raise ConfigError(f"the descriptor {self._name} failed on image {where}: {fault}") from error
        if len(described) != len(panoramas):
            fault = f"{len(described)} descriptions of {len(panoramas)} panoramas"
            raise ConfigError(f"the descriptor {self._name} made {fault}, from image {where}")
        return described

    def _take(
        self,
        frames: Sequence[Frame],
        known: Sequence[DescribedFrame | None],
        new: Future[list[_New | OmnievalError]] | None,
    ) -> Iterator[DescribedFrame]:
        """Yield the descriptions of frames; new ones are also kept."""
        described = iter(new.result() if new else ())
        for frame, one in zip(frames, known, strict=True):
            if one is not None:
                yield one
                continue
            found = next(described)
            if isinstance(found, OmnievalError):
                raise found
            state, result = found
            if state is not None:
                result = self._cache.store(frame.path, state, self._key(frame.bits), result)
            yield result
