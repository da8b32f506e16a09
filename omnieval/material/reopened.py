"""What a run replayed, opened again by what its ``run.json`` says and compared with its fingerprint."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping
from collections.abc import Sequence as Frames
from contextlib import contextmanager
from functools import partial
from typing import Any

from omnieval.config import Config
from omnieval.datasets import load
from omnieval.descriptors.cache import DescriptorCache
from omnieval.descriptors.description import DescribedFrame
from omnieval.errors import DatasetError, OmnievalError, ResultError
from omnieval.imaging.camera import camera_of
from omnieval.imaging.glance import image_size
from omnieval.imaging.pictures import Pictures
from omnieval.imaging.soundness import BadImage
from omnieval.material.joined import following
from omnieval.material.material import Earlier, Material
from omnieval.material.opening import of_archive, of_images
from omnieval.material.source import ARCHIVE, Cut, archive_file
from omnieval.results.provenance import dataset_fingerprint
from omnieval.results.run_folder import Run, open_run


@contextmanager
def reopened(run: Run, *, describe: bool = True) -> Iterator[Material]:
    """Give what a run replayed, exactly as it was.

    Its descriptions end in an error if they turn out not to be those of the run: what was made of them until then must
    not be kept.

    Parameters
    ----------
    run
        A run.
    describe
        Whether images are described. Else they are only compared with the run's, and their descriptions are empty: for
        pictures of what nothing can describe any more.

    Raises
    ------
    ConfigError, DatasetError
        If the source cannot be opened any more.
    ResultError
        If it has changed since, or its descriptor cannot be made again.
    """
    files = run.steps["file"].to_list()
    with reopened_as(run.manifest, files, str(run.folder), describe=describe) as material:
        yield material


@contextmanager
def reopened_as(
    manifest: Mapping[str, Any], files: Frames[str], where: str, *, describe: bool = True
) -> Iterator[Material]:
    """Give what a ``run.json`` describes, exactly as it was; see `reopened`.

    Parameters
    ----------
    manifest
        The content of ``run.json``: source, cut, components, imaging, camera and images left out.
    files
        Names of its images.
    where
        What to call the folder it stands in.
    describe
        See `reopened`.
    """
    earlier = _earlier(manifest, where)
    with _of_its_own(manifest, describe=describe) as material:
        whole = material if earlier is None else following(earlier, material, partial(pictures_of, earlier.run))
        yield held_against(whole, files, manifest.get("dataset_fingerprint"), where)


def described_again(config: Config) -> Config:
    """Return a configuration whose descriptor is as it can be made now; an archive needs none.

    Raises
    ------
    ResultError
        If it cannot be made any more, or has changed.
    """
    if config.descriptor == ARCHIVE:
        return config
    return dataclasses.replace(config, descriptor=config.descriptor.again())


def held_against(material: Material, files: Frames[str], fingerprint: str | None, where: str) -> Material:
    """Return material whose descriptions end in an error if they are not those that a run replayed.

    Parameters
    ----------
    material
        What is opened again.
    files, fingerprint
        Names of the run's images, and what `dataset_fingerprint` makes of them; None where that is not known.
    where
        What to call the run.

    Raises
    ------
    ResultError
        If the names are others.
    """
    again = "replay it again"
    here = [frame.file for frame in material.frames[: len(files)]]
    if here != list(files):
        at = next((i for i, (one, other) in enumerate(zip(here, files, strict=False)) if one != other), len(here))
        found = here[at] if at < len(here) else "nothing"
        raise ResultError(f"step {at} of {where} is of {files[at]}, {material.source} has {found} there; {again}")

    def described() -> Iterator[DescribedFrame]:
        digests = []
        for one in material.described:
            digests.append(one.digest)
            if len(digests) == len(files) and fingerprint is not None:
                found = dataset_fingerprint(material.frames[: len(files)], digests)
                if found != fingerprint:
                    raise ResultError(
                        f"the images, poses or labels of {material.source} are not those that {where} replayed; {again}"
                    )
            yield one

    return dataclasses.replace(material, described=described())


def pictures_of(run: Run) -> Pictures:
    """Return the pictures of what a run replayed, which are compared with it.

    Raises
    ------
    DatasetError
        If they are not there any more, or have changed since.
    """
    try:
        with reopened(run, describe=False) as material:
            for _ in material.described:
                pass
            pictures = material.pictures
    except OmnievalError as error:
        raise DatasetError(f"the images of {run.folder}, whose map is continued, cannot be shown: {error}") from error
    if pictures is None:
        raise DatasetError(
            f"{run.folder}, whose map is continued, was replayed from descriptors; it has no images to show"
        )
    return pictures


def _earlier(manifest: Mapping[str, Any], where: str) -> Earlier | None:
    """Return what a run continued from, None if it did not.

    Raises
    ------
    ResultError
        If it is not there any more, or has another map now.
    """
    told = manifest.get("continues")
    if told is None:
        return None
    run = open_run(told["run"])
    earlier = Earlier(run, run.map)
    if earlier.map.digest != told["digest"]:
        raise ResultError(f"{run.folder} has another map now than {where} continued from; replay it again")
    return earlier


@contextmanager
def _of_its_own(manifest: Mapping[str, Any], *, describe: bool) -> Iterator[Material]:
    """Give what a ``run.json`` names as its source, without what came before that."""
    config = Config.of_run(manifest)
    cut = Cut(**manifest["cut"])
    source: str = manifest["source"]
    if (file := archive_file(source)) is not None:
        yield of_archive(file, cut)
        return
    if describe:
        config = described_again(config)
    sequence = load(source).cut(**dataclasses.asdict(cut))
    skipped = None if "skipped" not in manifest else tuple(BadImage(**bad) for bad in manifest["skipped"])
    left_out = {bad.file for bad in skipped or ()}
    kept = tuple(frame for frame in sequence.frames if frame.file not in left_out)
    sequence = dataclasses.replace(sequence, frames=kept, calibration=())
    with DescriptorCache() as cache:
        camera = camera_of(manifest["camera"], image_size(sequence, cache))
        cells = None if describe else manifest["orientation_cells"]
        yield of_images(sequence, config, cache, skipped, camera, cells)
