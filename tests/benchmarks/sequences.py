"""What is measured on: the synthetic building, and long walks through it."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from itertools import islice

import numpy as np

from omnieval.config import configure
from omnieval.datasets import Sequence, load
from omnieval.descriptors.description import Description
from omnieval.material.opening import opened

NOISE = 0.05
"""Standard deviation of what is added to every component, relative to its own."""


@cache
def building() -> Sequence:
    """Return the sequence that is measured on."""
    return load("synthetic")


@cache
def described() -> tuple[Description, ...]:
    """Return its HOG descriptions."""
    with opened(building(), configure()) as material:
        return tuple(one.description for one in material.described)


def walk(count: int, seed: int = 0) -> Iterator[Description]:
    """Yield descriptions of a walk of any length: the building over and over, every round somewhat different."""
    base = described()
    spread = np.stack([one.position for one in base]).std(axis=0)
    rng = np.random.default_rng(seed)

    def rounds() -> Iterator[Description]:
        yield from base
        while True:
            for one in base:
                position = one.position + NOISE * spread * rng.standard_normal(spread.shape, np.float32)
                rolled = np.roll(one.orientation, rng.integers(len(one.orientation)), axis=0)
                noise = NOISE * rolled.std() * rng.standard_normal(rolled.shape, np.float32)
                yield Description(position.astype(np.float32), (rolled + noise).astype(np.float32))

    return islice(rounds(), count)
