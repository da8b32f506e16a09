"""Distances, the mapper, and sweeps."""

from __future__ import annotations

import itertools
import os
import time
from collections.abc import Sequence

import cv2
import numpy as np

from omnieval.descriptors.description import Description
from omnieval.descriptors.distance import DescriptionStore
from omnieval.mapping.memory import AHEAD, ImageMemory, blocks
from omnieval.mapping.roman2020.mapper import Roman2020
from omnieval.mapping.roman2020.settings import Roman2020Settings
from omnieval.mapping.sweep import Interval, Points, Sweep
from tests.benchmarks.figures import Figure, seconds_of
from tests.benchmarks.sequences import described, walk
from tests.mapping.comparison import assert_agreement
from tests.reference.curve import Image, orientation_distance
from tests.reference.mapper import ReferenceMapper

TRANSFORM = cv2.DFT_INVERSE | cv2.DFT_ROWS | cv2.DFT_SCALE | cv2.DFT_REAL_OUTPUT
LENGTH = 2778
"""Images of the longest COLD sequence of the paper's kind."""
OMEGA, MERGE_Y = (1.7, 1.85, 2.0, 2.15, 2.3), (0.75, 1.0, 1.25, 1.5, 1.75, 2.0, 2.25)


def measure() -> list[Figure]:
    """Measure everything that needs descriptions only."""
    images = list(walk(LENGTH))
    return [*_distances(images), *_steps(images), *_sweeps(), *_agreement()]


def _distances(images: Sequence[Description]) -> list[Figure]:
    store = DescriptionStore(threads=os.cpu_count() or 1)
    pairs = len(images) * (len(images) - 1) / 2
    started = time.perf_counter()
    for block in blocks(images, AHEAD):
        store.expect(block)
        for image in block:
            query = store.append(image)
            store.compare(query, np.arange(query))
    taken = time.perf_counter() - started
    return [
        Figure(
            f"all distances of {LENGTH} images",
            "s",
            taken,
            plain=plain_seconds(images) * pairs,
            bound=transform_seconds() * pairs,
            bounded_by="the inverse FFTs alone",
            target="<= 15",
        )
    ]


def plain_seconds(images: Sequence[Description]) -> float:
    """Return how long the oracle takes to compare two images."""
    few = [Image.of(one.position, one.orientation) for one in images[:12]]
    return seconds_of(lambda: [orientation_distance(few[0], other) for other in few], 1) / len(few)


def transform_seconds() -> float:
    """Return how long the inverse FFT of one pair of images takes, which no comparison can do without."""
    packed = np.ones((256, 256))
    return seconds_of(lambda: cv2.dft(packed, flags=TRANSFORM), 99) / len(packed)


def _steps(images: Sequence[Description]) -> list[Figure]:
    memory = ImageMemory(threads=os.cpu_count() or 1)
    mapper = Roman2020(images=memory)
    times, candidates = [], []
    for block in blocks(images, AHEAD):
        memory.expect(block)
        for image in block:
            frame = memory.append(image)
            memory.compare(frame, np.arange(frame))
            started = time.perf_counter()
            step = mapper.decide(frame)
            times.append(1e3 * (time.perf_counter() - started))
            candidates.append(len(step.curves.frames) if step.curves else 0)
    reference = ReferenceMapper(Roman2020Settings())
    coarse = [_coarse(image) for image in images[:400]]
    plain = []
    for image in coarse:
        started = time.perf_counter()
        reference.step(image.position, image.orientation)
        plain.append(1e3 * (time.perf_counter() - started))
    many = np.array(candidates) > np.median(candidates)
    slope = np.polyfit(np.array(candidates)[many], np.array(times)[many], 1)[0]
    return [
        Figure(
            "mapper step, distances at hand, median",
            "ms",
            float(np.median(times)),
            plain=float(np.median(plain)),
            target="<= 0.4",
        ),
        Figure("mapper step, distances at hand, 95th percentile", "ms", float(np.percentile(times, 95))),
        Figure("mapper step, more for 1,000 candidate images more", "ms", 1000 * float(slope)),
    ]


def _sweeps() -> list[Figure]:
    images = described()
    grid = [Roman2020Settings(omega=omega, merge_y=y) for omega, y in itertools.product(OMEGA, MERGE_Y)]

    def one() -> None:
        mapper = Roman2020(grid[0])
        for block in blocks(images, AHEAD):
            mapper.expect(block)
            for image in block:
                mapper.step(image)
        mapper.finish()

    def all_at_once() -> None:
        sweep = Sweep(Roman2020, [Points(tuple(grid))])
        for _ in sweep.steps(images):
            pass
        sweep.finish()

    def exactly() -> None:
        sweep = Sweep(Roman2020, [Interval(Roman2020Settings(), "merge_y", 0.5, 3.0)])
        for _ in sweep.steps(images):
            pass
        sweep.finish()

    single = seconds_of(one)
    tree = seconds_of(all_at_once) / single
    return [
        Figure("one mapper pass over the building", "s", single),
        Figure("35 configurations as a tree, one process", "passes", tree, 35.0, target="<= 7"),
        Figure("merge_y exactly, 0.5 to 3", "passes", seconds_of(exactly) / single),
    ]


def _agreement() -> list[Figure]:
    """Hold the mapper against the oracle; a difference ends the benchmark."""
    images = [_coarse(image) for image in described()]
    assert_agreement(Roman2020Settings(), images)
    assert_agreement(Roman2020Settings(omega=1.7, merge_y=0.75), images)
    return [Figure("steps equal to the oracle's", "steps", float(2 * len(images)), target="all")]


def _coarse(image: Description) -> Description:
    """Return a description with a quarter of the cells: the oracle keeps every roll of every image."""
    return Description(image.position, image.orientation[::4].copy())
