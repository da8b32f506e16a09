"""Runs over three places, with poses and rooms, that share their images and differ in one parameter."""

import pytest

import omnieval
from omnieval.loop import replay
from omnieval.results.run_folder import Run

CONFIG = {"n_init": 10, "n_new": 10, "gamma": 3.0, "omega": 3.5, "merge_y": 0.5}


@pytest.fixture(scope="session")
def run_of(panoramas, tmp_path_factory):
    """Replay with some parameters; equal ones are replayed once."""
    out = tmp_path_factory.mktemp("explained")
    made: dict[tuple[tuple[str, float], ...], Run] = {}

    def run(**changed):
        key = tuple(sorted(changed.items()))
        if key not in made:
            folder = out / f"run{len(made)}"
            made[key] = replay(panoramas, config=omnieval.configure({**CONFIG, **changed}), out=folder)
        return made[key]

    return run


@pytest.fixture(scope="session")
def run(run_of):
    return run_of()
