"""From frames to descriptions: read, decode, unwrap, describe, each image at most once."""

from __future__ import annotations

from collections import deque
from collections.abc import Generator, Iterable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from omnieval.components import Component
from omnieval.datasets.sequence import Frame
from omnieval.descriptors.cache import DescriptorCache, description_key, image_digest
from omnieval.descriptors.description import Description, Descriptor, MaskedDescriptor
from omnieval.errors import ConfigError, OmnievalError
from omnieval.imaging.camera import CameraModel
from omnieval.imaging.decode import decode_colour, decode_grey
from omnieval.imaging.disturb import disturbed
from omnieval.imaging.glance import file_state

_WORKERS = 2
_AHEAD = 16
"""Frames under way at once; bounds the memory."""


@dataclass(frozen=True)
class DescribedFrame:
    """A description and the digest of what it was made from."""

    description: Description
    digest: str


_New = tuple[str | None, DescribedFrame]
"""A description, and the state of its file before that was read."""


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
            under_way: deque[tuple[Frame, Future[_New] | DescribedFrame]] = deque()
            try:
                for frame in frames:
                    known = self._cache.lookup(frame.path, self._key(frame.bits))
                    under_way.append(
                        (frame, DescribedFrame(known[1], known[0]) if known else pool.submit(self._describe, frame))
                    )
                    if len(under_way) > _AHEAD:
                        yield self._take(*under_way.popleft())
                while under_way:
                    yield self._take(*under_way.popleft())
            finally:
                pool.shutdown(cancel_futures=True)

    def _describe(self, frame: Frame) -> _New:
        where = str(frame.path)
        try:
            state = file_state(frame.path)
        except OSError:
            state = None  # whoever reads it says what is wrong
        data = frame.read()
        digest = image_digest(data)
        grey = disturbed(decode_grey(data, where, frame.bits), self._camera.disturbance, digest)
        panorama = self._camera.panorama(grey, where=where)
        try:
            description = self._describe_seen(panorama)
        except OmnievalError:
            raise
        except Exception as error:  # whatever the code of others raises
            fault = " ".join(f"{type(error).__name__}: {error}".split())
            raise ConfigError(f"the descriptor {self._name} failed on image {where}: {fault}") from error
        return state, DescribedFrame(description, digest)

    def _describe_seen(self, panorama: NDArray[np.uint8]) -> Description:
        mask = self._camera.panorama_mask
        if mask is None:
            return self._descriptor.describe(panorama)
        if panorama.ndim == 3:
            filled = np.stack([mask.filled(panorama[:, :, channel]) for channel in range(panorama.shape[2])], axis=2)
        else:
            filled = mask.filled(panorama)
        if isinstance(self._descriptor, MaskedDescriptor):
            return self._descriptor.describe_masked(filled, mask.seen)
        return self._descriptor.describe(filled)

    def _take(self, frame: Frame, described: Future[_New] | DescribedFrame) -> DescribedFrame:
        """Return a description; a new one is also kept. Only the caller's thread uses the cache."""
        if isinstance(described, DescribedFrame):
            return described
        state, result = described.result()
        if state is not None:
            self._cache.store(frame.path, state, self._key(frame.bits), result.digest, result.description)
        return result
