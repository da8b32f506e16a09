"""Intervals of what is computed over the images of one run, which are near copies of their neighbours.

Moving blocks (Künsch 1989, doi 10.1214/aos/1176347265), wrapped around at the end, so that every image is drawn as
often as any other (Politis and Romano 1992): successive images are drawn together, so what they share is kept. What
lasts longer than a block is lost; by how much is seen from blocks of twice the length, and made good (the "lugsail" of
Vats and Flegal 2022, doi 10.1093/biomet/asab049).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from omnieval.seeding import named_generator
from omnieval.statistics.estimate import FEWEST, RESAMPLES, Estimate, ends

Statistic = Callable[[NDArray[np.int32]], NDArray[np.float64]]
"""From how often each image counts in each resample, shape (b, n), to the value of each, shape (b,), NaN where none."""

BLOCK_S = 10.0
"""How many seconds of images a block holds."""
_AT_ONCE = 2_000_000
"""Counts held at a time."""


@dataclass(frozen=True)
class Blocks:
    """How a sequence is resampled.

    Attributes
    ----------
    images
        How many there are, n.
    length
        Images of a block.
    """

    images: int
    length: int

    @classmethod
    def of(cls, stamps: NDArray[np.int64], second: int) -> Blocks:
        """Return blocks of `BLOCK_S` for images that were taken at these times, in their unit, not decreasing."""
        images = len(stamps)
        duration = float(stamps[-1] - stamps[0]) / second if images > 1 else 0.0
        length = round(BLOCK_S * (images - 1) / duration) if duration > 0 else images
        return cls(images, max(1, min(length, images)))

    @property
    def cases(self) -> float:
        """How many blocks the sequence has: about as many independent cases."""
        return self.images / self.length

    def counts(self, resamples: int, rng: np.random.Generator) -> NDArray[np.int32]:
        """Return how often each image is drawn, shape (resamples, n); n draws in each."""
        images, length = self.images, self.length
        pieces = -(-images // length)
        starts = rng.integers(images, size=(resamples, pieces))
        lengths = np.full(pieces, length)
        lengths[-1] = images - length * (pieces - 1)
        changes = np.zeros((resamples, 2 * images + 1), np.int32)
        rows = np.arange(resamples)[:, np.newaxis]
        np.add.at(changes, (rows, starts), 1)
        np.add.at(changes, (rows, starts + lengths), -1)
        drawn = np.cumsum(changes, axis=1, dtype=np.int32)
        counts: NDArray[np.int32] = drawn[:, :images] + drawn[:, images : 2 * images]
        return counts


def block_estimate(blocks: Blocks, statistic: Statistic, *, seed: int = 0) -> Estimate:
    """Return the value of a statistic over all images, and its interval by moving blocks.

    Parameters
    ----------
    blocks
        How to resample.
    statistic
        What to compute.
    seed
        Root seed.
    """
    value = float(statistic(np.ones((1, blocks.images), np.int32))[0]) if blocks.images else np.nan
    if np.isnan(value):
        return Estimate(None, None, None, blocks.images)
    if blocks.cases < FEWEST:
        return Estimate(value, None, None, blocks.images)
    resampled = _resampled(blocks, statistic, RESAMPLES, seed)
    longer = _resampled(Blocks(blocks.images, 2 * blocks.length), statistic, RESAMPLES // 2, seed)
    if min(len(resampled), 2 * len(longer)) < RESAMPLES // 2:
        return Estimate(value, None, None, blocks.images)
    spread = float(resampled.var())
    wider = np.sqrt(max(spread, 2 * float(longer.var()) - spread) / spread) if spread > 0 else 1.0
    return Estimate(value, *ends(resampled, blocks.cases, float(wider)), blocks.images)


def _resampled(blocks: Blocks, statistic: Statistic, resamples: int, seed: int) -> NDArray[np.float64]:
    """Return the values of resamples, those that have one."""
    rng = named_generator(seed, "blocks", blocks.length)
    each = max(1, _AT_ONCE // blocks.images)
    sizes = [min(each, resamples - done) for done in range(0, resamples, each)]
    values = np.concatenate([statistic(blocks.counts(size, rng)) for size in sizes])
    known: NDArray[np.float64] = values[~np.isnan(values)]
    return known


def mean_of(values: NDArray[np.float64]) -> Statistic:
    """Return the mean over the images that have a value, shape (n,), NaN where they have none."""
    known = np.isfinite(values)
    filled = np.where(known, values, 0.0)

    def mean(counts: NDArray[np.int32]) -> NDArray[np.float64]:
        with np.errstate(invalid="ignore"):
            found: NDArray[np.float64] = (counts @ filled) / (counts @ known.astype(np.float64))
        return found

    return mean
