"""The jobs of an ablation, and the images they are run on, described once for all."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from omnieval.ablation.grid import Span
from omnieval.baselines.similarity import similarity_matrix, too_many
from omnieval.baselines.spectral import spectral_embedding
from omnieval.config import Config
from omnieval.datasets.sequence import Frame
from omnieval.descriptors.description import DescribedFrame
from omnieval.descriptors.stored import Descriptions, kept
from omnieval.errors import ConfigError
from omnieval.imaging.soundness import BadImage
from omnieval.mapping.interface import Method
from omnieval.material.material import Material
from omnieval.material.source import Cut, Source
from omnieval.metrics.silhouette import silhouettes
from omnieval.results.provenance import dataset_fingerprint
from omnieval.source_code import digest_of


@dataclass(frozen=True)
class Input:
    """Images to map: a sequence, or an archive of descriptors.

    Attributes
    ----------
    name, source
        What they are called, and what opens them again.
    cut
        Which of the source's frames.
    images
        How many there are.
    given
        What to open: a sequence that is cut already, or the file of an archive.
    skipped
        Images that were left out because they are not fit for use; None if `skip_bad` was not asked for.
    perturbation
        What was changed of the sequence (`datasets.perturbation`); empty if nothing was.
    replicate
        The number of the perturbation among those drawn; None if none were.
    in_map
        The map of which other input its images are also looked for in; None if of none.
    """

    name: str
    source: str
    cut: Cut
    images: int
    given: Source
    skipped: tuple[BadImage, ...] | None = None
    perturbation: str = ""
    replicate: int | None = None
    in_map: Input | None = None

    @property
    def about(self) -> dict[str, Any]:
        """What determines which images these are, as plain values."""
        return {
            "source": self.source,
            "cut": [self.cut.start, self.cut.stride, self.cut.limit],
            "skipped": None if self.skipped is None else [bad.file for bad in self.skipped],
            "replicate": self.replicate,
        }

    @property
    def rest(self) -> Cut:
        """What is still to be cut when it is opened."""
        return self.cut if isinstance(self.given, Path) else Cut()


@dataclass(frozen=True)
class Job:
    """One point of the grid, or one interval of it.

    Attributes
    ----------
    number
        Its place in the grid, from 0.
    input
        The images.
    config
        The components with their parameters.
    span
        The parameter that takes all values of an interval, and the first and the last of them; None for a point.
    """

    number: int
    input: Input
    config: Config
    span: Span | None = None

    @cached_property
    def key(self) -> str:
        """What determines its row, as a digest: jobs with equal keys are the same, wherever they stand in a grid."""
        place = self.input.in_map
        about = {
            "input": self.input.about,
            "in_map": place.about if place else None,
            "mapper": self.config.mapper.identity,
            "descriptor": self.config.descriptor.identity,
            "imaging": self.config.imaging.model_dump(mode="json"),
            "span": [self.span.name, self.span.first, self.span.last] if self.span else None,
        }
        return digest_of(about)[:16]

    @property
    def origin(self) -> dict[str, Any]:
        """What determines the row: the columns that are known before it is run."""
        return {
            "job": self.number,
            "dataset": self.input.name,
            "source": self.input.source,
            "perturbation": self.input.perturbation or None,
            "replicate": self.input.replicate,
            "mapper": self.config.mapper.name,
            "descriptor": self.config.descriptor.name,
            **self.config.settings,
        }

    @property
    def about(self) -> dict[str, Any]:
        """The components as ``run.json`` of a run describes them."""
        mapper, descriptor = self.config.mapper, self.config.descriptor
        method = Method.of(mapper.given or mapper.cls, mapper.name, mapper.settings)
        return {
            "mapper": {**mapper.about, **method.about},
            "descriptor": descriptor.about,
            "imaging": self.config.imaging.model_dump(mode="json"),
        }


@dataclass(frozen=True)
class Described:
    """A sequence described once for all jobs that need it; small, because the descriptors stay in the array store.

    Attributes
    ----------
    frames
        The n images.
    positions
        True capture positions, shape (n, 2), metres, NaN where unknown; None when none is known.
    descriptions
        Those of the images, in order.
    fingerprint
        Digest of images, names, poses and labels.
    """

    frames: tuple[Frame, ...]
    positions: NDArray[np.float64] | None
    descriptions: Descriptions
    fingerprint: str

    @property
    def rooms(self) -> list[str | None]:
        """Room label of every image."""
        return [frame.room for frame in self.frames]

    @property
    def times(self) -> list[int | None]:
        """When every image was taken, nanoseconds."""
        return [frame.time_ns for frame in self.frames]


def dataset_key(job: Job, *, of_map: bool = False) -> str:
    """Return what the descriptions of a job's images depend on, as text; equal keys share them.

    With `of_map`, those of the images in whose map they are looked for.
    """
    assert not of_map or job.input.in_map is not None
    about = {
        "source": (job.input.in_map if of_map and job.input.in_map else job.input).source,
        "descriptor": job.config.descriptor.identity,
        "imaging": job.config.imaging.model_dump(mode="json"),
    }
    return json.dumps(about, sort_keys=True)


def describe(material: Material, folder: Path) -> Described:
    """Describe all images of the material; what the cache cannot keep is kept in `folder`.

    Raises
    ------
    ConfigError
        If the descriptions are of several shapes.
    DatasetError
        If an image cannot be read.
    ResultError
        If the descriptors cannot be written.
    """
    digests = []

    def noted() -> Iterator[DescribedFrame]:
        for one in material.described:
            digests.append(one.digest)
            yield one

    descriptions = kept(noted(), material.cache, folder)
    return Described(material.frames, material.positions, descriptions, dataset_fingerprint(material.frames, digests))


def failed_row(job: Job, error: BaseException) -> dict[str, Any]:
    """Return the row of a job that ended in an error."""
    return job.origin | {"seconds": None, "error": " ".join(f"{type(error).__name__}: {error}".split())}


def batch_silhouettes(described: Described, ks: list[int], seed: int) -> dict[int, float | None]:
    """Return the silhouette of spectral clustering (median-scaled Gaussian) at each number of clusters.

    One eigendecomposition serves them all. Null without poses and where there are fewer than two clusters.

    Raises
    ------
    ConfigError
        If there are too many images for a matrix of all pairs.
    """
    usable = [k for k in ks if k > 1]
    found: dict[int, float | None] = dict.fromkeys(ks)
    if described.positions is None or not usable:
        return found
    if fault := too_many(len(described.frames)):
        raise ConfigError(fault)
    with threadpool_limits(1):  # the same bits in whatever process
        embedding = spectral_embedding(
            similarity_matrix(described.descriptions.array("position"), "gaussian-median"), max(usable)
        )
        for k in usable:
            labels = embedding.cluster(k, seed=seed)
            if len(np.unique(labels)) > 1:
                found[k] = silhouettes(described.positions, labels).silhouette
    return found
