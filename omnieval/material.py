"""One way to open what is replayed: a source of any kind, or what a run replayed, exactly as it was.

A sequence of images and an archive of descriptors become the same `Material`. What a run replayed is opened by what its
``run.json`` says (cut, images left out, camera, descriptor, the map it continued from), and compared with its
fingerprint.
"""

from __future__ import annotations

import dataclasses
import hashlib
import logging
import math
from collections.abc import Iterable, Iterator, Mapping
from collections.abc import Sequence as Frames
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from omnieval.components import Component
from omnieval.config import Config
from omnieval.datasets import load
from omnieval.datasets.findings import KindOfFinding, by_kind
from omnieval.datasets.perturbation import OPTIONS as OF_PERTURBATION
from omnieval.datasets.registry import posed_source
from omnieval.datasets.scan import FARTHEST_M
from omnieval.datasets.sequence import Frame, Pose, Sequence, positions_of
from omnieval.datasets.source import apart
from omnieval.datasets.trajectory.load import OPTIONS as OF_POSES
from omnieval.descriptors.archive import Archive, load_archive
from omnieval.descriptors.cache import DescriptorCache, image_digest
from omnieval.descriptors.describe import Describer, Elsewhere
from omnieval.descriptors.description import DescribedFrame, Description
from omnieval.errors import ConfigError, DatasetError, OmnievalError, ResultError
from omnieval.imaging.camera import CameraModel, camera_in_words, camera_of, resolve_camera
from omnieval.imaging.glance import image_size
from omnieval.imaging.pictures import JoinedPictures, Pictures, SequencePictures
from omnieval.imaging.soundness import BadImage, examined, without_bad
from omnieval.mapping.map import TopologicalMap
from omnieval.results.map_file import UNTIMED
from omnieval.results.provenance import dataset_fingerprint
from omnieval.results.run_folder import Run, open_run
from omnieval.source_code import digest_of

ARCHIVE_SCHEME = "npz:"
"""How the source of an archive begins."""

ARCHIVE = Component("descriptor", "archive", None, {}, "")
"""Stands for the descriptor of an archive, whose descriptions are part of the fingerprint."""

_RELEASED = 512
"""Images of an archive after which the memory they were in is let go."""

Source = str | Path | Sequence

_LOG = logging.getLogger("omnieval")


@dataclass(frozen=True)
class Cut:
    """Which frames of a source are used; see `Sequence.cut`."""

    start: int = 0
    stride: int = 1
    limit: int | None = None

    @property
    def whole(self) -> bool:
        """Whether it leaves out nothing."""
        return self == Cut()


@dataclass(frozen=True)
class Earlier:
    """What was mapped before: the run, and its map, whose images come first."""

    run: Run
    map: TopologicalMap

    @property
    def about(self) -> dict[str, Any]:
        """What ``run.json`` says of it."""
        manifest = self.run.manifest
        return {
            "run": str(self.run.folder.resolve()),
            "sequence": manifest["sequence"],
            "source": manifest["source"],
            "images": len(self.map),
            "digest": self.map.digest,
        }


