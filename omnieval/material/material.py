"""What is replayed, whether it comes from images or from descriptors computed elsewhere."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from omnieval.components.component import Component
from omnieval.datasets.findings import KindOfFinding
from omnieval.datasets.sequence import Frame
from omnieval.descriptors.cache import DescriptorCache
from omnieval.descriptors.description import DescribedFrame
from omnieval.imaging.pictures import Pictures
from omnieval.imaging.soundness import BadImage
from omnieval.mapping.map import TopologicalMap
from omnieval.material.source import Cut
from omnieval.results.run_folder import Run


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
