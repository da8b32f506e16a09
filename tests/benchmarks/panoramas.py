"""Rank 1 of descriptors on real panoramas: ``python -m tests.benchmarks.panoramas FOLDER [--descriptor NAME ...]``.

FOLDER, or each folder in it, holds pairs of panoramas by name: ``01_query.png`` and ``01_nearest.png``, the image of a
map that was taken nearest to where the query was. For every query all nearest images of its folder are compared: how
often is its own the best by position, by orientation at the best roll, and by the product of both similarities?
``--mask`` is an image of the panoramas' size, white where the scene is seen.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from omnieval.components import resolve_component
from omnieval.config import configure
from omnieval.datasets.sequence import Camera, Frame
from omnieval.datasets.sequence import Sequence as Frames
from omnieval.descriptors.cache import DescriptorCache
from omnieval.descriptors.describe import Describer
from omnieval.descriptors.description import Description
from omnieval.descriptors.distance import DescriptionStore
from omnieval.imaging.camera import CameraModel, resolve_camera

QUERY, NEAREST = "_query", "_nearest"


def pairs(folder: Path) -> list[tuple[Path, Path]]:
    """Return the queries of a folder, each with the image nearest to it; those without one are left out."""
    nearest = {path.stem.removesuffix(NEAREST): path for path in sorted(folder.iterdir()) if NEAREST in path.stem}
    queries = {path.stem.removesuffix(QUERY): path for path in sorted(folder.iterdir()) if QUERY in path.stem}
    return [(query, nearest[name]) for name, query in queries.items() if name in nearest]


def rank_one(queries: Sequence[Description], others: Sequence[Description]) -> dict[str, float]:
    """Return the shares of queries whose own image, of the same number among the others, is the best."""
    store = DescriptionStore()
    for description in (*others, *queries):
        store.append(description)
    among = np.arange(len(others))
    hits = {"position": 0, "orientation": 0, "product": 0}
    for number in range(len(queries)):
        found = store.compare(len(others) + number, among)
        distances = {
            "position": found.position,
            "orientation": found.orientation,
            "product": found.position * found.orientation,
        }
        for by, distance in distances.items():
            hits[by] += int(distance.argmin() == number)
    return {by: count / len(queries) for by, count in hits.items()}


def measure(folder: Path, descriptors: Sequence[str], mask: Path | None) -> Iterator[dict[str, str | int | float]]:
    """Yield a row for every folder with pairs and every descriptor."""
    folders = [one for one in (folder, *sorted(path for path in folder.iterdir() if path.is_dir())) if pairs(one)]
    for one in folders:
        found = pairs(one)
        frames = [Frame(path, path.name) for path in (*(query for query, _ in found), *(near for _, near in found))]
        camera = _camera(one, frames, mask)
        for name in descriptors:
            component = resolve_component("descriptor", name)
            with DescriptorCache() as cache:
                described = [item.description for item in Describer(camera, component, cache).describe_frames(frames)]
            shares = rank_one(described[: len(found)], described[len(found) :])
            yield {"folder": one.name, "queries": len(found), "descriptor": component.name, **shares}


def _camera(folder: Path, frames: Sequence[Frame], mask: Path | None) -> CameraModel:
    sequence = Frames(folder.name, f"folder:{folder}", folder, tuple(frames), Camera("panoramic", mask=mask))
    return resolve_camera(sequence, configure().imaging)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(prog="python -m tests.benchmarks.panoramas", description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--descriptor", nargs="+", default=["hog", "gist"], metavar="NAME")
    parser.add_argument("--mask", type=Path, metavar="FILE.png")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    options = parser.parse_args()
    rows = list(measure(options.folder, options.descriptor, options.mask))
    if not rows:
        parser.error(f"no pairs NN{QUERY}.png and NN{NEAREST}.png in {options.folder} or the folders in it")
    if options.json:
        print(json.dumps({"schema_version": 1, "rank_one": rows}))
        return
    print(f"{'folder':<24} {'queries':>7}  {'descriptor':<12} position  orientation  product")
    for row in rows:
        print(
            f"{row['folder']:<24} {row['queries']:>7}  {row['descriptor']:<12} {row['position']:>8.2f}  "
            f"{row['orientation']:>11.2f}  {row['product']:>7.2f}"
        )


if __name__ == "__main__":
    main()