@dataclass(frozen=True)
class Material:
    """What is replayed, whether it comes from images or from descriptors computed elsewhere.

    Attributes
    ----------
    name, source
        Of the sequence.
    cut
        Which of its frames.
    descriptor
        What describes them.
    cells
        Cells of the orientation descriptor.
    frames
        The frames.
    positions
        True capture positions, shape (n, 2), metres, NaN where unknown; None when none is known.
    unposed
        Which are not known, and why; None if all are.
    described
        The frames' descriptions, in order, computed as they are asked for.
    camera
        What determines a panorama, besides where that is known from; None if there are no images.
    camera_about
        The same with where it is known from, for ``run.json``.
    card
        Name of the data card, if there is one.
    findings
        What is odd about the source, a line per kind; no errors, or there would be no material.
    skipped
        Images that were left out because they are not fit for use; None if `skip_bad` was not asked for.
    pictures
        Where the recording takes its pictures from; None if there are none.
    cache
        Where descriptions are looked up; None if they are at hand.
    earlier
        The run whose map is continued: its images are the first of the frames, and source, cut, camera, findings and
        images left out are those of what follows. None if the map is a new one.
    perturbation
        What was changed of the sequence (`datasets.perturbation`); empty if nothing was.
    """

    name: str
    source: str
    cut: Cut
    descriptor: Component
    cells: int
    frames: tuple[Frame, ...]
    positions: NDArray[np.float64] | None
    unposed: str | None
    described: Iterable[DescribedFrame]
    camera: Mapping[str, Any] | None = None
    camera_about: Mapping[str, Any] | None = None
    card: str | None = None
    findings: tuple[KindOfFinding, ...] = ()
    skipped: tuple[BadImage, ...] | None = None
    pictures: Pictures | None = None
    cache: DescriptorCache | None = None
    earlier: Earlier | None = None
    perturbation: str = ""

    @property
    def determining(self) -> dict[str, Any]:
        """All settings besides the mapper's that determine the result; part of the run's identity."""
        return {"descriptor": self.descriptor.identity, "camera": self.camera}

    @property
    def about(self) -> dict[str, Any]:
        """What ``run.json`` says of it."""
        return {
            "source": self.source,
            "sequence": self.name,
            "card": self.card,
            "cut": dataclasses.asdict(self.cut),
            "perturbation": self.perturbation or None,
            "frames": len(self.frames),
            "camera": self.camera_about,
            "descriptor": self.descriptor.about,
            "orientation_cells": self.cells,
            "findings": [dataclasses.asdict(finding) for finding in self.findings],
            **({} if self.skipped is None else {"skipped": [dataclasses.asdict(bad) for bad in self.skipped]}),
            **({} if self.earlier is None else {"continues": self.earlier.about}),
        }


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
        yield _of_archive(file, cut)
        return
    sequence = (source if isinstance(source, Sequence) else load(source)).cut(**dataclasses.asdict(cut))
    sequence, skipped = without_bad(sequence) if skip_bad else (sequence, None)
    with DescriptorCache() as cache:
        material = _of_images(sequence, config, cache, skipped, elsewhere=elsewhere)
        for finding in material.findings:
            if finding.severity == "warning":
                _LOG.warning("%s", finding)
        yield material


@contextmanager
def opened_after(run: Run, source: Source, cut: Cut | None = None, *, skip_bad: bool = False) -> Iterator[Material]:
    """Give the material of a source as what follows on the images in the map of a run, described as these are.

    Parameters
    ----------
    run
        A complete run that kept its map.
    source, cut, skip_bad
        See `opened`.

    Raises
    ------
    ConfigError, DatasetError
        See `opened`.
    ResultError
        If there is no map, its descriptor cannot be made again as it was, or the source cannot be described like it.
    """
    map_ = run.map
    config = described_again(run.config)
    refused = f"{named(source)} cannot continue from the map of {run.folder}"
    if fault := other_kind(source, config.descriptor):
        raise ResultError(f"{refused}: {fault}")
    with opened(source, config, cut, skip_bad=skip_bad) as material:
        described = iter(material.described)
        first = next(described)
        if fault := other_images(material, first, map_):
            raise ResultError(f"{refused}: {fault}")
        following = dataclasses.replace(material, described=chain([first], described))
        yield _following(Earlier(run, map_), following)


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
        whole = material if earlier is None else _following(earlier, material)
        yield _as_it_was(manifest, files, where, whole)


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
        yield _of_archive(file, cut)
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
        yield _of_images(sequence, config, cache, skipped, camera, cells)


def archive_file(source: Source) -> Path | None:
    """Return the archive of descriptors that a source names, None if it names a sequence.

    Raises
    ------
    ConfigError
        If it is an archive that is to be perturbed, or given other poses.
    """
    if isinstance(source, Sequence):
        return None
    text = str(source)
    place, changes = apart(text, OF_PERTURBATION)
    if changes and _is_called_archive(place):
        raise ConfigError(
            f"{place} holds descriptors, and only images can be perturbed; cut it with --start and --stride"
        )
    place, poses = apart(text, OF_POSES)
    if poses and _is_called_archive(place):
        raise ConfigError(
            f"{place} has poses of its own, xy and yaw; leave --poses out, or describe the images with it"
        )
    return Path(text.removeprefix(ARCHIVE_SCHEME)).expanduser() if _is_called_archive(text) else None


