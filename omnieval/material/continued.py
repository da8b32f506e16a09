"""A source as what follows on the map of a run, if its images can be compared with those of the map."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from itertools import chain
from typing import Any

from omnieval.components.component import Component
from omnieval.descriptors.description import DescribedFrame
from omnieval.errors import ResultError
from omnieval.mapping.map import TopologicalMap
from omnieval.material.joined import following
from omnieval.material.material import Earlier, Material
from omnieval.material.opening import opened
from omnieval.material.reopened import described_again, pictures_of
from omnieval.material.source import ARCHIVE, Cut, Source, archive_file, named
from omnieval.results.run_folder import Run


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
        new = dataclasses.replace(material, described=chain([first], described))
        yield following(Earlier(run, map_), new, partial(pictures_of, run))


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
