"""A map that continues with another sequence, compared with one run over both."""

import dataclasses
import shutil

import numpy as np
import pytest

import omnieval
from omnieval.errors import ConfigError, DatasetError, ResultError
from omnieval.loop import hold_decision, replay
from omnieval.mapping.step import Role, Step
from omnieval.material.reopened import reopened
from omnieval.regression.cases import Job
from omnieval.render import render
from omnieval.results.run_folder import open_run
from tests.localization.conftest import CONFIG

FIRST = 40
MAPPERS = {"roman2020": CONFIG, "leader": {"radius": 1.5}, "geodesic": {}}


@pytest.fixture(scope="module")
def begun(panoramas, tmp_path_factory):
    """A run over the first half of the three places."""
    return replay(panoramas, config=CONFIG, limit=FIRST, out=tmp_path_factory.mktemp("begun") / "run", recording=False)


@pytest.fixture(scope="module")
def gone_on(panoramas, begun, tmp_path_factory):
    """The run that continues with the second half."""
    out = tmp_path_factory.mktemp("gone-on") / "run"
    return replay(panoramas, start=FIRST, continuing=begun, out=out, recording=False)


@pytest.fixture(scope="module")
def unposed(panoramas, tmp_path_factory):
    """A few of the images, of which nobody knows where they were taken."""
    folder = tmp_path_factory.mktemp("unposed")
    for number in range(4):
        shutil.copy(panoramas / f"image{number}.png", folder)
    return folder


def assert_same_map(run, other):
    assert run.steps.drop("milliseconds").equals(other.steps.drop("milliseconds"))
    assert run.nodes.equals(other.nodes)
    assert run.transitions.equals(other.transitions)
    assert run.quality.equals(other.quality)
    assert run.metrics == other.metrics
    assert run.map.digest == other.map.digest


@pytest.mark.parametrize("mapper", MAPPERS)
def test_decisions_are_those_of_one_run_over_both(panoramas, tmp_path, mapper):
    settings = {"mapper": mapper, "recording": False, **MAPPERS[mapper]}
    whole = replay(panoramas, out=tmp_path / "whole", **settings)
    first = replay(panoramas, limit=FIRST, out=tmp_path / "first", **settings)
    both = replay(panoramas, start=FIRST, continuing=first, out=tmp_path / "both", recording=False)
    assert len(both.steps) == 80
    assert mapper == "geodesic" or len(both.nodes) >= 2  # that takes so short a sequence for one place
    assert_same_map(both, whole)


def test_it_goes_on_again_and_again(panoramas, gone_on, begun, tmp_path):
    middle = replay(panoramas, start=FIRST, limit=10, continuing=begun, out=tmp_path / "middle", recording=False)
    again = replay(panoramas, start=FIRST + 10, continuing=middle.folder, out=tmp_path / "again", recording=False)
    assert_same_map(again, gone_on)
    assert again.manifest["sequence"] == "+".join([panoramas.name] * 3)


def test_it_says_from_which_map(begun, gone_on, panoramas):
    told = gone_on.manifest["continues"]
    assert told == {
        "run": str(begun.folder),
        "sequence": panoramas.name,
        "source": begun.manifest["source"],
        "images": FIRST,
        "digest": begun.map.digest,
    }
    assert gone_on.map.about["continues"] == told
    assert gone_on.manifest["cut"]["start"] == FIRST
    assert gone_on.manifest["identity"] != begun.manifest["identity"]


def test_the_map_it_goes_on_from_stays_as_it_is(begun, panoramas, tmp_path):
    before = {file.name: file.read_bytes() for file in begun.folder.iterdir()}
    replay(panoramas, start=FIRST, continuing=begun, out=tmp_path / "run", recording=False)
    assert {file.name: file.read_bytes() for file in begun.folder.iterdir()} == before


def test_it_is_opened_again_with_the_pictures_of_both(begun, gone_on):
    with reopened(begun, describe=False) as material:
        assert material.pictures is not None
        expected = material.pictures.panorama(7)
    with reopened(gone_on) as material:
        assert len(list(material.described)) == 80
        assert material.pictures is not None
        np.testing.assert_array_equal(material.pictures.panorama(7), expected)
        assert not np.array_equal(material.pictures.panorama(FIRST + 7), expected)
        assert material.pictures.omnidirectional(7) is None
    assert render(gone_on).exists()


def test_others_are_found_in_it(gone_on, panoramas, tmp_path):
    found = omnieval.localize(gone_on, panoramas, strategies=["nearest"], out=tmp_path / "found")
    assert found.table["best_frame"].to_list() == list(range(80))


