"""What can be replayed: a sequence of images, or descriptors computed elsewhere."""

from __future__ import annotations

import dataclasses
import hashlib
import math
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from omnieval.config import Config
from omnieval.datasets.scan import FARTHEST_M
from omnieval.datasets.sequence import Frame, Pose, Sequence
from omnieval.descriptors.archive import load_archive
from omnieval.descriptors.cache import DescriptorCache
from omnieval.descriptors.describe import DescribedFrame, Describer
from omnieval.descriptors.description import Description, Descriptor
from omnieval.imaging.camera import resolve_camera
from omnieval.imaging.pictures import Pictures
from omnieval.imaging.soundness import BadImage, refuse_bad

ARCHIVE_SCHEME = "npz:"
"""How the source of an archive begins."""


@dataclass(frozen=True)
class Material:
    """What is replayed, whether it comes from images or from descriptors computed elsewhere.

    Attributes
    ----------
    name, source
        Of the sequence.
    descriptor
        Name of the descriptor.
    cells
        Cells of its orientation descriptor.
    frames
        Its frames.
    positions
        True capture positions, shape (n, 2), metres; None when not all are known.
    unposed
        Why they are not known, None if they are.
    described
        The frames' descriptions, in order, computed as they are asked for.
    determining
        All settings besides the mapper's that determine the result; part of the run's identity.
    about
        What else ``run.json`` says of it.
    pictures
        Where the recording takes its pictures from; None if there are none.
    cache
        Where descriptions are looked up; None if they are at hand.
    """

    name: str
    source: str
    descriptor: str
    cells: int
    frames: tuple[Frame, ...]
    positions: NDArray[np.float64] | None
    unposed: str | None
    described: Iterable[DescribedFrame]
    determining: dict[str, Any]
    about: dict[str, Any]
    pictures: Pictures | None = None
    cache: DescriptorCache | None = None


def image_material(
    sequence: Sequence,
    config: Config,
    descriptor: Descriptor,
    cache: DescriptorCache,
    *,
    left_out: tuple[BadImage, ...] | None = None,
) -> Material:
    """Return a sequence of images as material: its camera resolved, its descriptions ready to be computed.

    Parameters
    ----------
    sequence
        The images.
    config
        What to make of them.
    descriptor
        Describes them.
    cache
        Where descriptions are looked up and kept.
    left_out
        The images that `without_bad` has taken out of the sequence; None if nobody asked for that.

    Raises
    ------
    ConfigError, DatasetError
        If an image is not fit for use, the camera cannot be resolved or the first image not be described.
    """
    refuse_bad(sequence, cache)
    unposed = why_unposed(sequence.frames)
    sequence = dataclasses.replace(sequence, frames=tuple(map(_within_a_building, sequence.frames)))
    camera = resolve_camera(sequence, config.imaging, cache)
    described = Describer(camera, descriptor, cache).describe_frames(sequence.frames)
    first = next(described)
    return Material(
        name=sequence.name,
        source=sequence.source,
        descriptor=descriptor.name,
        cells=len(first.description.orientation),
        frames=sequence.frames,
        positions=sequence.positions,
        unposed=unposed,
        described=chain([first], described),
        determining={"descriptor": {"name": descriptor.name, **descriptor.settings}, "camera": camera.settings},
        about={
            "sequence": sequence.name,
            "card": sequence.card,
            "cut": dict(zip(("start", "stride", "limit"), sequence.cut_from, strict=True)),
            "camera": {"origin": camera.origin, **camera.settings},
            **({} if left_out is None else {"skipped": [dataclasses.asdict(bad) for bad in left_out]}),
        },
        pictures=Pictures(sequence.frames, camera),
        cache=cache,
    )


def archive_material(file: Path) -> Material:
    """Return an archive of descriptors as material."""
    archive = load_archive(file)
    frames = tuple(map(_within_a_building, archive.frames))
    poses = [frame.pose for frame in frames]
    positions = None if None in poses else np.array([[pose.x, pose.y] for pose in poses if pose])
    return Material(
        name=file.stem,
        source=f"{ARCHIVE_SCHEME}{file.resolve()}",
        descriptor="archive",
        cells=archive.orientation.shape[1],
        frames=frames,
        positions=positions,
        unposed=why_unposed(archive.frames),
        described=(
            DescribedFrame(description, _digest(description))
            for description in map(archive.description, range(len(archive.frames)))
        ),
        determining={"descriptor": {"name": "archive"}},
        about={"sequence": file.stem, "cut": {"start": 0, "stride": 1, "limit": None}},
    )


def why_unposed(frames: Iterable[Frame]) -> str | None:
    """Say why not all positions of frames are known; None if they are.

    Examples
    --------
    >>> why_unposed([Frame(0, "a.png", Path("a.png"), pose=Pose(math.nan, 1.0, 0.0))])
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


def _within_a_building(frame: Frame) -> Frame:
    """Return a frame without a pose that cannot be metres: distances over such mean nothing, or overflow."""
    return frame if frame.pose is None or _is_metres(frame.pose) else dataclasses.replace(frame, pose=None)


def _is_metres(pose: Pose) -> bool:
    return abs(pose.x) <= FARTHEST_M and abs(pose.y) <= FARTHEST_M


def _digest(description: Description) -> str:
    content = hashlib.blake2b(description.position.tobytes(), digest_size=16)
    content.update(description.orientation.tobytes())
    return content.hexdigest()
