"""A sequence as it might have been: begun later, driven faster or backwards, seen by a camera that is a little off.

A mapper is chaotic: half a pixel of the mirror's centre gives another map. So one run is one draw, and what is said of
a method must hold over perturbations. They are part of the source, ``synthetic:night#start=12,noise=2,seed=3``, so
that whatever opens it again opens the same.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from omnieval.datasets.sequence import Disturbance, Frame, Sequence
from omnieval.datasets.source import apart, together
from omnieval.errors import ConfigError, DatasetError
from omnieval.seeding import named_generator
from omnieval.wording import did_you_mean, shown

OPTIONS = ("start", "stride", "reverse", "mirror", "noise", "gain", "seed")
"""Options that every source of images has, in the order in which they are written."""
_ATTEMPTS = 50
"""Draws for each replicate, until one is unlike the others."""
_FARTHEST_PX = 1000.0
_MOST_NOISE = 255.0
_HIGHEST_GAIN = 100.0


@dataclass(frozen=True)
class Perturbation:
    """What is changed of a sequence.

    Attributes
    ----------
    start, stride
        The first image, and of how many one is taken.
    reverse
        Whether the images come in the opposite order.
    mirror
        By how much the mirror's centre is believed to lie elsewhere, pixels (right, down).
    noise
        Standard deviation of noise that is added to every pixel, grey levels.
    gain
        What grey levels are multiplied by.
    seed
        Of the noise.
    """

    start: int = 0
    stride: int = 1
    reverse: bool = False
    mirror: tuple[float, float] = (0.0, 0.0)
    noise: float = 0.0
    gain: float = 1.0
    seed: int = 0

    @classmethod
    def of(cls, given: Mapping[str, str], source: str) -> Perturbation:
        """Return what the options of a source say.

        Raises
        ------
        DatasetError
            If a value makes no sense; `source` is for the message.
        """
        found: dict[str, Any] = {}
        for name, text in given.items():
            try:
                found[name] = _READ[name](text)
            except ValueError as error:
                message = f"{name}={shown(text)} of {shown(source)}: expected {_EXPECTED[name]}"
                raise DatasetError(message) from error
        return cls(**found)

    @property
    def written(self) -> dict[str, str]:
        """The options as they are written into a source: nothing that changes nothing."""
        values = {
            "start": str(self.start) if self.start else None,
            "stride": str(self.stride) if self.stride != 1 else None,
            "reverse": "yes" if self.reverse else None,
            "mirror": ":".join(map(_plainly, self.mirror)) if any(self.mirror) else None,
            "noise": _plainly(self.noise) if self.noise else None,
            "gain": _plainly(self.gain) if self.gain != 1 else None,
            "seed": str(self.seed) if self.noise and self.seed else None,
        }
        return {name: value for name, value in values.items() if value is not None}

    @property
    def text(self) -> str:
        """The options as one text; empty if it changes nothing."""
        return ",".join(f"{name}={value}" for name, value in self.written.items())

    def applied(self, sequence: Sequence) -> Sequence:
        """Return a sequence as it would have been; its source says so.

        Raises
        ------
        DatasetError
            If no image is left.
        """
        cut = sequence.cut(start=self.start, stride=self.stride)
        frames = tuple(_backwards(cut.frames)) if self.reverse else cut.frames
        camera = dataclasses.replace(
            sequence.camera, disturbance=Disturbance(self.mirror, self.noise, self.gain, self.seed)
        )
        return dataclasses.replace(
            cut,
            source=together(sequence.source, self.written),
            frames=frames,
            camera=camera,
            cut_from=sequence.cut_from,  # what the source says itself is not to be cut once more
            perturbation=self.text,
        )


def perturbation_apart(source: str) -> tuple[str, Perturbation]:
    """Return a source without its perturbation, and that.

    Raises
    ------
    DatasetError
        If what it says makes no sense.
    """
    bare, given = apart(source, OPTIONS)
    return bare, Perturbation.of(given, source)


@dataclass(frozen=True)
class Replicates:
    """From what perturbations are drawn: ``start=0:30,stride=1:2,mirror=1,noise=2,reverse``.

    Attributes
    ----------
    ranges
        Lowest and highest value by name; of `mirror` and `gain`, how far to both sides of none.
    seed
        Root of all draws.
    text
        What was asked for.
    """

    ranges: Mapping[str, tuple[float, float]]
    seed: int = 0
    text: str = field(default="", compare=False)

    @classmethod
    def parse(cls, text: str) -> Replicates:
        """Read what is given to ``--perturb``.

        Raises
        ------
        ConfigError
            If it is not understood.
        """
        ranges: dict[str, tuple[float, float]] = {}
        seed = 0
        for part in filter(None, (part.strip() for part in text.split(","))):
            name, equals, values = (word.strip() for word in part.partition("="))
            if name not in OPTIONS:
                raise ConfigError(f"--perturb {text}: unknown {name!r}; {did_you_mean(name, OPTIONS)}")
            if name in ranges:
                raise ConfigError(f"--perturb {text}: {name} is given twice")
            if name == "seed":
                seed = _asked(name, values, text, whole=True)[1]
            elif name == "reverse" and not equals:
                ranges[name] = (0.0, 1.0)
            else:
                ranges[name] = _asked(name, values, text, whole=name in ("start", "stride"))
        if not ranges:
            raise ConfigError(f"--perturb {text!r}: expected e.g. start=0:30,stride=1:2,mirror=1,noise=2,reverse")
        return cls(ranges, int(seed), text)

    def draw(self, count: int) -> list[Perturbation]:
        """Return this many different perturbations; the first of more are the same.

        Raises
        ------
        ConfigError
            If there are not so many.
        """
        found: dict[Perturbation, None] = {}
        for number in range(count * _ATTEMPTS):
            found.setdefault(self._drawn(number))
            if len(found) == count:
                return list(found)
        raise ConfigError(
            f"--perturb {self.text} has fewer than {count} different replicates; take fewer --replicates, or perturb "
            "more, such as noise=2"
        )

    def _drawn(self, number: int) -> Perturbation:
        """Return the draw of this number: each name has a stream of its own, so that one more changes no other."""

        def uniform(name: str) -> Any:
            low, high = self.ranges[name]
            return named_generator(self.seed, f"perturb {name}", number).uniform(low, high, size=2)

        def whole(name: str) -> int:
            low, high = self.ranges[name]
            return int(named_generator(self.seed, f"perturb {name}", number).integers(int(low), int(high) + 1))

        made: dict[str, Any] = {name: whole(name) for name in ("start", "stride") if name in self.ranges}
        if "reverse" in self.ranges:
            made["reverse"] = bool(whole("reverse"))
        if "mirror" in self.ranges:
            right, down = np.round(uniform("mirror"), 3).tolist()
            made["mirror"] = (right, down)
        if "noise" in self.ranges:
            made |= {"noise": float(np.round(uniform("noise")[0], 3)), "seed": self.seed * 100_003 + number + 1}
        if "gain" in self.ranges:
            made["gain"] = float(np.round(1 + uniform("gain")[0], 4))
        return Perturbation(**made)


def _asked(name: str, values: str, text: str, *, whole: bool) -> tuple[Any, Any]:
    """Return the ends of what is asked of one name."""
    try:
        numbers = [(int if whole else float)(value) for value in values.split(":")]
        low, high = numbers[0], numbers[-1]
        known = len(numbers) <= 2 and all(map(math.isfinite, numbers)) and low <= high
    except ValueError:
        known = False
    if known and name in ("mirror", "gain"):
        known, low = len(numbers) == 1 and high >= 0, -high
    limits = {"mirror": (-_FARTHEST_PX, _FARTHEST_PX), "noise": (0, _MOST_NOISE), "gain": (-0.99, 0.99)}
    lowest, highest = limits.get(name, (1 if name == "stride" else 0, 1 if name == "reverse" else math.inf))
    if not known or low < lowest or high > highest:
        raise ConfigError(f"--perturb {text}: {name} takes {_ASKED[name]}")
    return low, high


_ASKED = {
    "start": "first images as LOWEST:HIGHEST, such as start=0:30",
    "stride": "whole numbers from 1 on as LOWEST:HIGHEST, such as stride=1:2",
    "reverse": "no value",
    "mirror": "how many pixels the centre may be off to each side, such as mirror=1",
    "noise": "grey levels, such as noise=2 or noise=0:4",
    "gain": "how far from 1 it may be, such as gain=0.1",
    "seed": "a whole number from 0 on",
}


def _backwards(frames: tuple[Frame, ...]) -> Iterator[Frame]:
    """Yield frames in the opposite order, at times that increase as they did."""
    times = [frame.time_ns for frame in frames]
    known = [time for time in times if time is not None]
    ends = known[0] + known[-1] if known else 0
    for frame in reversed(frames):
        yield frame if frame.time_ns is None else dataclasses.replace(frame, time_ns=ends - frame.time_ns)


def _number(low: float, high: float) -> Callable[[str], float]:
    def read(text: str) -> float:
        value = float(text)
        if not low <= value <= high:
            raise ValueError(text)
        return value

    return read


def _whole(lowest: int) -> Callable[[str], int]:
    def read(text: str) -> int:
        value = int(text)
        if value < lowest:
            raise ValueError(text)
        return value

    return read


def _offset(text: str) -> tuple[float, float]:
    right, down = map(_number(-_FARTHEST_PX, _FARTHEST_PX), text.split(":"))
    return right, down


def _yes(text: str) -> bool:
    if text not in ("yes", "no"):
        raise ValueError(text)
    return text == "yes"


_READ: Mapping[str, Callable[[str], Any]] = {
    "start": _whole(0),
    "stride": _whole(1),
    "reverse": _yes,
    "mirror": _offset,
    "noise": _number(0.0, _MOST_NOISE),
    "gain": _number(0.01, _HIGHEST_GAIN),
    "seed": _whole(0),
}
_EXPECTED = {
    "start": "a whole number from 0 on",
    "stride": "a whole number from 1 on",
    "reverse": "yes or no",
    "mirror": "pixels as RIGHT:DOWN, such as 0.5:-0.3",
    "noise": f"grey levels from 0 to {_MOST_NOISE:g}",
    "gain": f"a factor from 0.01 to {_HIGHEST_GAIN:g}",
    "seed": "a whole number from 0 on",
}


def _plainly(value: float) -> str:
    return f"{value:.12g}"