def test_without_the_earlier_images_there_are_no_pictures_of_them(panoramas, tmp_path):
    images = tmp_path / "images"
    shutil.copytree(panoramas, images)
    first = replay(images, config=CONFIG, limit=FIRST, out=tmp_path / "first", recording=False)
    shutil.rmtree(images)
    both = replay(panoramas, start=FIRST, continuing=first, out=tmp_path / "both", recording=True)
    assert both.status == "complete"
    assert "whose map is continued, cannot be shown" in both.manifest["recording_failure"]
    with reopened(both) as material:
        assert material.pictures is not None
        assert material.pictures.panorama(FIRST).size
        for _ in range(2):
            with pytest.raises(DatasetError, match="cannot be shown"):
                material.pictures.panorama(0)


def test_positions_are_joined_only_where_both_are_known(begun, unposed, tmp_path):
    on = replay(unposed, continuing=begun, out=tmp_path / "on", recording=False)
    assert on.metrics["silhouette_positions"] is None
    assert "no poses" in on.manifest["null_reasons"]["silhouette_positions"]
    assert on.steps["x"].null_count() == 4
    first = replay(unposed, mapper="leader", out=tmp_path / "first", recording=False)
    then = replay(begun.manifest["source"], limit=20, continuing=first, out=tmp_path / "then", recording=False)
    assert then.metrics["silhouette_positions"] is None
    assert "images of the map" in then.manifest["null_reasons"]["silhouette_positions"]


def test_archives_go_on_with_archives(panoramas, begun, tmp_path):
    omnieval.describe_archive(panoramas, tmp_path / "first.npz", limit=FIRST)
    omnieval.describe_archive(panoramas, tmp_path / "then.npz", start=FIRST)
    first = replay(f"npz:{tmp_path}/first.npz", config=CONFIG, out=tmp_path / "first", recording=False)
    both = replay(f"npz:{tmp_path}/then.npz", continuing=first, out=tmp_path / "both", recording=False)
    assert len(both.steps) == 80
    with pytest.raises(ResultError, match="give the images, not descriptors"):
        replay(f"npz:{tmp_path}/then.npz", continuing=begun, out=tmp_path / "x")
    with pytest.raises(ResultError, match="give npz:FILE"):
        replay(panoramas, continuing=first, out=tmp_path / "x")
    other = tmp_path / "other.npz"
    omnieval.describe_archive(panoramas, other, descriptor="gist", limit=4)
    with pytest.raises(ResultError, match=r"descriptors have shapes .* those of the map"):
        replay(f"npz:{other}", continuing=first, out=tmp_path / "x")


class TestRefused:
    @pytest.mark.parametrize("given", [{"omega": 2.0}, {"mapper": "leader"}, {"descriptor": "gist"}, {"config": {}}])
    def test_what_the_map_brings(self, panoramas, begun, tmp_path, given):
        with pytest.raises(ConfigError, match="its own mapper, descriptor and imaging"):
            replay(panoramas, continuing=begun, out=tmp_path / "x", **given)

    def test_its_own_folder(self, panoramas, begun):
        with pytest.raises(ConfigError, match="whose map is continued; choose another --out"):
            replay(panoramas, continuing=begun, out=begun.folder, overwrite=True)
        assert open_run(begun.folder).status == "complete"

    def test_a_run_without_a_map(self, panoramas, tmp_path):
        run = replay(panoramas, config=CONFIG, save_map=False, out=tmp_path / "run", recording=False)
        with pytest.raises(ResultError, match="has no map"):
            replay(panoramas, continuing=run, out=tmp_path / "x")

    def test_a_map_that_has_changed_since(self, panoramas, tmp_path):
        settings = {"config": CONFIG, "recording": False, "out": tmp_path / "first"}
        first = replay(panoramas, limit=FIRST, **settings)
        both = replay(panoramas, start=FIRST, continuing=first, out=tmp_path / "both", recording=False)
        replay(panoramas, limit=30, overwrite=True, **settings)
        with pytest.raises(ResultError, match="has another map now"), reopened(both):
            pass

    def test_a_decision_that_comes_out_otherwise(self):
        step = Step(3, "near", Role.JOINED, 2)
        hold_decision(step, dataclasses.replace(step, measured={"ratio": 0.5}), "runs/a")
        with pytest.raises(ResultError, match="step 3 of runs/a is decided differently now: far became near"):
            hold_decision(step, dataclasses.replace(step, verdict="far"), "runs/a")
        with pytest.raises(ResultError, match="decided differently"):
            hold_decision(step, dataclasses.replace(step, node=1), "runs/a")

    def test_a_case_of_a_check(self, gone_on):
        with pytest.raises(ConfigError, match="which a case cannot describe"):
            Job.of_run(gone_on)
