"""The rendered building on disk: the files it writes, the cache they are kept in, the card that describes them."""

from __future__ import annotations

import os
import subprocess
import sys

import cv2
import numpy as np
import pytest

from omnieval.datasets import load
from omnieval.datasets.cards import card
from omnieval.datasets.cold import scan_places
from omnieval.datasets.sequence import Mirror
from omnieval.datasets.synthetic import LIGHTS, MIRROR, RENDERER_VERSION, cached, camera, synthesize, write
from omnieval.datasets.synthetic.day import day_of
from omnieval.datasets.synthetic.drives import drive
from omnieval.datasets.synthetic.first import FIRST, ROOMS
from omnieval.datasets.synthetic.lighting import LIGHTS as DAYS
from omnieval.datasets.synthetic.shoot import Drive
from omnieval.errors import DatasetError


@pytest.fixture(scope="module")
def tours():
    return {light: drive(day_of(FIRST, light), 0) for light in LIGHTS}


def path_length(poses):
    return np.hypot(*np.diff(poses[:, :2], axis=0).T).sum()


def image_of(folder):
    (image,) = folder.glob("omni_cam/*.jpeg")
    return image.read_bytes()


def files_of(folder):
    return {path.relative_to(folder): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


class TestSynthesize:
    def test_same_seed_same_bytes_whatever_the_workers_and_a_shorter_one_is_a_prefix(self, tmp_path):
        counted = []
        one = synthesize(
            tmp_path / "one", frames=4, workers=1, progress=lambda done, all_: counted.append((done, all_))
        )
        many = synthesize(tmp_path / "many", frames=4, workers=3)
        short = synthesize(tmp_path / "short", frames=2)
        assert counted == [(1, 4), (2, 4), (3, 4), (4, 4)]
        assert files_of(one) == files_of(many)
        images = {name: data for name, data in files_of(short).items() if name.suffix == ".jpeg"}
        assert len(images) == 2
        assert images.items() <= files_of(one).items()

    def test_another_process_with_other_hashes_writes_the_same_bytes(self, tmp_path):
        here = synthesize(tmp_path / "here", light="night", frames=1, seed=3)
        code = (
            "import sys; from pathlib import Path; from omnieval.datasets.synthetic import synthesize; "
            "synthesize(Path(sys.argv[1]), light='night', frames=1, seed=3)"
        )
        there = tmp_path / "there"
        subprocess.run([sys.executable, "-c", code, str(there)], check=True, env={**os.environ, "PYTHONHASHSEED": "77"})
        assert files_of(here) == files_of(there)

    def test_another_seed_or_light_gives_another_sequence(self, tmp_path):
        first = synthesize(tmp_path / "a", frames=1)
        images = [image_of(first)]
        for light, seed in (("cloudy", 1), ("night", 0), ("sunny", 0)):
            folder = synthesize(tmp_path / f"{light}-{seed}", frames=1, light=light, seed=seed)
            images.append(image_of(folder))
        assert len(set(images)) == 4

    def test_it_is_a_cold_sequence(self, tmp_path):
        folder = synthesize(tmp_path / "seq", frames=12)
        sequence = load(f"cold:{folder}")
        tour = drive(day_of(FIRST, "cloudy"), 0, 12)
        np.testing.assert_array_equal(sequence.positions, tour.poses[:, :2])
        np.testing.assert_array_equal(sequence.yaws, tour.poses[:, 2])
        assert sequence.rooms == tuple(FIRST.room_at(x, y).code for x, y, _ in tour.poses)
        assert sequence.rooms[-1] != sequence.rooms[0] == "CR"
        assert [frame.path.name for frame in sequence.frames] == list(Drive.of("cloudy", 0, 12).names)
        text = (folder / "localization" / "places.lst").read_text()
        rooms, _ = scan_places(text)
        assert list(rooms) == sorted(path.name for path in (folder / "omni_cam").iterdir())
        assert all(line.endswith("-A") for line in text.splitlines())
        image = cv2.imread(str(sequence.frames[0].path))
        assert image is not None
        assert image.shape == (480, 640, 3)

    @pytest.mark.parametrize(
        ("options", "complaint"),
        [
            ({"light": "dusk"}, "no light 'dusk'.*cloudy, night, sunny"),
            ({"frames": 0}, "at least 1 frame, not 0"),
            ({"seed": -1}, "must be 0 or more, not -1"),
            ({"workers": 0}, "at least 1 worker, not 0"),
        ],
    )
    def test_nonsense_is_refused_before_anything_is_written(self, tmp_path, options, complaint):
        with pytest.raises(DatasetError, match=complaint):
            synthesize(tmp_path / "out", **options)
        assert not list(tmp_path.iterdir())

    def test_a_folder_in_use_is_left_alone(self, tmp_path):
        (tmp_path / "notes.txt").write_text("mine")
        with pytest.raises(DatasetError, match="not empty"):
            synthesize(tmp_path, frames=1)
        with pytest.raises(DatasetError, match="not empty"):
            synthesize(tmp_path / "notes.txt", frames=1)
        with pytest.raises(DatasetError, match="cannot write"):
            synthesize(tmp_path / "notes.txt" / "inner", frames=1)
        assert files_of(tmp_path) == {(tmp_path / "notes.txt").relative_to(tmp_path): b"mine"}

    def test_an_interrupted_run_leaves_nothing(self, tmp_path):
        def interrupt(done, total):
            raise KeyboardInterrupt

        with pytest.raises(KeyboardInterrupt):
            synthesize(tmp_path / "out", frames=3, progress=interrupt)
        assert not list(tmp_path.iterdir())


class TestCached:
    @pytest.fixture(autouse=True)
    def cache(self, tmp_path, monkeypatch):
        monkeypatch.setenv("OMNIEVAL_CACHE", str(tmp_path))
        return tmp_path

    def test_it_is_rendered_once_under_the_renderers_version(self, cache, monkeypatch):
        asked = []

        def short(folder, *, light, building):
            asked.append((light, building))
            return synthesize(folder, light=light, frames=1)

        monkeypatch.setattr(write, "synthesize", short)
        folder = cached("night")
        assert folder.is_relative_to(cache)
        assert f"v{RENDERER_VERSION}" in folder.name
        assert cached("night") == folder
        assert asked == [("night", 1)]
        assert len(list((folder / "omni_cam").iterdir())) == 1

    def test_a_sequence_that_another_process_finished_meanwhile_is_taken(self, monkeypatch):
        def beaten(folder, *, light, building):
            folder.mkdir(parents=True)
            raise DatasetError("exists and is not empty")

        monkeypatch.setattr(write, "synthesize", beaten)
        assert cached("sunny").is_dir()

    def test_other_failures_are_reported(self):
        with pytest.raises(DatasetError, match="no light 'dawn'"):
            cached("dawn")


class TestCard:
    def test_the_card_says_what_the_code_does(self, tours):
        known = card("synthetic")
        assert isinstance(known.mirror, Mirror)
        assert known.mirror == MIRROR
        assert known.image_size == (camera.WIDTH, camera.HEIGHT)
        assert set(known.rooms) == {room.code for room in ROOMS}
        assert tuple(sequence.path for sequence in known.sequences) == LIGHTS
        for sequence in known.sequences:
            poses = tours[sequence.path].poses
            assert sequence.images == len(poses)
            assert sequence.length_m == pytest.approx(path_length(poses), abs=0.005)

    def test_cloudy_is_the_default(self):
        assert LIGHTS[0] == "cloudy"
        assert set(LIGHTS) == set(DAYS)


def test_importing_it_is_light():
    code = "import sys, omnieval.datasets.synthetic; print('cv2' in sys.modules)"
    shown = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert shown.stdout.strip() == "False"
