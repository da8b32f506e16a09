"""A sequence described into an archive, to be mapped or compared elsewhere."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from omnieval.config import Config, as_config
from omnieval.descriptors.archive import Archive, save_archive
from omnieval.loop import Progress
from omnieval.material.material import Material
from omnieval.material.opening import opened
from omnieval.material.source import Cut, Source, with_poses
from omnieval.results.atomic import claim_file, replacing


def describe_archive(
    source: Source,
    file: str | Path,
    *,
    descriptor: Any = None,
    config: Config | Mapping[str, Any] | None = None,
    poses: str | Path | None = None,
    poses_tolerance: float | None = None,
    poses_interpolate: float | None = None,
    start: int = 0,
    stride: int = 1,
    limit: int | None = None,
    overwrite: bool = False,
    skip_bad: bool = False,
    progress: Progress | None = None,
    **parameters: Any,
) -> tuple[Archive, Material]:
    """Describe a sequence and write the archive; see `replay` and `descriptors.archive`."""
    path = Path(file).expanduser()
    claim_file(path, overwrite=overwrite)
    resolved = as_config(config, descriptor=descriptor, **parameters)
    source = with_poses(source, poses, poses_tolerance, poses_interpolate)
    with opened(source, resolved, Cut(start, stride, limit), skip_bad=skip_bad) as material:
        described = []
        for one in material.described:
            described.append(one.description)
            if progress:
                progress(len(described), len(material.frames))
        archive = Archive(
            material.frames,
            np.stack([description.position for description in described]),
            np.stack([description.orientation for description in described]),
        )
    with replacing(path) as temporary:
        save_archive(temporary, archive.frames, archive.position, archive.orientation)
    return archive, material
