"""Rank 1 of descriptors on real panoramas: ``python -m tests.benchmarks.panoramas FOLDER [--descriptor NAME ...]``.

FOLDER, or each folder in it, holds pairs of panoramas by name: ``01_query.png`` and ``01_nearest.png``, the image of a
map that was taken nearest to where the query was. For every query all nearest images of its folder are compared: how
often is its own the best by position, by orientation at the best roll, and by the product of both similarities? Then,
over the queries of all folders, by how much these shares differ from those of the first descriptor, with the 95 %
bootstrap interval. ``--mask`` is an image of the panoramas' size, white where the scene is seen.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from omnieval.components.component import resolve_component
from omnieval.config import configure
from omnieval.datasets.sequence import Camera, Frame
from omnieval.datasets.sequence import Sequence as Frames
from omnieval.descriptors.cache import DescriptorCache
from omnieval.descriptors.describe import Describer
from omnieval.descriptors.description import Description
from omnieval.descriptors.distance import DescriptionStore
from omnieval.imaging.camera import CameraModel, resolve_camera
from omnieval.statistics.estimate import mean_estimate
from omnieval.text_table import aligned, cell_text, sides

QUERY, NEAREST = "_query", "_nearest"


def pairs(folder: Path) -> list[tuple[Path, Path]]:
    """Return the queries of a folder, each with the image nearest to it; those without one are left out."""
    nearest = {path.stem.removesuffix(NEAREST): path for path in sorted(folder.iterdir()) if NEAREST in path.stem}
    queries = {path.stem.removesuffix(QUERY): path for path in sorted(folder.iterdir()) if QUERY in path.stem}
    return [(query, nearest[name]) for name, query in queries.items() if name in nearest]


BY = ("position", "orientation", "product")
"""What images are compared by."""

Hits = dict[str, NDArray[np.float64]]
"""By each of them: 1 for a query whose own image is the best, 0 for another, shape (queries,)."""


def rank_one(queries: Sequence[Description], others: Sequence[Description]) -> Hits:
    """Return for which queries their own image, of the same number among the others, is the best."""
    store = DescriptionStore()
    for description in (*others, *queries):
        store.append(description)
    among = np.arange(len(others))
    hits = {by: np.zeros(len(queries)) for by in BY}
    for number in range(len(queries)):
        found = store.compare(len(others) + number, among)
        distances = {
            "position": found.position,
            "orientation": found.orientation,
            "product": found.position * found.orientation,
        }
        for by, distance in distances.items():
            hits[by][number] = distance.argmin() == number
    return hits


def measure(folder: Path, descriptors: Sequence[str], mask: Path | None) -> Iterator[tuple[str, str, Hits]]:
    """Yield the names of folder and descriptor and the hits, for every folder with pairs and every descriptor."""
    folders = [one for one in (folder, *sorted(path for path in folder.iterdir() if path.is_dir())) if pairs(one)]
    for one in folders:
        found = pairs(one)
        frames = [Frame(path, path.name) for path in (*(query for query, _ in found), *(near for _, near in found))]
        camera = _camera(one, frames, mask)
        for name in descriptors:
            component = resolve_component("descriptor", name)
            with DescriptorCache() as cache:
                described = [item.description for item in Describer(camera, component, cache).describe_frames(frames)]
            yield one.name, component.name, rank_one(described[: len(found)], described[len(found) :])


def differences(measured: Sequence[tuple[str, str, Hits]]) -> list[dict[str, str | int | float | None]]:
    """Return by how much the shares of each descriptor are above those of the first, over all queries."""
    together: dict[str, Hits] = {}
    for _, name, hits in measured:
        before = together.get(name, {by: np.zeros(0) for by in BY})
        together[name] = {by: np.concatenate([before[by], hits[by]]) for by in BY}
    first, *others = together
    rows: list[dict[str, str | int | float | None]] = []
    for name in others:
        for by in BY:
            found = mean_estimate(together[name][by] - together[first][by])
            interval = {"difference": found.value, "low": found.low, "high": found.high}
            rows.append({"descriptor": name, "against": first, "by": by, "queries": found.n, **interval})
    return rows


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
    measured = list(measure(options.folder, options.descriptor, options.mask))
    if not measured:
        parser.error(f"no pairs NN{QUERY}.png and NN{NEAREST}.png in {options.folder} or the folders in it")
    shares: list[dict[str, Any]] = [
        {"folder": folder, "queries": len(hits["product"]), "descriptor": name}
        | {by: float(one.mean()) for by, one in hits.items()}
        for folder, name, hits in measured
    ]
    against = differences(measured)
    if options.json:
        print(json.dumps({"schema_version": 1, "rank_one": shares, "differences": against}))
        return
    for rows in (shares, against):
        if rows:
            cells = [list(row.values()) for row in rows]
            text = [list(rows[0]), *[[cell_text(cell) for cell in row] for row in cells]]
            print("\n".join([*aligned(text, sides(len(rows[0]), cells)), ""]))


if __name__ == "__main__":
    main()
