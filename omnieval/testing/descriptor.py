"""The contract of descriptors."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from concurrent.futures import ThreadPoolExecutor
from itertools import cycle, islice

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel
from scipy.ndimage import gaussian_filter

from omnieval.components.names import name_of
from omnieval.components.settings import plain_settings
from omnieval.descriptors.description import BatchDescriptor, Description, Descriptor
from omnieval.errors import ConfigError
from omnieval.testing.contract import require, same


def check_descriptor(
    descriptor: Descriptor, panoramas: Iterable[NDArray[np.uint8]] | None = None, *, tolerance: float = 1e-4
) -> None:
    """Check that a descriptor keeps its contract.

    - `name`, if it has one, is a plain word, and `settings` can be written as JSON (they are part of the cache key and
      of the run's identity); describing changes neither.
    - `describe` returns a `Description` of finite float32 arrays, position (d,) and orientation (cells, bins), of the
      same shapes for panoramas of one size; black, grey and white panoramas included.
    - Pure: the panorama is not changed, equal panoramas give equal arrays to the bit, whatever was described in
      between and from two threads at once, and no array returned earlier is written again.
    - A `BatchDescriptor` gives several at once what it gives each of them alone, to the bit, in any order.
    - Different panoramas differ in both descriptors; a descriptor without an orientation part has one cell, shape
      (1, 1), that is always the same.
    - A panorama rolled by c cells has the same position descriptor, and the orientation descriptor rolled by c; without
      an orientation part, the position descriptor is the same however the panorama is rolled.

    Parameters
    ----------
    descriptor
        The descriptor under test.
    panoramas
        Panoramas of one size, shape (rows, columns), or (rows, columns, 3) if it asks for colour, uint8, at least two
        different ones; three synthetic ones of 128 x 512 pixels by default.
    tolerance
        Largest relative change, in the L2 norm, that a rotation may cause.

    Raises
    ------
    AssertionError
        At the first clause that does not hold.
    ConfigError
        If there are fewer than two panoramas.
    """
    colour = bool(getattr(descriptor, "colour", False))
    images = _panoramas(colour=colour) if panoramas is None else list(panoramas)
    if len(images) < 2:
        raise ConfigError(f"check_descriptor needs at least two panoramas, got {len(images)}; give more, or none")
    name, settings = name_of(descriptor), _settings_text(descriptor)
    require(name.replace("-", "_").isidentifier(), f"name must be a plain word, got {name!r}")
    described = _check_purity(descriptor, images)
    if isinstance(descriptor, BatchDescriptor):
        _check_batches(descriptor, images, described)
    for image, description in zip(images, described, strict=True):
        _check_rotation(descriptor, image, description, tolerance)
    _check_distinct(described)
    for grey in (0, 128, 255):
        constant = descriptor.describe(np.full_like(images[0], grey))
        _check_description(constant, f"a panorama of constant grey level {grey}", like=described[0])
    require(
        (name_of(descriptor), _settings_text(descriptor)) == (name, settings),
        "name and settings must stay as they are, but describing changed them",
    )


def _panoramas(*, colour: bool) -> list[NDArray[np.uint8]]:
    """Three panoramas with texture at several scales and edges; the same ones every time."""
    rng = np.random.default_rng(6480)
    images = []
    for size in (2, 4, 8):
        scene = gaussian_filter(rng.normal(size=(128, 512)), size, mode=("nearest", "wrap"))
        grey = 118 + 40 * scene / scene.std() + 40 * (scene > 0) + rng.normal(0, 4, scene.shape)
        image = np.clip(grey, 0, 255).astype(np.uint8)
        images.append(np.stack([image, np.roll(image, 5, axis=0), 255 - image], axis=2) if colour else image)
    return images


def _settings_text(descriptor: Descriptor) -> str:
    """Return the settings as text: those it declares, else the public attributes of the object."""
    declared = getattr(descriptor, "settings", {})
    require(
        isinstance(declared, Mapping | BaseModel),
        f"settings must be a dict or a pydantic model, got {type(declared).__name__}",
    )
    settings = {name: value for name, value in plain_settings(descriptor).items() if not name.startswith("_")}
    try:
        return json.dumps(settings, sort_keys=True, allow_nan=False)
    except (TypeError, ValueError) as error:
        raise AssertionError(f"settings must be plain values that JSON can hold: {error}") from error


def _check_description(description: Description, what: str, *, like: Description | None = None) -> None:
    require(isinstance(description, Description), f"describe must return a Description, got {type(description)}")
    for field, dimensions in (("position", 1), ("orientation", 2)):
        array = getattr(description, field)
        require(isinstance(array, np.ndarray), f"the {field} descriptor of {what} must be an array")
        require(array.dtype == np.float32, f"the {field} descriptor of {what} must be float32, got {array.dtype}")
        require(
            array.ndim == dimensions and array.size > 0,
            f"the {field} descriptor of {what} must have {dimensions} dimension(s), got shape {array.shape}",
        )
        require(np.isfinite(array).all(), f"the {field} descriptor of {what} has NaN or infinite values")
        if like is not None:
            expected = getattr(like, field).shape
            require(
                array.shape == expected,
                f"the {field} descriptor of {what} has shape {array.shape}, that of others {expected}",
            )


def _check_purity(descriptor: Descriptor, images: list[NDArray[np.uint8]]) -> list[Description]:
    """Describe every panorama, alone, again, and from two threads; return the descriptions."""
    described: list[Description] = []
    kept: list[Description] = []
    for number, image in enumerate(images):
        given = image.copy()
        description = descriptor.describe(given)
        require(np.array_equal(given, image), f"describe must not change the panorama, but changed panorama {number}")
        _check_description(description, f"panorama {number}", like=described[0] if described else None)
        described.append(description)
        kept.append(Description(description.position.copy(), description.orientation.copy()))
    again = [descriptor.describe(image.copy()) for image in images]
    require(same(described, kept), "arrays that describe returned must not be written again by a later call")
    require(same(again, kept), "equal panoramas must give equal arrays, but describing again gave others")
    with ThreadPoolExecutor(2) as pool:
        together = list(pool.map(descriptor.describe, [image.copy() for image in images * 2]))
    require(same(together, kept * 2), "describe must be safe to call from two threads, but gave other arrays")
    return kept


def _check_batches(descriptor: BatchDescriptor, images: list[NDArray[np.uint8]], alone: list[Description]) -> None:
    """Describe panoramas a few at once, forwards and backwards, in batches of every size up to the one it wants."""
    size = descriptor.batch
    require(isinstance(size, int) and size > 0, f"batch must be a whole number from 1, got {size!r}")
    for order in (1, -1):
        for count in sorted({1, min(2, size), size}):
            given = list(islice(cycle(images[::order]), count))
            described = list(descriptor.describe_batch([image.copy() for image in given]))
            expected = list(islice(cycle(alone[::order]), count))
            require(len(described) == count, f"describe_batch gave {len(described)} descriptions of {count} panoramas")
            require(
                same(described, expected),
                f"describe_batch must give {count} panoramas what describe gives each of them",
            )


def _check_rotation(descriptor: Descriptor, image: NDArray[np.uint8], still: Description, tolerance: float) -> None:
    cells, columns = len(still.orientation), image.shape[1]
    require(
        columns % cells == 0,
        f"the orientation descriptor must have a number of cells that divides {columns} columns, got {cells}",
    )
    steps, unit = (cells, "cell") if cells > 1 else (columns, "column")
    for roll in sorted({1, steps // 3, steps // 2} - {0}):
        turned = descriptor.describe(np.roll(image, roll * columns // steps, axis=1))
        rolled = np.roll(still.orientation, roll, axis=0)
        for field, found, expected in (
            ("keep the position descriptor", turned.position, still.position),
            (f"roll the orientation descriptor by {roll}", turned.orientation, rolled),
        ):
            change = float(np.linalg.norm(found - expected) / max(float(np.linalg.norm(expected)), 1e-12))
            require(
                change <= tolerance,
                f"a panorama rolled by {roll} {unit}(s) must {field}, but it changed by {change:.2g} of its norm "
                f"(tolerance {tolerance:g})",
            )


def _check_distinct(described: list[Description]) -> None:
    oriented = described[0].orientation.shape != (1, 1)
    for field in ("position", "orientation") if oriented else ("position",):
        distinct = {getattr(description, field).tobytes() for description in described}
        require(len(distinct) > 1, f"different panoramas must differ, but all have the same {field} descriptor")
    if not oriented:
        cells = {float(description.orientation[0, 0]) for description in described}
        require(len(cells) == 1, f"an orientation descriptor of one cell must always be the same, got {sorted(cells)}")
