"""How hard the synthetic buildings are: ``python -m tests.benchmarks.localising [BUILDING ...]``.

Every image of another drive is looked up among the images of the cloudy drive: the nearest by the product of position
and orientation distance. What is said is how far it is from the true place, in metres, over the images within 1 m of
which the map has one: mean over the buildings with a 95 % interval (percentile bootstrap over buildings, 2,000
resamples). Published for COLD-Freiburg part A are 0.163 (cloudy), 0.451 (night) and 0.820 m (sunny) for HOG, and 0.052,
1.065 and 0.884 m for gist (READMEs of IndoorLocalizationSingleCNN and IndoorLocalizationSNN, Miguel Hernandez
University).
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from omnieval.config import configure
from omnieval.datasets import load
from omnieval.datasets.synthetic import LIGHTS, synthesize
from omnieval.descriptors.description import Description
from omnieval.descriptors.distance import DescriptionStore
from omnieval.material.opening import opened

COVERED_M = 1.0
DESCRIPTORS = ("hog", "gist")
SECOND_DRIVE = "cloudy, second drive"


def main() -> None:
    """Measure and print, a row per building."""
    parser = argparse.ArgumentParser(prog="python -m tests.benchmarks.localising", description=__doc__)
    parser.add_argument("buildings", nargs="*", type=int, default=[1, 2, 3, 4, 5], metavar="BUILDING")
    parser.add_argument("--stride", type=int, default=1, metavar="N", help="look up every Nth image only")
    options = parser.parse_args()
    tables: dict[str, dict[int, dict[str, float]]] = {descriptor: {} for descriptor in DESCRIPTORS}
    for number in options.buildings:
        with tempfile.TemporaryDirectory() as scratch:
            again = synthesize(Path(scratch) / "again", building=number, seed=1)
            for descriptor, table in tables.items():
                print(f"measuring {descriptor} in building {number} ...", file=sys.stderr)
                table[number] = dict(errors_of(number, f"cold:{again}", descriptor, options.stride))
                print(f"{descriptor:5} building {number}: {said(table[number])}", flush=True)
    for descriptor, table in tables.items():
        for drive in next(iter(table.values())):
            mean, low, high = interval(np.array([row[drive] for row in table.values()]))
            print(f"{descriptor:5} {drive}: {mean:.2f} m ({low:.2f} to {high:.2f}, {len(table)} buildings)")


def said(row: dict[str, float]) -> str:
    """Return the errors of a building in a line."""
    return ", ".join(f"{drive} {error:.2f}" for drive, error in row.items())


def errors_of(number: int, again: str, descriptor: str, stride: int) -> Iterator[tuple[str, float]]:
    """Yield drive and mean error of what is looked up in the cloudy drive of a building; `again` is a second one."""
    known = described(f"synthetic:{LIGHTS[0]}:{number}", descriptor)
    yield SECOND_DRIVE, mean_error(known, described(again, descriptor), stride)
    for light in LIGHTS[1:]:
        yield light, mean_error(known, described(f"synthetic:{light}:{number}", descriptor), stride)


Drive = tuple[NDArray[np.float64], list[Description]]


def described(source: str, descriptor: str) -> Drive:
    """Return positions, shape (n, 2), and descriptions of a sequence."""
    sequence = load(source)
    with opened(sequence, configure(descriptor=descriptor)) as material:
        return np.asarray(sequence.positions, np.float64), [one.description for one in material.described]


def mean_error(known: Drive, asked: Drive, stride: int) -> float:
    """Return how far the nearest images are from the true places on average, metres."""
    store = DescriptionStore()
    for description in (*known[1], *asked[1]):
        store.append(description)
    others = np.arange(len(known[1]))
    errors = []
    for query in range(0, len(asked[1]), stride):
        away = np.hypot(*(known[0] - asked[0][query]).T)
        if away.min() <= COVERED_M:
            distances = store.compare(len(others) + query, others)
            errors.append(away[np.argmin(distances.position * distances.orientation)])
    return float(np.mean(errors))


def interval(values: NDArray[np.float64]) -> tuple[float, float, float]:
    """Return mean, 2.5th and 97.5th percentile of the means of 2,000 resamples."""
    rng = np.random.default_rng(0)
    means = values[rng.integers(len(values), size=(2000, len(values)))].mean(axis=1)
    low, high = np.percentile(means, [2.5, 97.5])
    return float(values.mean()), float(low), float(high)


if __name__ == "__main__":
    main()
