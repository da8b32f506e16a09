"""gist against the double-precision oracle, under rotation, and on gratings whose answer is known."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

import omnieval
from omnieval.descriptors.gist import Gist, GistSettings
from omnieval.errors import ConfigError
from tests.reference.gist import gist as plain_gist

SMALL = {"orientations": 8, "position_cells": 4, "orientation_cells": 32, "padding": 8}
OPTIONS = [
    {},
    {"orientations": 5},
    {"levels": 1},
    {"levels": 3},
    {"orientation_width": 5},
    {"orientation_width": 64},
    {"padding": 0},
    {"padding": 40},  # more than the image has rows
    {"lowpass_sigma": 1.7},
    {"prefilter": "local-contrast"},
    {"normalisation": "global-l2"},
    {"prefilter": "local-contrast", "normalisation": "global-l2", "levels": 1},
]


def a_panorama(seed=0, rows=32, columns=64):
    """Blobs with edges and noise over all grey levels."""
    rng = np.random.default_rng(seed)
    scene = gaussian_filter(rng.normal(size=(rows, columns)), (2, 3), mode=("nearest", "wrap"))
    grey = 128 + 70 * scene / scene.std() + 40 * (scene > 0) + 5 * rng.normal(size=scene.shape)
    return np.clip(grey, 0, 255).astype(np.uint8)


def a_grating(orientation, *, frequency=0.3, rows=128, columns=512):
    """A wave along -orientation * pi / 16 (rows downwards): what filter number `orientation` is made for."""
    angle = -orientation * np.pi / 16
    down, across = np.mgrid[:rows, :columns]
    # A whole number of waves around the panorama.
    around = np.round(frequency * np.cos(angle) * columns) / columns
    wave = np.cos(2 * np.pi * (around * across + frequency * np.sin(angle) * down))
    return np.round(127.5 + 100 * wave).astype(np.uint8)


@pytest.mark.parametrize("options", OPTIONS, ids=str)
def test_agrees_with_the_oracle(options):
    settings = SMALL | options
    panorama = a_panorama()
    found = Gist(GistSettings(**settings)).describe(panorama)
    position, orientation = plain_gist(panorama, **settings)
    np.testing.assert_allclose(found.position, position.ravel(), rtol=3e-6, atol=1e-6 * position.max())
    np.testing.assert_allclose(found.orientation, orientation, rtol=3e-6, atol=1e-6 * orientation.max())


def test_sizes_are_the_papers():
    found = Gist().describe(a_panorama(rows=128, columns=512))
    assert found.position.shape == (512,)
    assert found.orientation.shape == (256, 16)
    assert found.position.dtype == found.orientation.dtype == np.float32


@pytest.mark.parametrize("orientation", range(16))
def test_a_grating_is_answered_by_the_filter_made_for_it(orientation):
    found = Gist().describe(a_grating(orientation))
    finest = found.position.reshape(2, 16, 16)[0]
    # Away from the mirrored edges, where the wave runs the other way.
    assert (finest[4:12].argmax(axis=1) == orientation).all()
    # One half of a cosine of amplitude 100, at the top of the filter.
    np.testing.assert_allclose(finest[4:12, orientation], 50, rtol=0.02)


def test_a_wave_twice_as_long_is_answered_on_the_coarser_level():
    fine, coarse = Gist().describe(a_grating(0, frequency=0.15)).position.reshape(2, 16, 16)[:, 8]
    assert coarse.argmax() == fine.argmax() == 0
    # At half the centre frequency a filter answers exp(-3.5 / 4) of its best; the low-pass leaves
    # exp(-2 (0.15 pi)^2) of the wave.
    assert fine[0] == pytest.approx(50 * np.exp(-3.5 / 4), rel=0.03)
    assert coarse[0] == pytest.approx(50 * np.exp(-2 * (0.15 * np.pi) ** 2), rel=0.03)


@pytest.mark.parametrize("prefilter", ["none", "local-contrast"])
@pytest.mark.parametrize("columns", [2, 18, 256, 510])
def test_a_rotation_leaves_the_position_descriptor_and_rolls_the_other(columns, prefilter):
    panorama = a_panorama(1, 128, 512)
    gist = Gist(GistSettings(prefilter=prefilter))
    still, turned = gist.describe(panorama), gist.describe(np.roll(panorama, columns, axis=1))
    np.testing.assert_allclose(turned.position, still.position, atol=1e-6 * still.position.max())
    rolled = np.roll(still.orientation, columns // 2, axis=0)
    np.testing.assert_allclose(turned.orientation, rolled, atol=1e-6 * rolled.max())


@pytest.mark.parametrize("columns", [1, 17, 511])
def test_a_rotation_by_odd_columns_aliases_on_the_coarser_level_only(columns):
    panorama = a_panorama(2, 128, 512)
    gist = Gist()
    still = gist.describe(panorama).position.reshape(2, -1)
    turned = gist.describe(np.roll(panorama, columns, axis=1)).position.reshape(2, -1)
    np.testing.assert_allclose(turned[0], still[0], atol=1e-6 * still.max())
    aliased = np.linalg.norm(turned[1] - still[1]) / np.linalg.norm(still[1])
    assert 1e-6 < aliased < 0.01


def test_more_light_hardly_matters_with_the_prefilter():
    panorama = a_panorama(3, 128, 512) // 2 + 20
    brighter = panorama + 50
    changes = {}
    for prefilter in ("none", "local-contrast"):
        gist = Gist(GistSettings(prefilter=prefilter, normalisation="global-l2"))
        changes[prefilter] = np.linalg.norm(gist.describe(brighter).position - gist.describe(panorama).position)
    assert changes["local-contrast"] < changes["none"]


@pytest.mark.parametrize("prefilter", ["none", "local-contrast"])
@pytest.mark.parametrize("normalisation", ["none", "global-l2"])
def test_a_black_image_has_a_descriptor_of_zeros(prefilter, normalisation):
    gist = Gist(GistSettings(prefilter=prefilter, normalisation=normalisation))
    found = gist.describe(np.zeros((128, 512), np.uint8))
    assert not found.position.any()
    assert not found.orientation.any()


def test_a_globally_normalised_descriptor_has_unit_length():
    found = Gist(GistSettings(normalisation="global-l2")).describe(a_panorama(4, 128, 512))
    assert np.linalg.norm(found.position) == pytest.approx(1, abs=1e-3)
    assert np.linalg.norm(found.orientation) == pytest.approx(1, abs=1e-3)


def test_threads_do_not_disturb_each_other():
    panoramas = [a_panorama(seed, rows, 256) for seed in range(4) for rows in (64, 96)]
    gist = Gist()
    expected = [gist.describe(panorama) for panorama in panoramas]
    # A bank nobody has built yet, asked for by all threads at once.
    fresh = Gist(GistSettings(padding=17))
    with ThreadPoolExecutor(4) as pool:
        together = list(pool.map(gist.describe, panoramas))
        first_use = list(pool.map(fresh.describe, [panoramas[0]] * 4))
    for found, alone in zip(together, expected, strict=True):
        assert np.array_equal(found.position, alone.position)
        assert np.array_equal(found.orientation, alone.orientation)
    assert all(np.array_equal(found.position, first_use[0].position) for found in first_use)


@pytest.mark.parametrize(("rows", "columns"), [(100, 512), (16, 512), (128, 300)])
def test_a_size_that_does_not_divide_is_refused(rows, columns):
    with pytest.raises(ConfigError, match=r"set imaging\.rows to a multiple of 32"):
        Gist().describe(np.zeros((rows, columns), np.uint8))


def test_it_is_called_by_name_and_set_by_its_section():
    descriptor = omnieval.configure({"gist.prefilter": "local-contrast"}, descriptor="gist").descriptor
    assert descriptor.name == descriptor.make().name == "gist"
    assert descriptor.make().settings.prefilter == descriptor.settings["prefilter"] == "local-contrast"
    with pytest.raises(ConfigError, match=r"gist\.levels"):
        omnieval.configure({"gist.levels": 0})


@pytest.fixture(scope="module")
def run(panoramas, tmp_path_factory):
    config = omnieval.configure(descriptor="gist", n_init=10, n_new=10, gamma=1.0, omega=3.5, merge_y=0.5)
    return omnieval.replay(panoramas, config=config, out=tmp_path_factory.mktemp("gist") / "run")


def test_a_replay_with_it_finds_the_three_places(run):
    assert run.manifest["descriptor"]["name"] == "gist"
    assert run.metrics["nodes"] >= 3
    assert run.metrics["silhouette"] > run.metrics["silhouette_time_slices"]
