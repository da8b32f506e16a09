"""Runs to export: of a building with poses, of images without, of descriptors alone."""

import pytest

import omnieval
from tests.report.conftest import SMALL


def replayed(source, out, **changes):
    return omnieval.replay(source, config=omnieval.configure(SMALL | changes), out=out, recording=None)


@pytest.fixture(scope="session")
def run(panoramas, tmp_path_factory):
    """A complete run of three places, visited in turn."""
    return replayed(panoramas, tmp_path_factory.mktemp("exports") / "three")


@pytest.fixture(scope="session")
def unposed(panoramas, tmp_path_factory):
    """A complete run of images without poses and times."""
    images = tmp_path_factory.mktemp("exports") / "bare"
    images.mkdir()
    for number in range(60):
        (images / f"image{number}.png").write_bytes((panoramas / f"image{number}.png").read_bytes())
    return replayed(images, images.parent / "bare-hog")
