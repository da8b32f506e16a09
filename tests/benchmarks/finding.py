"""Localisation: a map is loaded, and images of another walk are looked for in it."""

from __future__ import annotations

import os
import tempfile
import time
from pathlib import Path

import numpy as np

from omnieval.datasets.sequence import Frame
from omnieval.descriptors.archive import save_archive
from omnieval.descriptors.description import Description
from omnieval.descriptors.distance import DescriptionStore
from omnieval.localization.strategies import STRATEGIES
from omnieval.loop import replay
from omnieval.mapping.memory import AHEAD, blocks
from omnieval.results.map_file import MAP_FILE
from omnieval.results.run_folder import Run, open_run
from tests.benchmarks.figures import Figure, seconds_of
from tests.benchmarks.mapping import plain_seconds, transform_seconds
from tests.benchmarks.sequences import walk

IMAGES, QUERIES = 3000, 512


def measure() -> list[Figure]:
    """Measure on a map of a long walk."""
    images, queries = list(walk(IMAGES)), list(walk(QUERIES, seed=1))
    with tempfile.TemporaryDirectory() as scratch:
        run = _mapped(Path(scratch), images)
        return [_loading(run), *_finding(run, queries, _pairs_a_second(images))]


def _mapped(scratch: Path, images: list[Description]) -> Run:
    archive = scratch / "walk.npz"
    frames = [Frame(Path(), f"{number}.png") for number in range(len(images))]
    save_archive(
        archive, frames, np.stack([one.position for one in images]), np.stack([one.orientation for one in images])
    )
    return replay(f"npz:{archive}", out=scratch / "run", recording=False)


def _loading(run: Run) -> Figure:
    file = run.folder / MAP_FILE
    return Figure(
        f"loading a map of {IMAGES} images",
        "s",
        seconds_of(lambda: open_run(run.folder).map),
        bound=seconds_of(file.read_bytes),
        bounded_by="reading the file",
        target="<= 1",
    )


def _pairs_a_second(images: list[Description]) -> float:
    """Return how many pairs of one sequence are compared in a second, each image with those before it."""
    store = DescriptionStore(threads=os.cpu_count() or 1)
    started = time.perf_counter()
    for block in blocks(images, AHEAD):
        store.expect(block)
        for image in block:
            number = store.append(image)
            store.compare(number, np.arange(number))
    return len(images) * (len(images) - 1) / 2 / (time.perf_counter() - started)


def _finding(run: Run, queries: list[Description], within: float) -> list[Figure]:
    """Measure how many pairs of images each strategy compares, and how long a query takes."""
    plain, transform = plain_seconds(queries), transform_seconds()
    figures = []
    for name, strategy in STRATEGIES.items():
        finder = strategy(run.map, run.config.mapper)
        compared = 0
        started = time.perf_counter()
        for block in blocks(queries, AHEAD):
            finder.expect(block)
            for query in block:
                compared += len(finder.find(query).ranked)
        taken = time.perf_counter() - started
        figures.append(Figure(f"finding an image among {IMAGES}: {name}", "ms", 1e3 * taken / len(queries)))
        if name == "nearest":
            figures.append(
                Figure(
                    "pairs of images compared in finding them",
                    "pairs/s",
                    compared / taken,
                    plain=1 / plain,
                    bound=1 / transform,
                    bounded_by="the inverse FFTs alone, on one core",
                    target=f">= {within:.3g} (all pairs of one sequence)",
                )
            )
    return figures
