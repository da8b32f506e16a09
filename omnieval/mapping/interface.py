"""What a mapper is: it decides about images one by one, and declares the words of its evidence.

A mapper of your own derives from `Mapper`; one that derives from `BranchingMapper` is swept as a tree (`sweep`).
`omnieval.testing.check_mapper` checks the contract.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from copy import copy
from typing import Any, ClassVar, Literal, Self

from pydantic import BaseModel, ConfigDict

from omnieval.descriptors.description import Description
from omnieval.mapping.journal import Journal
from omnieval.mapping.memory import ImageMemory
from omnieval.mapping.step import FinalMap, Placement, Step

_LOCKED = ConfigDict(frozen=True, extra="forbid")


class NoSettings(BaseModel):
    """Of a component that has none."""

    model_config = _LOCKED


class Gate(BaseModel):
    """A kind of comparison that a mapper makes, in words.

    Attributes
    ----------
    name
        `Comparison.gate`.
    value, threshold
        What is compared, and with what.
    passing, refusing
        What the other outcome would do, to complete "omega >= 2.4 would ..."; ``{one}`` stands for the node or image.
    of
        What the values belong to, where there are several.
    closes
        Whether an image that fails here is refused a loop closure.
    plot_to
        Where the axis of its plot over the run ends; 0 for as far as the values go, None for no plot.
    """

    model_config = _LOCKED

    name: str
    value: str
    threshold: str
    passing: str = "pass this gate"
    refusing: str = "refuse at this gate"
    of: Literal["node", "image"] | None = None
    closes: bool = False
    plot_to: float | None = None


class Column(BaseModel):
    """A number that only one mapper has: a column of the steps.

    Attributes
    ----------
    name
        Of the column, and in `Step.measured`.
    type
        Of its values.
    meaning
        What it is, in a few words.
    unit
        Empty for plain numbers.
    plotted
        Whether the viewer plots it over the run.
    threshold_of
        The gate whose threshold it is: taken from the first comparison at that gate, not measured. Mappers that share
        a step in a sweep may have different ones.
    """

    model_config = _LOCKED

    name: str
    type: Literal["float", "int"]
    meaning: str
    unit: str = ""
    plotted: bool = False
    threshold_of: str | None = None


class Method(BaseModel):
    """A mapper as ``run.json`` describes it: all that is needed to read its evidence, without the mapper itself.

    Attributes
    ----------
    name, settings
        What it is called, and its parameters.
    ranges
        Between what its numbers can be set.
    gates, columns, curves
        The words of its evidence (`Mapper`).
    """

    model_config = ConfigDict(frozen=True, extra="ignore")

    name: str
    settings: dict[str, Any] = {}
    ranges: dict[str, tuple[float, float]] = {}
    gates: tuple[Gate, ...] = ()
    columns: tuple[Column, ...] = ()
    curves: tuple[str, ...] = ()

    @staticmethod
    def of(mapper: Any, name: str, settings: Mapping[str, Any]) -> Method:
        """Return what a mapper, or its class, declares; one that declares nothing has no words of its own."""
        gates, columns, curves = (getattr(mapper, word, ()) for word in ("gates", "columns", "curves"))
        ranges = _ranges(getattr(mapper, "Settings", NoSettings))
        return Method(name=name, settings=dict(settings), ranges=ranges, gates=gates, columns=columns, curves=curves)

    def gate(self, name: str) -> Gate:
        """Return a gate by its name; one that was not declared is called by its name and has nothing else to say."""
        found = next((gate for gate in self.gates if gate.name == name), None)
        return found or Gate(name=name, value=name, threshold="threshold")

    @property
    def about(self) -> dict[str, Any]:
        """The words as plain values."""
        return self.model_dump(mode="json", include={"ranges", "gates", "columns", "curves"})


def _ranges(model: type[BaseModel]) -> dict[str, tuple[float, float]]:
    """Return between what each number with limits can be set."""
    found = {}
    for name, field in model.model_fields.items():
        low = [getattr(rule, bound) for rule in field.metadata for bound in ("gt", "ge") if hasattr(rule, bound)]
        high = [getattr(rule, bound) for rule in field.metadata for bound in ("lt", "le") if hasattr(rule, bound)]
        if low and high:
            found[name] = (float(low[0]), float(high[0]))
    return found


class Mapper(ABC):
    """Decides about images one by one, each looked at once, as it comes.

    Parameters
    ----------
    settings
        Its parameters, of the type `Settings`; default: their defaults.

    Attributes
    ----------
    name
        What it is called on the command line and in tables.
    Settings
        A frozen pydantic model of its parameters.
    presets
        Named sets of parameters.
    gates, columns, curves
        The words of its evidence: what it compares, what else it measures, and the names of its similarity curves.
    """

    name: ClassVar[str]
    Settings: ClassVar[type[BaseModel]] = NoSettings
    presets: ClassVar[Mapping[str, Mapping[str, Any]]] = {}
    gates: ClassVar[tuple[Gate, ...]] = ()
    columns: ClassVar[tuple[Column, ...]] = ()
    curves: ClassVar[tuple[str, ...]] = ()

    def __init__(self, settings: Any = None) -> None:
        self.settings: Any = self.Settings() if settings is None else settings

    @abstractmethod
    def step(self, description: Description) -> Step:
        """Decide about the next image."""

    @abstractmethod
    def finish(self) -> FinalMap:
        """Return the partition of all images so far. The map itself stays as it is: `step` may be called afterwards."""

    def locate(self, description: Description) -> Step | None:
        """Say where an image is on the map, by the mapper's own levels; None if it has none.

        The map stays as it is, but for the images compared: no `step` can follow. The step that is returned has the
        node and match that were found and no events; a refused one has no node. Its number means nothing.
        """
        del description
        return None

    def expect(self, descriptions: Sequence[Description]) -> None:
        """Prepare for the descriptions that come next; a hint, which may save time and changes no step."""
        del descriptions

    def too_short(self, images: int) -> str | None:
        """Say why a sequence of this many images is too short, and what to do; None if it is not."""
        del images
        return None


class BranchingMapper(Mapper):
    """A mapper that can go on as several, with other settings: all it knows of images is in one shared memory.

    Parameters
    ----------
    settings
        Its parameters.
    images
        The images, where several mappers share them; see `sweep`.

    Attributes
    ----------
    swept
        Parameters that enter decisions through comparisons alone, which say between which values of them a decision is
        the same.
    screens
        Whether it can decide by bounds where its images are screened (`ImageMemory.screening`), without evidence.
    """

    swept: ClassVar[tuple[str, ...]] = ()
    screens: ClassVar[bool] = False

    def __init__(self, settings: Any = None, images: ImageMemory | None = None) -> None:
        super().__init__(settings)
        self.images = ImageMemory() if images is None else images

    @abstractmethod
    def decide(self, frame: int) -> Step:
        """Decide about the next image, which is in the memory already."""

    @abstractmethod
    def finish(self, placed: Mapping[int, tuple[int, Placement]] | None = None) -> FinalMap:
        """Return the partition of all images so far; `placed` says where leftovers end, if `place` was asked already.

        The map itself stays as it is: `step` may be called afterwards.
        """

    def step(self, description: Description) -> Step:
        """Decide about the next image.

        Raises
        ------
        ConfigError
            If the description's arrays are not finite or not shaped like the earlier ones.
        """
        return self.decide(self.images.append(description))

    def locate(self, description: Description) -> Step | None:
        """See `Mapper.locate`."""
        return self.look(self.images.append(description)) if type(self).look is not BranchingMapper.look else None

    def look(self, frame: int) -> Step:
        """Say where an image, which is in the memory already, is on the map, which stays as it is; see `locate`."""
        raise NotImplementedError(f"{self.name} has no levels by which image {frame} could be found")

    def expect(self, descriptions: Sequence[Description]) -> None:
        """See `Mapper.expect`."""
        self.images.expect(descriptions)

    def fork(self, settings: Any) -> Self:
        """Return a mapper with the same past and other settings; the images are shared.

        Its lists and dicts are copied, what they hold is not: it must be replaced, never changed.
        """
        other = copy(self)
        for name, value in vars(self).items():
            if isinstance(value, list | dict | set):
                setattr(other, name, copy(value))
        other.settings = settings
        return other

    @property
    def leftovers(self) -> Sequence[int]:
        """Images that the end has to place."""
        return ()

    def place(self, frame: int, journal: Journal) -> tuple[int, Placement]:
        """Return the node a leftover ends in and how; the map stays as it is."""
        raise NotImplementedError(f"{self.name} has no leftovers, so image {frame} is none")
