"""Many settings of one mapper at once, in one tree: what they have in common is computed once.

Two mappers decide alike until a comparison has another result. So all of them begin as one mapper; where the
comparisons of a step tell that some would have gone another way, these continue with a mapper of their own. Every
setting gets, to the bit, what a mapper of its own would have given it. It works for every mapper that says in its
comparisons all that the swept parameters decide (`BranchingMapper.swept`).

The same tree finds every value of a parameter at which the map changes, over a whole interval.
"""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Generic, Protocol, Self, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel

from omnieval.descriptors.description import Description
from omnieval.mapping.interface import BranchingMapper
from omnieval.mapping.journal import Journal
from omnieval.mapping.memory import AHEAD, ImageMemory, blocks
from omnieval.mapping.step import Comparison, FinalMap, Placement, Step


class Region(Protocol):
    """Some settings, that have all gone the same way so far."""

    @property
    def count(self) -> int:
        """How many they are, for dividing costs; an interval counts as one."""
        ...

    @property
    def alone(self) -> bool:
        """Whether it is a single configuration, which cannot be divided further."""
        ...

    @property
    def representative(self) -> BaseModel:
        """The setting that stands for all of them."""
        ...

    def split(self, comparisons: Sequence[Comparison]) -> tuple[Self, list[Self]]:
        """Return those for which all comparisons come out as for the representative, and the others."""
        ...


R = TypeVar("R", bound=Region)


@dataclass(frozen=True)
class Points:
    """Configurations one by one, not empty."""

    settings: tuple[BaseModel, ...]

    @property
    def count(self) -> int:
        """See `Region`."""
        return len(self.settings)

    @property
    def alone(self) -> bool:
        """See `Region`."""
        return len(self.settings) == 1

    @property
    def representative(self) -> BaseModel:
        """See `Region`."""
        return self.settings[0]

    def split(self, comparisons: Sequence[Comparison]) -> tuple[Points, list[Points]]:
        """See `Region`."""
        if self.alone:
            return self, []
        alike = tuple(one for one in self.settings if _same(comparisons, one))
        others = tuple(one for one in self.settings if not _same(comparisons, one))
        return Points(alike), [Points(others)] if others else []


@dataclass(frozen=True)
class Interval:
    """All values of one parameter from `low` up to below `high`, the other parameters as in `base`."""

    base: BaseModel
    parameter: str
    low: float
    high: float

    @property
    def count(self) -> int:
        """See `Region`."""
        return 1

    @property
    def alone(self) -> bool:
        """See `Region`."""
        return False

    @property
    def representative(self) -> BaseModel:
        """See `Region`."""
        return self.base.model_copy(update={self.parameter: self.low})

    def split(self, comparisons: Sequence[Comparison]) -> tuple[Interval, list[Interval]]:
        """See `Region`."""
        low, high = self.low, self.high
        for one in comparisons:
            if one.parameter == self.parameter:
                first, beyond = one.span
                low, high = max(low, first), min(high, beyond)
        others = [(self.low, low), (high, self.high)]
        rest = [dataclasses.replace(self, low=first, high=beyond) for first, beyond in others if first < beyond]
        return dataclasses.replace(self, low=low, high=high), rest


Trail = tuple[int | None, "Trail | None"]


@dataclass
class Branch(Generic[R]):
    """Configurations that have gone the same way so far.

    Attributes
    ----------
    region
        The settings.
    mapper
        The mapper of these settings.
    seconds
        What each of them has cost: the time of a step is divided among those who took it.
    trail
        The node after the last step, None where none, and the trail before; None before the first.
    """

    region: R
    mapper: BranchingMapper
    seconds: float = 0.0
    trail: Trail | None = None


