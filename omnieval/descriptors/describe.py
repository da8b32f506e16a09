"""From frames to descriptions: read, decode, unwrap, describe, each image at most once."""

from __future__ import annotations

from collections import deque
from collections.abc import Generator, Iterable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import islice
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from omnieval.components.component import Component
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
_SENT = 32
"""Images that are sent to describe them elsewhere at a time."""


_New = tuple[str | None, DescribedFrame]
"""A description, and the state of its file before that was read."""
_Made = Description | OmnievalError
"""A description, or in the place of an image that cannot be read its error."""


@dataclass(frozen=True)
class RawImage:
    """The bytes of an image, their digest, what to call it, and how many of 16 bits it uses (None: it has fewer)."""

    data: bytes
    digest: str
    where: str
    bits: int | None


class Elsewhere(Protocol):
    """Where images are described that are not described in this process.

    Attributes
    ----------
    count
        How many groups of images at a time.
    """

    count: int

    def describe(self, camera: CameraModel, descriptor: Component, images: Sequence[RawImage]) -> list[_Made]:
        """Describe images together; see `described_images`. Called from several threads."""
        ...


def described_images(camera: CameraModel, descriptor: Component, images: Sequence[RawImage]) -> list[_Made]:
    """Describe images of a camera of whose files nothing need be known; errors stand in the places of their images.

    Raises
    ------
    ConfigError
        If the descriptor cannot be made, or fails.
    """
    made = _Maker(camera, descriptor)
    return [one for first in range(0, len(images), made.batch) for one in made(images[first : first + made.batch])]


class _Maker:
    """Makes descriptions of the bytes of images."""

    def __init__(self, camera: CameraModel, descriptor: Component) -> None:
        self._camera = camera
        self._descriptor: Descriptor = descriptor.make()
        self._decode = decode_colour if getattr(self._descriptor, "colour", False) else decode_grey
        self._name = descriptor.name
        self.batch = self._descriptor.batch if isinstance(self._descriptor, BatchDescriptor) else 1

    def __call__(self, images: Sequence[RawImage]) -> list[_Made]:
        """Describe images together."""
        seen = [self._panorama(image) for image in images]
        panoramas = [one for one in seen if not isinstance(one, OmnievalError)]
        where = " to ".join(dict.fromkeys(images[place].where for place in (0, -1)))
        descriptions = iter(self._describe(panoramas, where) if panoramas else ())
        return [one if isinstance(one, OmnievalError) else next(descriptions) for one in seen]

    def _panorama(self, image: RawImage) -> NDArray[np.uint8] | OmnievalError:
        try:
            pixels = self._decode(image.data, image.where, image.bits)
            pixels = disturbed(pixels, self._camera.disturbance, image.digest)
            return self._camera.panorama(pixels, where=image.where)
        except OmnievalError as error:
            return error

    def _describe(self, panoramas: Sequence[NDArray[np.uint8]], where: str) -> Sequence[Description]:
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
    elsewhere
        Where images are described that the cache does not know; None: here.

    Raises
    ------
    ConfigError
        If the descriptor cannot be made.
    """

    def __init__(
        self, camera: CameraModel, descriptor: Component, cache: DescriptorCache, elsewhere: Elsewhere | None = None
    ) -> None:
        self._camera, self._component, self._elsewhere = camera, descriptor, elsewhere
        self._make = _Maker(camera, descriptor)
        self._cache = cache
        self._group = _SENT if elsewhere else self._make.batch
        self._workers = elsewhere.count + 1 if elsewhere else _WORKERS
        self._key = lru_cache(None)(lambda bits: description_key(camera.settings, descriptor.identity, bits))

    def describe_frames(self, frames: Iterable[Frame]) -> Generator[DescribedFrame, None, None]:
        """Describe frames in order, a few ahead of the caller.

        Raises
        ------
        DatasetError
            When it comes to an image that cannot be read.
        """
        with ThreadPoolExecutor(self._workers) as pool:
            under_way: deque[Iterator[DescribedFrame]] = deque()
            ahead = max(self._workers if self._elsewhere else 1, _AHEAD // self._group)
            coming = iter(frames)
            try:
                while group := list(islice(coming, self._group)):
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
        read: list[tuple[str | None, RawImage] | _New | OmnievalError] = []
        for frame in frames:
            try:
                read.append(self._read(frame))
            except OmnievalError as error:
                read.append(error)
        new = [image for _, image in (one for one in read if isinstance(one, tuple)) if isinstance(image, RawImage)]
        made = iter(self._made(new) if new else ())
        found: list[_New | OmnievalError] = []
        for one in read:
            if isinstance(one, OmnievalError):
                found.append(one)
                continue
            state, image = one
            if isinstance(image, DescribedFrame):
                found.append((state, image))
                continue
            description = next(made)
            if isinstance(description, OmnievalError):
                found.append(description)
            else:
                found.append((state, DescribedFrame(description, image.digest)))
        return found

    def _read(self, frame: Frame) -> tuple[str | None, RawImage] | _New:
        """Return the bytes of an image or, where these are known already, their description."""
        try:
            state = file_state(frame.path)
        except OSError:
            state = None  # whoever reads it says what is wrong
        data = frame.read()
        digest = image_digest(data)
        if known := self._cache.find(digest, self._key(frame.bits)):
            return state, known
        return state, RawImage(data, digest, str(frame.path), frame.bits)

    def _made(self, images: Sequence[RawImage]) -> list[_Made]:
        if self._elsewhere is None:
            return self._make(images)
        return self._elsewhere.describe(replace(self._camera), self._component, images)

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
