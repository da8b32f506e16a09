"""One seed for everything: named child generators, so that no draw depends on how often another was made."""

from __future__ import annotations

import zlib

import numpy as np


def named_generator(seed: int, name: str, *keys: int) -> np.random.Generator:
    """Return the generator that belongs to `name` and `keys` under `seed`.

    Equal arguments give equal streams, on every machine, in every order of calls.
    """
    spawn_key = (zlib.crc32(name.encode()), *keys)
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=spawn_key))
