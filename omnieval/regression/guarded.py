"""What a reference guards: replays and localisations, and what is expected of them."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, JsonValue, model_validator

from omnieval.config import Config, Setting, resolve
from omnieval.errors import ResultError
from omnieval.localization.measures import LOWER_IS_BETTER
from omnieval.material.source import Cut
from omnieval.statistics.within import IntervalOf

DECIMALS = 6
"""Of the values written; far below any tolerance, and quiet about the last bits of a sum."""


_LOCKED = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class Guard(BaseModel):
    """The expected value of a metric, and what a replay is compared with: a tolerance, or its interval.

    Attributes
    ----------
    value
        What is expected.
    tolerance
        By how much a replay may be worse.
    interval
        The 95 % interval over the images of the run (`statistics.blocks`); a replay is worse when all of its own is.
    better
        Which way the metric is better.
    """

    model_config = _LOCKED

    value: float
    tolerance: float | None = Field(None, ge=0)
    interval: tuple[float, float] | None = None
    better: Literal["higher", "lower"] = "higher"

    @model_validator(mode="after")
    def _one_of_both(self) -> Guard:
        if (self.tolerance is None) == (self.interval is None):
            raise ValueError("give a tolerance or an interval, one of the two")
        if self.interval is not None and self.interval[0] > self.interval[1]:
            raise ValueError(f"interval is from {self.interval[0]:g} to {self.interval[1]:g}, the wrong way round")
        return self

    def renewed(self, value: float, within: IntervalOf, metric: str, *, intervals: bool = False) -> Guard:
        """Return a guard of the same kind that expects another value; with `intervals`, of its interval if it has one.

        Raises
        ------
        ResultError
            If an interval is guarded, and there is none any more.
        """
        changed: dict[str, Any] = {"value": round(float(value), DECIMALS)}
        if self.interval is not None or intervals:
            found = within(metric)
            if found is not None and found.low is not None and found.high is not None:
                ends = round(found.low, DECIMALS), round(found.high, DECIMALS)
                changed |= {"interval": ends, "tolerance": None}
            elif self.interval is not None:
                raise ResultError(f"{metric} has no interval over these images; guard it by a tolerance")
        return self.model_copy(update=changed)


class NodeRange(BaseModel):
    """The expected number of nodes, and the range it must stay in, both ends included."""

    model_config = _LOCKED

    value: int
    min: int
    max: int

    @model_validator(mode="after")
    def _ordered(self) -> NodeRange:
        if not self.min <= self.value <= self.max:
            raise ValueError(f"min {self.min} <= value {self.value} <= max {self.max} does not hold")
        return self


def _sound(cut: Cut) -> Cut:
    if cut.start < 0 or cut.stride < 1 or (cut.limit is not None and cut.limit < 1):
        raise ValueError("start is at least 0, stride and limit are at least 1")
    return cut


class Made(BaseModel):
    """How the expected values came about."""

    model_config = _LOCKED

    date: str
    code: str
    mapper_code: str = ""
    descriptor_code: str = ""
    dataset_fingerprint: str
    versions: dict[str, str]
    parameters: dict[str, JsonValue]


class Case(BaseModel):
    """One guarded replay.

    Attributes
    ----------
    name
        Unique within its reference.
    source
        Source as on the command line; paths are relative to the working directory.
    cut
        Which of its frames.
    skipped
        Images that were left out because they are not fit for use; None if `skip_bad` was not asked for.
    trace
        File of the decision trace, relative to the reference; None if there is none.
    mapper, descriptor
        Components as on the command line; None for the defaults.
    parameters
        Parameters that are set, by name; all others have the defaults of the code that is checked.
    nodes
        Expected number of nodes.
    guards
        Expected metrics by name.
    made
        How this was made; None if it was written by hand.
    """

    model_config = _LOCKED

    name: str = Field(min_length=1)
    source: str
    cut: Annotated[Cut, AfterValidator(_sound)] = Cut()
    skipped: tuple[str, ...] | None = None
    trace: str | None = None
    mapper: str | None = None
    descriptor: str | None = None
    parameters: dict[str, JsonValue] = Field(default_factory=dict)
    nodes: NodeRange
    guards: dict[str, Guard]
    made: Made | None = None

    def config(self) -> Config:
        """Return the configuration to replay with.

        Raises
        ------
        ConfigError
            If there is no such component, or a parameter is unknown or invalid.
        """
        settings = [Setting(name, value, f"case {self.name}") for name, value in self.parameters.items()]
        return resolve(settings, mapper=self.mapper, descriptor=self.descriptor)


class LocalizationMade(BaseModel):
    """How the expected values of a localisation came about; `dataset_fingerprint` is that of the query."""

    model_config = _LOCKED

    date: str
    code: str
    dataset_fingerprint: str
    map_digest: str


class LocalizationCase(BaseModel):
    """One guarded localisation: images of a sequence looked for in the map of a case.

    Attributes
    ----------
    name
        Unique among cases and localisations of its reference.
    map
        Name of the case whose map it is.
    query
        Source as on the command line; paths are relative to the working directory.
    cut
        Which of its frames.
    within
        Two images at most this far apart show the same place.
    expected
        Guards by strategy and metric; empty where none was made yet.
    made
        How this was made; None if it was written by hand.
    """

    model_config = _LOCKED

    name: str = Field(min_length=1)
    map: str
    query: str
    cut: Annotated[Cut, AfterValidator(_sound)] = Cut()
    within: float = Field(0.5, gt=0)
    expected: dict[str, dict[str, Guard]] = Field(default_factory=dict)
    made: LocalizationMade | None = None


def better_of_localization(metric: str) -> Literal["higher", "lower"]:
    """Return which way a metric of localisation is better."""
    return "lower" if metric in LOWER_IS_BETTER else "higher"
