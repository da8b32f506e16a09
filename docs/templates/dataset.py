"""A dataset of your own, to start from: ``cp docs/templates/dataset.py mine.py``, ``pytest mine.py``.

Replay it from Python: ``omnieval.replay(load("mine:/data/drive"))``.
"""

from pathlib import Path

import numpy as np

from omnieval.datasets import Camera, Frame, Pose, Sequence
from omnieval.errors import DatasetError
from omnieval.testing import check_dataset


def load(source: str) -> Sequence:
    """Return the sequence in a folder of images called ``MILLISECONDS_X_Y.png``.

    Parameters
    ----------
    source
        ``mine:FOLDER``.

    Raises
    ------
    DatasetError
        If there are no such images.
    """
    folder = Path(source.removeprefix("mine:"))
    frames = tuple(sorted(map(_frame, folder.glob("*_*_*.png")), key=lambda frame: frame.time_ns or 0))
    if not frames:
        raise DatasetError(f"{folder}: no image called MILLISECONDS_X_Y.png in it; name the folder that has them")
    return Sequence(folder.name, source, folder, frames, camera=Camera("panoramic"))


def _frame(path: Path) -> Frame:
    """Return an image with its time (integer nanoseconds) and pose (metres; the heading is not known)."""
    milliseconds, x, y = path.stem.split("_")
    return Frame(path, path.name, time_ns=int(milliseconds) * 1_000_000, pose=Pose(float(x), float(y), float("nan")))


def test_it_keeps_the_contract_of_datasets(tmp_path):
    import cv2

    for number in range(12):
        image = np.random.default_rng(number).integers(0, 255, (64, 256), np.uint8)
        cv2.imwrite(str(tmp_path / f"{200 * number}_{0.1 * number:.2f}_0.0.png"), image)
    check_dataset(load(f"mine:{tmp_path}"), load=load)