def _is_called_archive(name: str) -> bool:
    return name.startswith(ARCHIVE_SCHEME) or name.casefold().endswith(".npz")


def with_poses(
    source: Source,
    poses: str | Path | None = None,
    poses_tolerance: float | None = None,
    poses_interpolate: float | None = None,
) -> Source:
    """Return a source with poses written into it; see `datasets.registry.posed_source`.

    Raises
    ------
    ConfigError
        If poses are given to a sequence, which has been loaded.
    """
    if (poses, poses_tolerance, poses_interpolate) == (None, None, None):
        return source
    if isinstance(source, Sequence):
        raise ConfigError("a loaded sequence has its poses already; give them to omnieval.load")
    return posed_source(source, poses, poses_tolerance, poses_interpolate)


def refuse_descriptor(source: Source, config: Config) -> None:
    """Refuse a descriptor that was chosen for an archive.

    Raises
    ------
    ConfigError
        If one was.
    """
    if not config.descriptor.is_default and config.descriptor != ARCHIVE:
        raise ConfigError(f"{source} holds descriptors already; leave the descriptor out")


def named(source: Source) -> str:
    """Return what to call a source."""
    return source.source if isinstance(source, Sequence) else str(source)


def other_kind(source: Source, descriptor: Component) -> str | None:
    """Say why a source cannot be described as the images of a map were; None if it may.

    Parameters
    ----------
    source
        A source.
    descriptor
        That of the map.
    """
    if (archive_file(source) is not None) == (descriptor == ARCHIVE):
        return None
    if descriptor == ARCHIVE:
        return "the map is of descriptors that were made elsewhere; describe the images like these and give npz:FILE"
    return f"the map is of images described by {descriptor.name}; give the images, not descriptors of them"


def other_images(material: Material, first: DescribedFrame, map_: TopologicalMap) -> str | None:
    """Say why images cannot be compared with those of a map; None if they can.

    Parameters
    ----------
    material
        The images.
    first
        The first of them.
    map_
        The map.
    """
    if fault := other_camera(material.camera, map_.about["camera"]):
        return fault
    shapes = [getattr(first.description, part).shape for part in ("position", "orientation")]
    expected = [map_.positions.shape[1:], map_.orientations.shape[1:]]
    if shapes == expected:
        return None
    return (
        f"its descriptors have shapes {shapes[0]} and {shapes[1]}, those of the map {expected[0]} and {expected[1]}; "
        "describe both in the same way"
    )


def other_camera(camera: Mapping[str, Any] | None, of_map: Mapping[str, Any] | None) -> str | None:
    """Say why panoramas of two cameras cannot be compared; None if they can.

    Where the mirror lies does not matter: it may differ from sequence to sequence.
    """
    if camera is None or of_map is None:
        return None if camera is of_map else "one has images and the other only descriptors; use the same kind"
    differing = [
        f"{name} {camera.get(name)}, not {of_map.get(name)}"
        for name in sorted({*camera, *of_map} - {"origin", "mirror", "disturbance"})
        if camera.get(name) != of_map.get(name)
    ]
    return f"its camera has {', '.join(differing)}; set imaging as the map has it" if differing else None


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


def why_unposed(frames: Iterable[Frame]) -> str | None:
    """Say why not all positions of frames are known; None if they are.

    Examples
    --------
    >>> why_unposed([Frame(Path("a.png"), "a.png", pose=Pose(math.nan, 1.0, 0.0))])
    '1 of 1 images have a pose that is not finite'
    """
    poses = [frame.pose for frame in frames]
    known = [pose for pose in poses if pose is not None]
    finite = [pose for pose in known if math.isfinite(pose.x) and math.isfinite(pose.y)]
    if not known and poses:
        return "the sequence has no poses"
    counts = {
        "no pose": len(poses) - len(known),
        "a pose that is not finite": len(known) - len(finite),
        "a pose too far away to be metres": sum(not _is_metres(pose) for pose in finite),
    }
    lacking = [f"{count} of {len(poses)} images have {what}" for what, count in counts.items() if count]
    return "; ".join(lacking) or None


