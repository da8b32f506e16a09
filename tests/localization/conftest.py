"""A small map, and the same places driven through again with other noise."""

import csv

import cv2
import numpy as np
import pytest

from omnieval.loop import replay

CONFIG = {"n_init": 10, "n_new": 10, "gamma": 1.0, "omega": 3.5, "merge_y": 0.5}


@pytest.fixture(scope="session")
def mapped(panoramas, tmp_path_factory):
    """A run over the three places."""
    return replay(panoramas, config=CONFIG, out=tmp_path_factory.mktemp("maps") / "cloudy", recording=False)


@pytest.fixture(scope="session")
def darker(panoramas, tmp_path_factory):
    """Every fourth image of the three places, darker and turned by a quarter, half a metre on."""
    folder = tmp_path_factory.mktemp("darker")
    with (panoramas / "poses.csv").open() as stream:
        rows = list(csv.DictReader(stream))[::4]
    with (folder / "poses.csv").open("w", newline="") as stream:
        table = csv.DictWriter(stream, rows[0])
        table.writeheader()
        for row in rows:
            image = cv2.imread(str(panoramas / row["file"]), cv2.IMREAD_GRAYSCALE)
            assert image is not None
            darker = np.roll(np.asarray(image) * 0.7, 64, axis=1).astype(np.uint8)
            cv2.imwrite(str(folder / row["file"]), darker)
            table.writerow(row | {"x": float(row["x"]) + 0.5, "yaw": float(row["yaw"]) + np.pi / 2})
    return folder
