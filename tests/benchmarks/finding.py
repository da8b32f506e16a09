"""Localisation: a map is loaded, and images of another walk are looked for in it."""

from __future__ import annotations

import os
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from omnieval.datasets.sequence import Frame
from omnieval.descriptors.archive import save_archive
from omnieval.descriptors.description import Description
from omnieval.descriptors.distance import DescriptionStore
from omnieval.localization.strategies import STRATEGIES, Nearest, Strategy
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
        return [_loading(run), *_answers(run, queries), *_pairs(run, images, queries)]


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


def _answers(run: Run, queries: list[Description]) -> list[Figure]:
    """Measure how long a query takes each strategy."""
    figures = []
    for name, strategy in STRATEGIES.items():
        finder = strategy(run.map, run.config.mapper)
        taken, _ = _found(finder, queries)
        figures.append(Figure(f"finding an image among {IMAGES}: {name}", "ms", 1e3 * taken / len(queries)))
    return figures


def _pairs(run: Run, images: list[Description], queries: list[Description]) -> list[Figure]:
    """Measure how many pairs a second localisation compares, beside the distances of all pairs of one sequence.

    Both take turns, block by block, so that whatever else the machine does slows both.
    """
    finder, store = Nearest(run.map, run.config.mapper), DescriptionStore(threads=os.cpu_count() or 1)
    for image in images[: IMAGES - QUERIES]:
        store.append(image)
    found = [0.0, 0]
    alone = [0.0, 0]
    for asked, later in zip(blocks(queries, AHEAD), blocks(images[IMAGES - QUERIES :], AHEAD), strict=True):
        for total, (taken, pairs) in ((found, _found(finder, asked)), (alone, _compared(store, later))):
            total[0] += taken
            total[1] += pairs
    rate, all_pairs = found[1] / found[0], alone[1] / alone[0]
    return [
        Figure(
            "pairs of images compared in finding them",
            "pairs/s",
            rate,
            plain=1 / plain_seconds(queries),
            bound=1 / transform_seconds(),
            bounded_by="the inverse FFTs alone, on one core",
            target=f">= {all_pairs:.3g} (all pairs)",
        ),
        Figure("the same as a share of all pairs", "", rate / all_pairs, target=">= 1"),
    ]


def _found(finder: Strategy, queries: Sequence[Description]) -> tuple[float, int]:
    """Find images; return the seconds it takes and how many pairs are compared."""
    pairs, started = 0, time.perf_counter()
    for block in blocks(queries, AHEAD):
        finder.expect(block)
        pairs += sum(len(finder.find(query).ranked) for query in block)
    return time.perf_counter() - started, pairs


def _compared(store: DescriptionStore, images: Sequence[Description]) -> tuple[float, int]:
    """Compare images with all before them; return the seconds it takes and how many pairs are compared."""
    pairs, started = 0, time.perf_counter()
    for block in blocks(images, AHEAD):
        store.expect(block)
        for image in block:
            number = store.append(image)
            pairs += len(store.compare(number, np.arange(number)).position)
    return time.perf_counter() - started, pairs
