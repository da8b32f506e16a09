"""What all tests share: a cache of their own, and a small sequence with places that are visited again."""

import csv
import signal

import cv2
import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

VISITS = (0, 1, 2, 1, 0)
DWELL = 16


def pytest_configure():
    """Hear Ctrl-C, which some tests send: what a shell starts in the background is made deaf to it."""
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(scope="session", autouse=True)
def _cache_of_our_own(tmp_path_factory):
    patch = pytest.MonkeyPatch()
    patch.setenv("OMNIEVAL_CACHE", str(tmp_path_factory.mktemp("cache")))
    yield
    patch.undo()


@pytest.fixture(scope="session")
def panoramas(tmp_path_factory):
    """A folder of 80 panoramas of three places, visited in turn, with ``poses.csv`` and rooms."""
    folder = tmp_path_factory.mktemp("three-places")
    rng = np.random.default_rng(0)
    places = [gaussian_filter(rng.normal(size=(64, 256)), (4, 6), mode=("nearest", "wrap")) for _ in VISITS]
    centers = [(0.0, 0.0), (10.0, 0.0), (10.0, 8.0)]
    with (folder / "poses.csv").open("w", newline="") as stream:
        table = csv.writer(stream)
        table.writerow(["file", "x", "y", "yaw", "room", "time"])
        for number in range(len(VISITS) * DWELL):
            place = VISITS[number // DWELL]
            turn = int(rng.integers(256))
            scene = places[place] + 0.15 * gaussian_filter(rng.normal(size=(64, 256)), 2)
            grey = np.clip(128 + 60 * scene / np.std(scene), 0, 255).astype(np.uint8)
            cv2.imwrite(str(folder / f"image{number}.png"), np.roll(grey, turn, axis=1))
            x, y = rng.normal(centers[place], 0.3)
            yaw = np.angle(np.exp(2j * np.pi * turn / 256))
            table.writerow(
                [f"image{number}.png", f"{x:.6f}", f"{y:.6f}", f"{yaw:.6f}", f"R{place}", f"{number / 5:.1f}"]
            )
    return folder


@pytest.fixture(scope="session")
def few_clusters():
    """Lets reports cluster into no more than 8: that of a small replay spends most of its time on the others."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("omnieval.report.replays.KS", range(2, 9))
        yield