def _of_images(
    sequence: Sequence,
    config: Config,
    cache: DescriptorCache,
    skipped: tuple[BadImage, ...] | None,
    camera: CameraModel | None = None,
    undescribed_cells: int | None = None,
    elsewhere: Elsewhere | None = None,
) -> Material:
    sequence = examined(sequence, cache)
    unposed = why_unposed(sequence.frames)
    sequence = dataclasses.replace(sequence, frames=tuple(map(_within_a_building, sequence.frames)))
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


def _following(earlier: Earlier, material: Material) -> Material:
    """Return material as what follows on the images of a map: one sequence, of both."""
    map_ = earlier.map
    frames = (*_frames_of(map_), *material.frames)
    positions, unposed = None, material.unposed
    if not map_.is_posed:
        unposed = "the images of the map that is continued have no poses"
    elif material.positions is not None:
        positions, unposed = np.vstack([map_.xy, material.positions]), why_unposed(frames)
    pictures = material.pictures
    if pictures is not None:
        pictures = JoinedPictures(lambda: _pictures_of(earlier.run), len(map_), pictures)
    return dataclasses.replace(
        material,
        name=f"{earlier.run.manifest['sequence']}+{material.name}",
        frames=frames,
        positions=positions,
        unposed=unposed,
        described=chain(_described_in(map_), material.described),
        pictures=pictures,
        earlier=earlier,
    )


def _frames_of(map_: TopologicalMap) -> Iterator[Frame]:
    """Yield the images of a map, of which only names, times, places and rooms are known."""
    columns = (map_.files.tolist(), map_.times.tolist(), map_.xy.tolist(), map_.yaws.tolist(), map_.rooms.tolist())
    for file, time_ns, (x, y), yaw, room in zip(*columns, strict=True):
        pose = Pose(x, y, yaw) if math.isfinite(x) and math.isfinite(y) else None
        yield Frame(Path(), file, None if time_ns == UNTIMED else time_ns, pose, room or None)


def _described_in(map_: TopologicalMap) -> Iterator[DescribedFrame]:
    for description in map_.descriptions():
        yield DescribedFrame(description, _digest(description))


def _pictures_of(run: Run) -> Pictures:
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


def _changed(described: Iterator[DescribedFrame], perturbation: str) -> Iterator[DescribedFrame]:
    """Yield descriptions whose digests know of a perturbation: the images on disk are not what was described."""
    for one in described:
        yield dataclasses.replace(one, digest=digest_of([one.digest, perturbation]))


def _undescribed(frames: Iterable[Frame]) -> Iterator[DescribedFrame]:
    nothing = Description(np.zeros(0, np.float32), np.zeros((0, 0), np.float32))
    for frame in frames:
        yield DescribedFrame(nothing, image_digest(frame.read()))


def _of_archive(file: Path, cut: Cut) -> Material:
    archive = load_archive(file, may_map=True)
    chosen = range(len(archive.frames))[cut.start :: cut.stride][: cut.limit]
    if not chosen:
        raise DatasetError(
            f"{file}: start {cut.start}, stride {cut.stride}, limit {cut.limit} leave none of its "
            f"{len(archive.frames)} images"
        )
    frames = tuple(archive.frames[index] for index in chosen)
    posed = tuple(map(_within_a_building, frames))
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


def _of_arrays(archive: Archive, chosen: Iterable[int]) -> Iterator[DescribedFrame]:
    for number, index in enumerate(chosen):
        if number % _RELEASED == 0:
            archive.release()
        description = archive.description(index)
        yield DescribedFrame(description, _digest(description))


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


def _as_it_was(manifest: Mapping[str, Any], files: Frames[str], where: str, material: Material) -> Material:
    return held_against(material, files, manifest.get("dataset_fingerprint"), where)


def _within_a_building(frame: Frame) -> Frame:
    """Return a frame without a pose that cannot be metres: distances over such mean nothing, or overflow."""
    return frame if frame.pose is None or _is_metres(frame.pose) else dataclasses.replace(frame, pose=None)


def _is_metres(pose: Pose) -> bool:
    return abs(pose.x) <= FARTHEST_M and abs(pose.y) <= FARTHEST_M


def _digest(description: Description) -> str:
    content = hashlib.blake2b(description.position.tobytes(), digest_size=16)
    content.update(description.orientation.tobytes())
    return content.hexdigest()
