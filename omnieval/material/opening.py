"""A source of any kind as material, its descriptions ready to be computed."""

from __future__ import annotations

import dataclasses
import hashlib
import logging
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from itertools import chain
from pathlib import Path

import numpy as np

from omnieval.config import Config
from omnieval.datasets import load
from omnieval.datasets.findings import by_kind
from omnieval.datasets.sequence import Frame, Sequence, positions_of
from omnieval.descriptors.archive import Archive, load_archive
from omnieval.descriptors.cache import DescriptorCache, image_digest
from omnieval.descriptors.describe import Describer, Elsewhere
from omnieval.descriptors.description import DescribedFrame, Description
from omnieval.errors import DatasetError
from omnieval.imaging.camera import CameraModel, camera_in_words, resolve_camera
from omnieval.imaging.pictures import SequencePictures
from omnieval.imaging.soundness import BadImage, examined, without_bad
from omnieval.material.material import Material
from omnieval.material.poses import why_unposed, within_a_building
from omnieval.material.source import ARCHIVE, ARCHIVE_SCHEME, Cut, Source, archive_file, refuse_descriptor
from omnieval.source_code import digest_of

_RELEASED = 512
"""Images of an archive after which the memory they were in is let go."""

_LOG = logging.getLogger("omnieval")


@contextmanager
def opened(
    source: Source,
    config: Config,
    cut: Cut | None = None,
    *,
    skip_bad: bool = False,
    elsewhere: Elsewhere | None = None,
) -> Iterator[Material]:
    """Give the material of a source, its descriptions ready to be computed.

    What is odd about it is said once, as warnings of the logger ``omnieval``, before anything is computed.

    Parameters
    ----------
    source
        As on the command line (``npz:FILE`` or ``FILE.npz`` for an archive), or a sequence.
    config
        What to make of it.
    cut
        Which of its frames; None for all.
    skip_bad
        Leave out images that are not fit for use (`imaging.soundness`) instead of refusing the sequence.
    elsewhere
        Where images are described; None: in this process.

    Raises
    ------
    ConfigError, DatasetError
        If an image is not fit for use, the camera cannot be resolved or the first image not be described.
    """
    cut = cut or Cut()
    if (file := archive_file(source)) is not None:
        refuse_descriptor(source, config)
        yield of_archive(file, cut)
        return
    sequence = (source if isinstance(source, Sequence) else load(source)).cut(**dataclasses.asdict(cut))
    sequence, skipped = without_bad(sequence) if skip_bad else (sequence, None)
    with DescriptorCache() as cache:
        material = of_images(sequence, config, cache, skipped, elsewhere=elsewhere)
        for finding in material.findings:
            if finding.severity == "warning":
                _LOG.warning("%s", finding)
        yield material


def of_images(
    sequence: Sequence,
    config: Config,
    cache: DescriptorCache,
    skipped: tuple[BadImage, ...] | None,
    camera: CameraModel | None = None,
    undescribed_cells: int | None = None,
    elsewhere: Elsewhere | None = None,
) -> Material:
    """Return the material of a sequence, whose images are examined first.

    Parameters
    ----------
    sequence, config, elsewhere
        See `opened`.
    cache
        Where descriptions are looked up.
    skipped
        Images that were left out of the sequence; None if none were to be.
    camera
        What took the images; None: to be found out.
    undescribed_cells
        Cells of the orientation descriptors that the images once had, if they are not to be described.
    """
    sequence = examined(sequence, cache)
    unposed = why_unposed(sequence.frames)
    sequence = dataclasses.replace(sequence, frames=tuple(map(within_a_building, sequence.frames)))
    if camera is None:
        camera = resolve_camera(sequence, config.imaging, cache)
        if camera.kind == "omnidirectional" and not camera.told:
            _LOG.info("camera: %s", camera_in_words(camera.about))
    described: Iterator[DescribedFrame] = (
        Describer(camera, config.descriptor, cache, elsewhere).describe_frames(sequence.frames)
        if undescribed_cells is None
        else _undescribed(sequence.frames)
    )
    if sequence.perturbation:
        described = _changed(described, sequence.perturbation)
    first = next(described)
    return Material(
        name=sequence.name,
        source=sequence.source,
        cut=Cut(*sequence.cut_from),
        descriptor=config.descriptor,
        cells=undescribed_cells or len(first.description.orientation),
        frames=sequence.frames,
        positions=sequence.positions,
        unposed=unposed,
        described=chain([first], described),
        camera=camera.settings,
        camera_about=camera.about,
        card=sequence.card,
        findings=by_kind([*sequence.findings, *camera.findings]),
        skipped=skipped,
        pictures=SequencePictures(sequence.frames, camera),
        cache=cache,
        perturbation=sequence.perturbation,
    )


def of_archive(file: Path, cut: Cut) -> Material:
    """Return the material of an archive of descriptors.

    Raises
    ------
    DatasetError
        If it cannot be read, or nothing of it is left.
    """
    archive = load_archive(file, may_map=True)
    chosen = range(len(archive.frames))[cut.start :: cut.stride][: cut.limit]
    if not chosen:
        raise DatasetError(
            f"{file}: start {cut.start}, stride {cut.stride}, limit {cut.limit} leave none of its "
            f"{len(archive.frames)} images"
        )
    frames = tuple(archive.frames[index] for index in chosen)
    posed = tuple(map(within_a_building, frames))
    return Material(
        name=file.stem,
        source=f"{ARCHIVE_SCHEME}{file.resolve()}",
        cut=cut,
        descriptor=ARCHIVE,
        cells=archive.orientation.shape[1],
        frames=posed,
        positions=positions_of(posed),
        unposed=why_unposed(frames),
        described=_of_arrays(archive, chosen),
    )


def digest(description: Description) -> str:
    """Return a digest of a description, for images that are not at hand."""
    content = hashlib.blake2b(description.position.tobytes(), digest_size=16)
    content.update(description.orientation.tobytes())
    return content.hexdigest()


def _of_arrays(archive: Archive, chosen: Iterable[int]) -> Iterator[DescribedFrame]:
    for number, index in enumerate(chosen):
        if number % _RELEASED == 0:
            archive.release()
        description = archive.description(index)
        yield DescribedFrame(description, digest(description))


def _changed(described: Iterator[DescribedFrame], perturbation: str) -> Iterator[DescribedFrame]:
    """Yield descriptions whose digests know of a perturbation: the images on disk are not what was described."""
    for one in described:
        yield dataclasses.replace(one, digest=digest_of([one.digest, perturbation]))


def _undescribed(frames: Iterable[Frame]) -> Iterator[DescribedFrame]:
    nothing = Description(np.zeros(0, np.float32), np.zeros((0, 0), np.float32))
    for frame in frames:
        yield DescribedFrame(nothing, image_digest(frame.read()))