class Sweep(Generic[R]):
    """Maps a sequence with many settings of a mapper.

    Parameters
    ----------
    mapper
        The mapper.
    regions
        The settings, not empty; within a region they differ in `BranchingMapper.swept` only.

    Examples
    --------
    >>> import numpy as np
    >>> from omnieval.mapping.leader import Leader, LeaderSettings
    >>> rng = np.random.default_rng(0)
    >>> images = [Description(rng.random(4, np.float32), rng.random((8, 2), np.float32)) for _ in range(30)]
    >>> sweep = Sweep(Leader, [Points(tuple(LeaderSettings(radius=radius) for radius in (0.5, 1.0)))])
    >>> sum(len(points.settings) for points, step in list(sweep.steps(images))[-1])
    2
    """

    def __init__(self, mapper: type[BranchingMapper], regions: Iterable[R]) -> None:
        self._images = ImageMemory()
        self._branches = [Branch(region, mapper(region.representative, self._images)) for region in regions]

    def steps(self, descriptions: Iterable[Description]) -> Iterator[list[tuple[R, Step]]]:
        """Decide about image after image; yield for each the distinct steps and who took them.

        Raises
        ------
        ConfigError
            If a description's arrays are not finite or not shaped like the earlier ones.
        """
        for block in blocks(descriptions, AHEAD):
            started = time.perf_counter()
            self._images.expect(block)
            self._charge(time.perf_counter() - started)
            for description in block:
                yield self._decide(self._images.append(description))

    def finish(self) -> list[Outcome[R]]:
        """Return the final maps and whose they are.

        Raises
        ------
        ConfigError
            If there were fewer images than the first node needs.
        """
        leftovers = [set(branch.mapper.leftovers) for branch in self._branches]
        placings = [[_Placing(branch.region, branch.seconds)] for branch in self._branches]
        for block in blocks(sorted(set().union(*leftovers)), AHEAD):
            self._images.anticipate(block)
            for frame in block:
                for number, branch in enumerate(self._branches):
                    if frame in leftovers[number]:
                        placings[number] = _place(branch.mapper, frame, placings[number])
        return [
            Outcome(placing.region, branch.mapper.finish(placing.placed), placing.seconds, _walked(branch.trail))
            for branch, ways in zip(self._branches, placings, strict=True)
            for placing in ways
        ]

    def _decide(self, frame: int) -> list[tuple[R, Step]]:
        """Decide about an image in every branch, which may grow more branches."""
        branches: list[Branch[R]] = []
        steps: list[tuple[R, Step]] = []
        for branch in self._branches:
            for grown, step in _decide(branch, frame):
                branches.append(grown)
                steps.append((grown.region, step))
        self._branches = branches
        return steps

    def _charge(self, seconds: float) -> None:
        """Divide the cost of what serves all among all."""
        share = seconds / sum(branch.region.count for branch in self._branches)
        for branch in self._branches:
            branch.seconds += share


@dataclass(frozen=True)
class Outcome(Generic[R]):
    """What a sequence ended in.

    Attributes
    ----------
    region
        For whom.
    final
        The partition.
    seconds
        What it cost each of them.
    online
        Node that each image had after its own step, 0 where none, shape (n,).
    """

    region: R
    final: FinalMap
    seconds: float
    online: NDArray[np.int64]


def _decide(branch: Branch[R], frame: int) -> Iterator[tuple[Branch[R], Step]]:
    """Decide about an image; yield every way that is taken."""
    waiting = [branch.region]
    while waiting:
        started = time.perf_counter()
        region = waiting.pop()
        stays = region is branch.region and region.alone  # nobody needs the mapper as it is now
        mapper = branch.mapper if stays else branch.mapper.fork(region.representative)
        step = mapper.decide(frame)
        alike, others = region.split(step.comparisons)
        waiting += others
        seconds = branch.seconds + (time.perf_counter() - started) / alike.count
        yield Branch(alike, mapper, seconds, (step.node, branch.trail)), step


def _walked(trail: Trail | None) -> NDArray[np.int64]:
    """Return the nodes along a trail, 0 where none."""
    nodes = []
    while trail is not None:
        node, trail = trail
        nodes.append(node or 0)
    return np.array(nodes[::-1], np.int64)


@dataclass
class _Placing(Generic[R]):
    """Where the leftovers of some settings end."""

    region: R
    seconds: float
    placed: dict[int, tuple[int, Placement]] = field(default_factory=dict)


def _place(mapper: BranchingMapper, frame: int, placings: list[_Placing[R]]) -> list[_Placing[R]]:
    """Place a leftover for all settings of a branch, which may have to be divided for it."""
    known: list[tuple[list[Comparison], tuple[int, Placement]]] = []
    parted: list[_Placing[R]] = []
    for placing in placings:
        waiting = [placing.region]
        while waiting:
            started = time.perf_counter()
            region = waiting.pop()
            settings = region.representative
            found = next((one for one in known if _same(one[0], settings)), None)
            if found is None:
                journal = Journal()
                found = journal.comparisons, mapper.fork(settings).place(frame, journal)
                known.append(found)
            alike, others = region.split(found[0])
            waiting += others
            seconds = placing.seconds + (time.perf_counter() - started) / alike.count
            parted.append(_Placing(alike, seconds, placing.placed | {frame: found[1]}))
    return parted


def _same(comparisons: Iterable[Comparison], settings: BaseModel) -> bool:
    """Whether all comparisons come out the same with other settings."""
    return all(one.same_at(getattr(settings, one.parameter)) for one in comparisons if one.parameter is not None)
