"""Ways to find an image in a map: by the mapper's own levels, by the nearest image of all, coarse to fine.

Images are compared by the product of their position and orientation distances, whose inverse is the paper's similarity
(Román et al., doi 10.3390/app10186480, Eqs. 5 to 8).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from omnieval.components.component import Component
from omnieval.cores import allotted
from omnieval.descriptors.description import Description
from omnieval.descriptors.distance import Distances
from omnieval.errors import ConfigError
from omnieval.loop import mapped
from omnieval.mapping.interface import BranchingMapper, Mapper, Method
from omnieval.mapping.map import TopologicalMap
from omnieval.mapping.memory import AHEAD, ImageMemory, blocks
from omnieval.mapping.step import Match, Role, Step
from omnieval.wording import did_you_mean

DISTANCE_FLOOR = 1e-9
"""Identical images are this far apart, as in the mapper's similarities."""

LEVELS, NEAREST, COARSE = "levels", "nearest", "coarse"


@dataclass(frozen=True)
class Found:
    """What a strategy made of one image.

    Attributes
    ----------
    step
        Node and best image, or that it was refused and why.
    candidates
        The nodes whose images it was compared with.
    ranked
        The images it was compared with, the most similar first, shape (m,).
    doubt
        What stands for "not in the map": the value of the first gate, or the product distance of the best image where
        there is no gate; the lower, the surer. None if nothing was compared.
    """

    step: Step
    candidates: tuple[int, ...]
    ranked: NDArray[np.int64]
    doubt: float | None


class Strategy(ABC):
    """Finds images in a map, one by one; the map stays as it is.

    Parameters
    ----------
    map_
        The map.
    mapper
        What made it.
    """

    name: ClassVar[str]

    def __init__(self, map_: TopologicalMap, mapper: Component) -> None:
        self.map = map_
        self.mapper = mapper

    @abstractmethod
    def expect(self, descriptions: Sequence[Description]) -> None:
        """Prepare for the images that come next, which are faster compared together; changes no answer."""

    @abstractmethod
    def find(self, description: Description) -> Found:
        """Say where an image is."""


class Levels(Strategy):
    """By the mapper's own levels; it may refuse. The mapper maps the images of the map again, as the run did."""

    name = LEVELS

    def __init__(self, map_: TopologicalMap, mapper: Component) -> None:
        super().__init__(map_, mapper)
        self._mapper = mapped(mapper, map_.descriptions())
        self._expect = getattr(self._mapper, "expect", None)
        self._method = Method.of(self._mapper, mapper.name, mapper.settings)

    def expect(self, descriptions: Sequence[Description]) -> None:
        """See `Strategy.expect`."""
        if self._expect:
            self._expect(descriptions)

    def find(self, description: Description) -> Found:
        """See `Strategy.find`."""
        step = self._mapper.locate(description)
        if step is None:
            raise ConfigError(f"the mapper {self.mapper.name} has no levels by which it finds an image; {_OTHERS}")
        return Found(step, self._candidates(step), _ranked(step), self._doubt(step))

    def _candidates(self, step: Step) -> tuple[int, ...]:
        if step.curves is None:
            return () if step.match is None else (step.match.node,)
        return tuple(np.unique(self.map.labels[step.curves.frames]).tolist())

    def _doubt(self, step: Step) -> float | None:
        gate = next((one for one in step.comparisons if self._method.gate(one.gate).closes), None)
        if gate is None:
            return None
        return -gate.best if gate.reaches else gate.best


class _ByImages(Strategy):
    """Compares an image with images of the map."""

    def __init__(self, map_: TopologicalMap, mapper: Component) -> None:
        super().__init__(map_, mapper)
        self._images = ImageMemory(threads=allotted())
        for block in blocks(map_.descriptions(), AHEAD):
            self._images.expect(block)
            for description in block:
                self._images.append(description)

    def expect(self, descriptions: Sequence[Description]) -> None:
        """See `Strategy.expect`."""
        self._images.expect(descriptions)

    def _among(self, frame: int, images: NDArray[np.int64], candidates: tuple[int, ...]) -> Found:
        """Find an image among some of the map's, which are those of some nodes."""
        compared = self._images.compare(frame, images)
        products = product_distance(compared)
        order = products.argsort(kind="stable")
        best, labels = int(order[0]), self.map.labels
        node = int(labels[images[best]])
        match = Match(int(images[best]), node, int(compared.shifts[best]))
        step = Step(frame, "most similar", Role.JOINED, node or None, match)
        return Found(step, candidates, images[order], float(products[best]))


class Nearest(_ByImages):
    """By the most similar image of the whole map; never refuses."""

    name = NEAREST

    def __init__(self, map_: TopologicalMap, mapper: Component) -> None:
        super().__init__(map_, mapper)
        self._all = np.arange(len(map_))
        self._nodes = tuple(map_.nodes.tolist())

    def find(self, description: Description) -> Found:
        """See `Strategy.find`."""
        return self._among(self._images.append(description), self._all, self._nodes)


class Coarse(_ByImages):
    """By the node with the nearest representative, then its most similar image; never refuses."""

    name = COARSE

    def find(self, description: Description) -> Found:
        """See `Strategy.find`."""
        away = np.linalg.norm(self.map.representatives - description.position, axis=1)
        node = int(self.map.nodes[away.argmin()])
        return self._among(self._images.append(description), self.map.images_of(node), (node,))


STRATEGIES: dict[str, type[Strategy]] = {one.name: one for one in (Levels, Nearest, Coarse)}
"""The ways to find an image, by their names."""
_OTHERS = f"choose --strategy {NEAREST},{COARSE}"


def check_strategies(names: Sequence[str]) -> None:
    """Refuse names that are no strategies, or none at all.

    Raises
    ------
    ConfigError
        If one is none, or stands twice.
    """
    for name in names:
        if name not in STRATEGIES:
            raise ConfigError(f"unknown strategy {name!r}; {did_you_mean(name, STRATEGIES)}")
    if not names or len(set(names)) < len(names):
        raise ConfigError("name each strategy once: levels, nearest, coarse")


def has_levels(mapper: Component) -> bool:
    """Whether a mapper finds images by levels of its own.

    Raises
    ------
    ConfigError
        If its class cannot be found.
    """
    locate = getattr(mapper.cls, "locate", Mapper.locate)
    look = getattr(mapper.cls, "look", BranchingMapper.look)
    return locate not in (Mapper.locate, BranchingMapper.locate) or look is not BranchingMapper.look


def product_distance(compared: Distances) -> NDArray[np.float64]:
    """Return the product of position and orientation distances, shape (m,)."""
    return np.maximum(compared.position, DISTANCE_FLOOR) * np.maximum(compared.orientation, DISTANCE_FLOOR)


def _ranked(step: Step) -> NDArray[np.int64]:
    if step.curves is None:
        return np.array([] if step.match is None else [step.match.frame], np.int64)
    first = next(iter(step.curves.values.values()))
    return step.curves.frames[(-first).argsort(kind="stable")]
