"""What a source names: a sequence of images or an archive of descriptors, whole or cut."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from omnieval.components.component import Component
from omnieval.config import Config
from omnieval.datasets.perturbation import OPTIONS as OF_PERTURBATION
from omnieval.datasets.registry import posed_source
from omnieval.datasets.sequence import Sequence
from omnieval.datasets.source import apart
from omnieval.datasets.trajectory.load import OPTIONS as OF_POSES
from omnieval.errors import ConfigError

ARCHIVE_SCHEME = "npz:"
"""How the source of an archive begins."""

ARCHIVE = Component("descriptor", "archive", None, {}, "")
"""Stands for the descriptor of an archive, whose descriptions are part of the fingerprint."""

Source = str | Path | Sequence


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
