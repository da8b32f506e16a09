"""Results to report on: a replay, a sweep with its steps, and a baseline of the same three places."""

import pytest

import omnieval
from omnieval.benchmark import run_baseline

SMALL = {"n_init": 10, "n_new": 10, "gamma": 1.0, "omega": 3.5, "merge_y": 0.5}


def replay_of(source, out, **changes):
    return omnieval.replay(source, config=omnieval.configure(SMALL | changes), out=out, recording=None)


@pytest.fixture(scope="session", autouse=True)
def _few_clusters(few_clusters):
    """Small replays have small reports."""


@pytest.fixture(scope="session")
def run(panoramas, tmp_path_factory):
    """The folder of a complete replay."""
    return replay_of(panoramas, tmp_path_factory.mktemp("report") / "three-hog").folder


@pytest.fixture(scope="session")
def sweep(panoramas, tmp_path_factory):
    """The folder of a sweep over two parameters, with the steps of every run."""
    folder = tmp_path_factory.mktemp("report") / "sweep"
    fixed = {name: value for name, value in SMALL.items() if name not in {"omega", "merge_y"}}
    vary = {"omega": [2.5, 3.5], "merge_y": [0.5, 2.5, 40.0]}
    omnieval.ablate(panoramas, vary, settings=fixed, out=folder, keep_steps=True)
    return folder


@pytest.fixture(scope="session")
def baseline(panoramas, tmp_path_factory):
    """The folder of a spectral baseline."""
    return run_baseline(panoramas, ks=range(2, 9), out=tmp_path_factory.mktemp("report") / "spectral").folder


@pytest.fixture
def unposed(panoramas, tmp_path):
    """The folder of a replay of images without poses."""
    images = tmp_path / "unposed"
    images.mkdir()
    for number in range(60):
        (images / f"image{number}.png").write_bytes((panoramas / f"image{number}.png").read_bytes())
    return replay_of(images, tmp_path / "unposed-hog").folder
