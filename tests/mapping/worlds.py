"""Small seeded sequences of descriptors with the structure of a building: places, revisits, passages, pauses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from omnieval.descriptors.description import Description

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class World:
    """What a sequence looks like.

    A robot visits `places` one after the other (the first ones again and again), drives a closed circuit in
    each, and takes `passage` images on the way to the next. Descriptors are functions of where it is, plus
    noise; orientation descriptors are rolled by a random heading.

    Attributes
    ----------
    visits
        Number of stays; the route goes through all places once and then revisits them at random.
    dwell
        Shortest and longest stay, in images.
    spread
        Size of a place against the distances between places (about 1).
    noise
        Standard deviation of the noise on every component.
    repeats
        Share of images that repeat the previous image exactly.
    twins
        Whether the last place looks like the first but for its orientation descriptors.
    flat
        Number of position components that vary a hundred times less than the others.
    """

    seed: int = 0
    places: int = 5
    visits: int = 10
    dwell: tuple[int, int] = (18, 40)
    passage: int = 4
    spread: float = 0.4
    noise: float = 0.02
    repeats: float = 0.0
    twins: bool = False
    flat: int = 0
    dimension: int = 8
    cells: int = 32
    bins: int = 4

    def describe(self) -> list[Description]:
        """The sequence."""
        rng = np.random.default_rng(self.seed)
        basis = _Basis.draw(self, rng)
        descriptions: list[Description] = []
        for place, turn in _path(self, rng):
            if descriptions and rng.random() < self.repeats:
                descriptions.append(descriptions[-1])
            else:
                descriptions.append(_look(self, basis, place, turn, rng))
        return descriptions


@dataclass(frozen=True)
class _Basis:
    """Each place is an ellipse in the space of descriptors: centre + cos(turn) first + sin(turn) second."""

    position: Floats
    orientation: Floats

    @staticmethod
    def draw(world: World, rng: np.random.Generator) -> _Basis:
        position = rng.normal(size=(world.places, 3, world.dimension)) / np.sqrt(world.dimension)
        orientation = rng.normal(size=(world.places, 3, world.cells, world.bins)) / np.sqrt(world.cells)
        position[:, 1:] *= world.spread
        orientation[:, 1:] *= world.spread
        if world.twins:
            position[-1] = position[0]
        return _Basis(position, orientation)


def _path(world: World, rng: np.random.Generator) -> list[tuple[Floats, float]]:
    """Where each image is taken: the weight of every place, shape (places,), and the turn in its circuit."""
    route = [visit if visit < world.places else int(rng.integers(world.places)) for visit in range(world.visits)]
    path: list[tuple[Floats, float]] = []
    for here, there in zip(route, [*route[1:], route[-1]], strict=True):
        start = rng.uniform(0, 2 * np.pi)
        images = int(rng.integers(world.dwell[0], world.dwell[1] + 1))
        turns = start + np.arange(images) * 2 * np.pi / 20
        path += [(np.eye(world.places)[here], float(turn)) for turn in turns]
        for step in range(1, world.passage + 1):
            weight = step / (world.passage + 1)
            path.append(((1 - weight) * np.eye(world.places)[here] + weight * np.eye(world.places)[there], 0.0))
    return path


def _look(world: World, basis: _Basis, place: Floats, turn: float, rng: np.random.Generator) -> Description:
    """The descriptors seen from one spot, under a random heading."""
    wave = np.array([1.0, np.cos(turn), np.sin(turn)])
    position = np.einsum("p,w,pwd->d", place, wave, basis.position)
    orientation = np.einsum("p,w,pwcb->cb", place, wave, basis.orientation)
    position = position + world.noise * rng.normal(size=position.shape)
    position[: world.flat] *= 0.01
    orientation = orientation + world.noise * rng.normal(size=orientation.shape)
    heading = int(rng.integers(world.cells))
    return Description(position.astype(np.float32), np.roll(orientation, heading, axis=0).astype(np.float32))
